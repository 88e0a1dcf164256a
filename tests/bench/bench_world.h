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

/// A game's world: 12 layers, 4 octaves, 256 voxels high, 32^3 chunks.
inline std::shared_ptr<const World> high_world(double density) {
    WorldDefinition definition = bench_world("paper-B3")->definition;
    definition.name = "high";
    definition.grid = {.side = 32, .height = 32, .plot = 160, .voxel_size_m = 1};
    TerrainParameters& terrain = definition.terrain;
    terrain.depth = 220;
    terrain.scale = 90;
    terrain.octaves = 4;
    terrain.vein_area = terrain.cave_area = 60;
    terrain.vein_density = terrain.cave_density = density;
    for (terrain.layer_thickness = 20;; terrain.layer_thickness += 0.5) {
        auto world = World::build(definition);
        if (world && world->stack.layers.size() <= 12) {
            return std::make_shared<const World>(std::move(*world));
        }
    }
}

}  // namespace terrane::bench
