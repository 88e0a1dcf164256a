#include "server/cli/open_world.h"

#include "generator/terrain/load_world.h"
#include "generator/terrain/world.h"
#include "generator/world/world_file.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

namespace terrane {

std::shared_ptr<const World> open_world(const std::filesystem::path& path) {
    LoadedWorld loaded = load_world(path);
    if (!loaded.ok()) {
        print_faults(loaded.faults);
    }
    return std::move(loaded.world);
}

void print_faults(const std::vector<WorldFileFault>& faults) {
    for (const WorldFileFault& fault : faults) {
        std::fprintf(stderr, "%s\n", fault.text().c_str());
    }
    std::fprintf(stderr, "%zu %s\n", faults.size(), faults.size() == 1 ? "fault" : "faults");
}

}  // namespace terrane
