#include "generator/terrain/world.h"

#include "generator/landscape/landscape_palette.h"
#include "generator/terrain/layer_stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "protocol/base/result.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

namespace terrane {
namespace {

/// What no region of level 0 exceeds: the plots that can reach into the largest one, with the most
/// elements that a plot draws.
double elements_per_region_bound(const WorldDefinition& definition, const LayerStack& stack) {
    if (stack.gap_count() == 0) {
        return 0;
    }
    const double area = std::max(definition.terrain.vein_area, definition.terrain.cave_area);
    constexpr double kSideMax = 128;  // columns
    const double plots = (kSideMax + area) / definition.grid.plot + 2;
    const double a_plot = 1.5 * (stack.reference_veins + stack.reference_caves) + 2;
    return plots * plots * a_plot;
}

}  // namespace

Result<World> World::build(WorldDefinition definition) {
    auto stack = build_layer_stack(definition);
    if (!stack) {
        return tl::unexpected(std::move(stack.error()));
    }
    if (definition.has_landscape()) {
        stack->height_bound = landscape_height_bound(definition, *stack);
    }
    if (!(stack->height_bound <= kHeightBoundMax)) {
        return fail(ErrorCode::invalid_argument,
                    "the terrain can rise to " + std::to_string(stack->height_bound) +
                        " voxels, at most " + std::to_string(kHeightBoundMax) +
                        " are allowed: lower depth, roughness or the thicknesses");
    }
    const double elements = elements_per_region_bound(definition, *stack);
    if (!(elements <= kElementsPerRegionMax)) {
        return fail(ErrorCode::invalid_argument,
                    "a chunk could meet " + std::to_string(std::llround(elements)) +
                        " veins and caves, at most " +
                        std::to_string(std::llround(kElementsPerRegionMax)) +
                        " are allowed: lower vein_density, cave_density or the areas, or raise "
                        "grid.plot");
    }
    World world;
    for (const Layer& layer : stack->layers) {
        world.base_palette.push_back(
            {.composition = layer.composition, .kind = PaletteKind::layer, .alone = layer.alone});
    }
    PaletteEntry nothing{.composition = {}, .kind = PaletteKind::void_, .alone = false};
    for (std::size_t i = 0; i < definition.materials.size(); ++i) {
        if (definition.materials[i].kind == MaterialKind::void_) {
            nothing.composition.add(static_cast<std::uint16_t>(i), 1);
            break;
        }
    }
    world.base_palette.push_back(nothing);
    if (definition.has_landscape()) {
        append_landscape_palette(world.base_palette, definition);
    }
    world.fingerprint = world_fingerprint(definition);
    world.stack = std::move(*stack);
    world.definition = std::move(definition);
    return world;
}

}  // namespace terrane
