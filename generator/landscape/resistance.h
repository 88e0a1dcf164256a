// The resistance map: strata make the slopes.
//
// A relief without regard for rock becomes one that the rock has made: going up from the bottom of
// the stack, a voxel of layer k costs g_k of raw height, little where the rock resists. So a hard
// layer stands as a cliff, a soft one lies as a bench, through every fold and fault.
//
//     a = (2 hardness - 1) * cliffs;  rho = (1 + a) / (1 - a)
//     g_k = (D / sum_j(T_j / rho_j)) / rho_k
//
//     a = raw - Us (Us: what structure did to the rock there); y = 0; from the bottom up:
//         lim = (H_k - H_k-1) g_k; m = clamp(a, 0, lim); e = rho > 1 ? .3 min(1, rho - 1) : 0
//         m = m m (1 + e) / (m + e lim)          concave, or every relic cap is a pyramid
//         y += m / g_k; a -= lim
//     ground = raw + (y + Us - raw) * step(.04, .3, pf) + fine * step      rivers keep their level
//
// Where raw passes the top of the stack, the stack's own top remains: a mesa.
#pragma once

#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/layer_stack.h"
#include "generator/terrain/noise.h"
#include "generator/world/world_definition.h"

#include <cstddef>
#include <vector>

namespace terrane {

struct ResistanceConstants {
    std::vector<LayerResistance> layers;

    ResistanceConstants(const WorldDefinition& definition, const LayerStack& stack);
};

/// Planes of a region's layer heights: layer k's raster lies k * plane further.
struct LayerHeights {
    const float* first = nullptr;
    std::size_t plane = 0;
};

/// Goes up through layer after layer, each of which must be there only when it is asked for.
class ResistanceWalk {
  public:
    /// height[i] becomes y of each value: where raw height over[i] above the bottom of the stack
    /// ends. `rest` is memory of as many values, whole blocks of them.
    ResistanceWalk(float* height, float* rest, const float* over, std::size_t count);

    /// Layer `k`, once it and those below it are there; from 0 on, each once. Whether some value is
    /// left: else higher layers would add nothing.
    bool pass(const LayerResistance& layer, const LayerHeights& layers, std::size_t k,
              const RowKernels& kernels);

  private:
    float* height_;
    float* rest_;
    std::size_t count_;
};

}  // namespace terrane
