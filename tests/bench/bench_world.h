// Shipped worlds for benchmarks; a world that cannot be loaded ends the program.
#pragma once

#include "generator/terrain/world.h"
#include "generator/world/world_file.h"

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <utility>

namespace terrane::bench {

inline std::shared_ptr<const World> bench_world(const std::string& name) {
    WorldFileResult file =
        load_world_file(std::string(TERRANE_SOURCE_DIR) + "/generator/worlds/" + name + ".toml");
    auto world = file.ok()
                     ? World::build(std::move(file.definition))
                     : Result<World>(fail(ErrorCode::invalid_argument, file.faults.front().text()));
    if (!world) {
        std::fprintf(stderr, "%s: %s\n", name.c_str(), world.error().message.c_str());
        std::exit(1);
    }
    return std::make_shared<const World>(std::move(*world));
}

}  // namespace terrane::bench
