// What every subcommand with `--world FILE` does first.
#pragma once

#include "generator/terrain/world.h"
#include "generator/world/world_file.h"

#include <filesystem>
#include <memory>
#include <vector>

namespace terrane {

/// Reads, checks and builds the world. If anything is wrong, prints every fault to stderr, one a
/// line, then their count, and gives null: the subcommand exits with kExitWrongUse.
std::shared_ptr<const World> open_world(const std::filesystem::path& path);

/// Prints the faults to stderr, one a line, then their count.
void print_faults(const std::vector<WorldFileFault>& faults);

}  // namespace terrane
