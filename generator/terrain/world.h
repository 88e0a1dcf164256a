// A built world: the layer stack that everything extends, and the constants drawn once from the
// seed.
//
// Immutable after `build`; share it between threads as `std::shared_ptr<const World>` or by
// reference.
#pragma once

#include "generator/terrain/layer_stack.h"
#include "generator/world/composition.h"
#include "generator/world/generator_version.h"
#include "generator/world/world_definition.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"

#include <cstdint>
#include <vector>

namespace terrane {

/// How many veins and caves one region may meet at level 0. Ids of a stack's palette are 16 bits;
/// this leaves room, and bounds the time that a stack takes.
inline constexpr double kElementsPerRegionMax = 16384;

struct World {
    WorldDefinition definition;
    LayerStack stack;
    /// Layers, the void, then a landscape's own: what every stack's palette begins with.
    Palette base_palette;
    Hash128 fingerprint;  ///< names definition, textures and generator version

    std::uint16_t void_id() const { return static_cast<std::uint16_t>(stack.layers.size()); }

    /// Fails with `invalid_argument` if the definition admits no first layer, if its height bound
    /// is above kHeightBoundMax, or if a region could meet more than kElementsPerRegionMax
    /// elements.
    static Result<World> build(WorldDefinition definition);
};

}  // namespace terrane
