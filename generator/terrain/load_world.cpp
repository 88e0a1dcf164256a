#include "generator/terrain/load_world.h"

#include "generator/terrain/world.h"
#include "generator/world/world_file.h"
#include "protocol/base/result.h"

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace terrane {

LoadedWorld load_world(const std::filesystem::path& path) {
    return build_world(load_world_file(path), path.string());
}

LoadedWorld build_world(WorldFileResult file, std::string_view name) {
    if (!file.ok()) {
        return {.world = nullptr, .faults = std::move(file.faults)};
    }
    Result<World> world = World::build(std::move(file.definition));
    if (!world) {
        return {.world = nullptr,
                .faults = {{.file = std::string(name),
                            .line = file.terrain_line,
                            .column = file.terrain_column,
                            .key = "terrain",
                            .message = world.error().message}}};
    }
    return {.world = std::make_shared<const World>(std::move(*world)), .faults = {}};
}

}  // namespace terrane
