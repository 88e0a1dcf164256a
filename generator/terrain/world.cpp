#include "generator/terrain/world.h"

#include "generator/world/world_file.h"

#include <string>
#include <utility>

namespace terrane {

Result<World> World::build(WorldDefinition definition) {
    auto stack = build_layer_stack(definition);
    if (!stack) {
        return tl::unexpected(std::move(stack.error()));
    }
    if (!(stack->height_bound <= kHeightBoundMax)) {
        return fail(ErrorCode::invalid_argument,
                    "the terrain can rise to " + std::to_string(stack->height_bound) +
                        " voxels, at most " + std::to_string(kHeightBoundMax) +
                        " are allowed: lower depth, roughness or the thicknesses");
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
    world.fingerprint = world_fingerprint(definition);
    world.stack = std::move(*stack);
    world.definition = std::move(definition);
    return world;
}

}  // namespace terrane
