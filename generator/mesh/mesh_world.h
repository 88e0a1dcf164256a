// A world for the meshers alone, for who has its materials and not its file: a client.
#pragma once

#include "generator/world/world_definition.h"

#include <utility>
#include <vector>

namespace terrane {

/// Of a definition meshers read the materials' colours and kinds, and whether it has a landscape.
/// Needs: the materials in the world's own order.
inline WorldDefinition mesh_world(std::vector<Material> materials, bool has_landscape) {
    WorldDefinition world;
    world.format = has_landscape ? 2 : 1;
    world.relief.height = has_landscape ? 1 : 0;
    world.materials = std::move(materials);
    return world;
}

}  // namespace terrane
