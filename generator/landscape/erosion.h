// The erosion filter: gullies and ridges that run down the slopes.
//
// After Clay John, "Eroded terrain noise" (2018) and Rune Skovbo Johansen, "Fast and gorgeous
// erosion filter" (2026): stripes across the slope, summed octave by octave, each turned into the
// slope that the one before made, and fading out where the land is flat. The kernel is our own, a
// rational one. Octave o has amplitude A = gullies * 2^-o and cells of p = gully_scale * 2^-o:
//
//     s = gradient of the land; mask = ease(1.1 |s|); fade = clamp(2 pf - 1, -1, 1)
//     side = (-s_z, s_x) / |s|; over 3 x 3 cells with a random point each, v = place - point:
//         k = max(0, 1 - |v|^2 / 1.5625)^2, phase = .75 * dot(v, side) turns
//         C += k cos(phase), S += k sin(phase); both divided by the sum of k, then by
//         max(.5, sqrt(C^2 + S^2))
//     delta = fade + mask (C - fade); e += A delta; fade = delta
//     mask = (1 - (1 - mask)^1.5) * ease(1.4 |S|);  s += (S < 0 ? 1 : -1) side .5 A 2 pi .75 / p
//
// Levels with steps over kExactSteps leave out octaves with cells under two of their steps. (To
// find wide octaves on every second column only is cheaper by a third, and makes saws of the
// crests.)
#pragma once

#include "generator/landscape/relief.h"
#include "generator/terrain/noise.h"
#include "generator/world/world_definition.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {

struct GullyOctave {
    std::uint64_t seed = 0;
    std::uint64_t frequency = 0;  ///< cells a column, 0.64 fixed point
    double period = 0;            ///< columns
    float amplitude = 0;          ///< voxels
    float steepening = 0;         ///< what a stripe adds to the slope
};

struct ErosionConstants {
    /// The first so many octaves carve valleys before the strata are looked at, the finer ones
    /// roughen what comes of it: put before, they become needles.
    static constexpr std::size_t kCoarseOctaves = 2;
    static constexpr std::int64_t kExactSteps = 16;  ///< columns

    std::array<GullyOctave, kNoiseOctavesMax> octaves{};
    std::size_t octave_count = 0;
    float coarse_amplitude = 0;  ///< sum of the coarse octaves'
    float fine_amplitude = 0;    ///< likewise

    explicit ErosionConstants(const WorldDefinition& definition);
};

/// Columns of one cell, up to the next run's.
struct ErosionRun {
    std::size_t first = 0;
    std::array<std::uint64_t, 3> hashes{};  ///< of the cells before, at and after
};

/// Memory of `erode`; one thread's.
struct ErosionBuffers {
    std::vector<float> floats;
    std::vector<float> points;
    std::vector<ErosionBound> bounds;
    std::vector<ErosionRun> runs;
};

/// coarse[i], fine[i]: what the filter adds to column i, in voxels, before it is scaled by how
/// mountainous the land is. The slopes of `relief` are used up.
void erode(float* coarse, float* fine, ReliefRasters& relief, const ErosionConstants& constants,
           const RectangleShape& shape, const RowKernels& kernels, ErosionBuffers& buffers);

}  // namespace terrane
