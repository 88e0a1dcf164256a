// The [[material]] part of a world file. Only the world file's reader uses this.
#pragma once

#include "generator/world/world_definition.h"
#include "generator/world/world_table.h"

#include <toml++/toml.h>

#include <filesystem>

namespace terrane {

/// Reads the materials and their textures into `world`, whose format is read already, ascending by
/// id. What is wrong goes to
/// `faults`; a material with faults is still added, so that affinities can name it.
void read_materials(const toml::array& source, const std::filesystem::path& texture_folder,
                    WorldFaults& faults, WorldDefinition& world);

}  // namespace terrane
