// The [structure], [relief] and [caves] parts of a world file of format 2. Only the world file's
// reader uses this.
#pragma once

#include "generator/world/world_definition.h"
#include "generator/world/world_table.h"

#include <toml++/toml.h>

#include <cstdint>

namespace terrane {

/// The tables that are there.
struct LandscapeTables {
    const toml::table* structure = nullptr;
    const toml::table* relief = nullptr;
    const toml::table* caves = nullptr;
};

/// Looks for the tables in the file's root; in a file of format 1 they are faults.
LandscapeTables find_landscape(WorldTable& root, std::int32_t format);

/// Reads them into `world`; what is absent keeps its default, with which it does nothing. What is
/// wrong goes to `faults`.
void read_landscape(const LandscapeTables& tables, WorldFaults& faults, WorldDefinition& world);

}  // namespace terrane
