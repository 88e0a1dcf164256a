// Folds: the stack bent by waves that run across the land.
//
// Similar folds, as in textbooks of structural geology: rock is moved up or down only, so that a
// column keeps its layers in order and one number a column says it all:
//
//     phase = x * cos / length + z * sin / length  (turns, 64-bit fixed point: exact everywhere)
//     w = noise of period 2 * length;  t = phase + 0.6 w
//     U = fold * (0.7 sin(t) + 0.6 w)
//
// A tilt is a fold of great length: an endless plane would leave every bound.
#pragma once

#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/noise.h"
#include "generator/world/world_definition.h"

#include <cstdint>

namespace terrane {

struct FoldConstants {
    float amplitude = 0;        ///< voxels; 0: there are none
    std::uint64_t turns_x = 0;  ///< a column's share of a turn, 0.64 fixed point
    std::uint64_t turns_z = 0;
    Noise noise;

    explicit FoldConstants(const WorldDefinition& definition);

    /// |U| never exceeds this.
    float bound() const { return 1.3F * amplitude; }
};

/// U in voxels at one column.
float fold_at(const FoldConstants& constants, std::int64_t x, std::int64_t z);

/// The same for a rectangle: `out` has shape.padded_size() values.
void fold_rectangle(float* out, const FoldConstants& constants, const RectangleShape& shape,
                    const RowKernels& kernels, NoiseBuffers& buffers);

}  // namespace terrane
