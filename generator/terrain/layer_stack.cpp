#include "generator/terrain/layer_stack.h"

#include "generator/terrain/choose_composition.h"
#include "generator/terrain/random.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/result.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace terrane {
namespace {

Layer draw_layer(RandomStream& random, const WorldDefinition& definition,
                 const Composition& composition) {
    const TerrainParameters& terrain = definition.terrain;
    const DrawnProperties drawn = draw_properties(random, definition, composition);
    const double similarity =
        mixed_property(definition, composition, [](const Material& m) { return m.similarity; });
    Layer layer;
    layer.composition = composition;
    layer.thickness = std::max(1.0, drawn.thickness * terrain.layer_thickness);
    layer.roughness = drawn.roughness * terrain.roughness;
    layer.similarity = std::clamp(similarity * terrain.layer_similarity, 0.0, 1.0);
    layer.alone = is_alone(definition, composition);
    layer.blend = layer.alone ? 0 : mixed_property(definition, composition, [](const Material& m) {
        return m.blend;
    });
    return layer;
}

void draw_origin_plot(LayerStack& stack, const WorldDefinition& definition) {
    const auto gaps = static_cast<std::size_t>(stack.gap_count());
    stack.origin_veins.assign(gaps, 0);
    stack.origin_caves.assign(gaps, 0);
    const double vein_density = definition.terrain.vein_density;
    const double cave_density = definition.terrain.cave_density;
    RandomStream random(key(definition.seed, Tag::origin));
    for (std::size_t gap = 0; gap < gaps; ++gap) {
        stack.origin_veins[gap] = static_cast<std::int32_t>(vein_density + random.unit());
        stack.origin_caves[gap] = static_cast<std::int32_t>(cave_density + random.unit());
    }
    // An origin without elements must not make the whole world barren (the paper's rule would).
    const auto reference = [gaps](const std::vector<std::int32_t>& origin, double density) {
        const int drawn = std::accumulate(origin.begin(), origin.end(), 0);
        return drawn > 0 ? drawn : density * static_cast<double>(gaps);
    };
    stack.reference_veins = reference(stack.origin_veins, vein_density);
    stack.reference_caves = reference(stack.origin_caves, cave_density);
}

/// The tallest element that can stand between two layers, voxels.
double tallest_element(const LayerStack& stack, const WorldDefinition& definition) {
    double tallest = 0;
    for (const Material& material : definition.materials) {
        const bool in_veins = material.kind == MaterialKind::vein ||
                              (material.kind == MaterialKind::regular && !material.alone);
        if (in_veins && stack.reference_veins > 0) {
            tallest =
                std::max(tallest, material.thickness.most * definition.terrain.vein_thickness);
        }
        if (material.kind == MaterialKind::cave && stack.reference_caves > 0) {
            tallest =
                std::max(tallest, material.thickness.most * definition.terrain.cave_thickness);
        }
    }
    return tallest;
}

/// How far above its nominal top each layer can rise, carried up the stack.
double bound_height(const LayerStack& stack, const WorldDefinition& definition) {
    const double element = tallest_element(stack, definition);
    double rise = 0;
    for (std::size_t k = 0; k < stack.layers.size(); ++k) {
        const Layer& layer = stack.layers[k];
        const double s = layer.similarity;
        const double own = (1 - s) * layer.roughness;
        const double below = k == 0 ? 1 : rise + element;
        rise = std::max(s * below + own, below - layer.thickness);
    }
    return definition.terrain.depth + rise;
}

}  // namespace

Result<LayerStack> build_layer_stack(const WorldDefinition& definition) {
    const double depth = definition.terrain.depth;
    LayerStack stack;
    double bottom = 0;
    for (std::int32_t k = 0; k < kLayersMax; ++k) {
        RandomStream random(key(definition.seed, Tag::layer, k));
        const Composition* previous = k == 0 ? nullptr : &stack.layers.back().composition;
        const auto composition =
            choose_composition(random, definition, k == 0 ? Filling::base : Filling::regular,
                               previous, 1 - bottom / depth);
        if (!composition) {
            if (k == 0) {
                return fail(ErrorCode::invalid_argument,
                            "material: none of kind base to start from");
            }
            stack.layers.back().thickness += depth - bottom;
            break;
        }
        Layer layer = draw_layer(random, definition, *composition);
        layer.bottom = bottom;
        const bool last = bottom + layer.thickness > depth - 1 || k == kLayersMax - 1;
        if (last) {
            layer.thickness = depth - bottom;
        }
        bottom += layer.thickness;
        stack.layers.push_back(layer);
        if (last) {
            break;
        }
    }
    draw_origin_plot(stack, definition);
    stack.height_bound = bound_height(stack, definition);
    return stack;
}

}  // namespace terrane
