// The world files that come with Terrane, in the program itself.
#pragma once

#include "generator/terrain/world.h"
#include "generator/world/world_definition.h"
#include "protocol/base/result.h"

#include <span>
#include <string_view>

namespace terrane {

struct ShippedWorld {
    std::string_view name;  ///< "basin", "paper-A0", ...
    std::string_view text;  ///< TOML
};

/// By name.
std::span<const ShippedWorld> shipped_worlds();

/// Needs a name of the list above: anything else is our own mistake and ends the program.
WorldDefinition shipped_definition(std::string_view name);

/// Builds, with another seed than the file's. Fails as World::build does.
Result<World> build_with_seed(WorldDefinition definition, std::uint64_t seed);

}  // namespace terrane
