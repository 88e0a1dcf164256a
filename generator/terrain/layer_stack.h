// The layer stack: the "existing terrain" of the paper (4.2.1, 4.2.4), fixed once per world.
#pragma once

#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/result.h"

#include <cstdint>
#include <vector>

namespace terrane {

inline constexpr std::int32_t kLayersMax = 64;

struct Layer {
    Composition composition;
    double bottom = 0;      ///< N0: nominal height of the layer's bottom, voxels
    double thickness = 0;   ///< T: nominal, voxels
    double roughness = 0;   ///< amplitude of its own folds, voxels
    double similarity = 0;  ///< 0..1: how much it follows the layer below
    double blend = 0;       ///< 0..1: share of its thickness that blends into what is below
    bool alone = false;

    double top() const { return bottom + thickness; }
};

struct LayerStack {
    std::vector<Layer> layers;  ///< bottom first, 1..kLayersMax
    /// Elements of the origin plot per gap (gap g lies on top of layer g; layers - 1 gaps).
    std::vector<std::int32_t> origin_veins;
    std::vector<std::int32_t> origin_caves;
    double reference_veins = 0;  ///< what later plots draw 0.5 to 1.5 times of
    double reference_caves = 0;
    double height_bound = 0;  ///< nothing solid stands above, voxels

    std::int32_t gap_count() const { return static_cast<std::int32_t>(layers.size()) - 1; }
};

/// Draws the stack. Fails with `invalid_argument` when no base material can start it.
Result<LayerStack> build_layer_stack(const WorldDefinition& definition);

}  // namespace terrane
