#include "server/report/shipped_world.h"

#include "generator/terrain/world.h"
#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "protocol/base/check.h"
#include "protocol/base/result.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>

namespace terrane {
namespace {

constexpr auto kShippedWorlds = std::to_array<ShippedWorld>({
#include "server/report/shipped_world_texts.inc"
});

}  // namespace

std::span<const ShippedWorld> shipped_worlds() {
    return kShippedWorlds;
}

WorldDefinition shipped_definition(std::string_view name) {
    const auto found = std::ranges::find(kShippedWorlds, name, &ShippedWorld::name);
    TERRANE_ASSERT(found != kShippedWorlds.end());
    WorldFileResult parsed = parse_world_file(found->text, found->name, {});
    TERRANE_ASSERT(parsed.ok());
    return std::move(parsed.definition);
}

Result<World> build_with_seed(WorldDefinition definition, std::uint64_t seed) {
    definition.seed = seed;
    return World::build(std::move(definition));
}

}  // namespace terrane
