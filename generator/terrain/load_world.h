// From a world file to a built world, or everything that is wrong with it.
#pragma once

#include "generator/terrain/world.h"
#include "generator/world/world_file.h"

#include <filesystem>
#include <memory>
#include <string_view>
#include <vector>

namespace terrane {

/// Either `world` is there and `faults` is empty, or the other way round.
struct LoadedWorld {
    std::shared_ptr<const World> world;
    std::vector<WorldFileFault> faults;

    bool ok() const { return world != nullptr; }
};

/// Reads, checks and builds. What shows only when the world is built (a height bound above
/// kHeightBoundMax, more elements than kElementsPerRegionMax) is a fault of the file's [terrain].
LoadedWorld load_world(const std::filesystem::path& path);

/// The same for text already read; see parse_world_file.
LoadedWorld build_world(WorldFileResult file, std::string_view name);

}  // namespace terrane
