// The [affinity] part of a world file. Only the world file's reader uses this.
#pragma once

#include "generator/world/world_definition.h"
#include "generator/world/world_table.h"

#include <toml++/toml.h>

namespace terrane {

/// Fills the two affinity matrices for `world.materials`, which are read already. A null `source`
/// means every affinity is 1. What is wrong goes to `faults`; the matrices are filled only for at
/// most kMaterialsMax materials.
void read_affinities(const toml::table* source, WorldFaults& faults, WorldDefinition& world);

}  // namespace terrane
