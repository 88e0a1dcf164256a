// Perlin noise that is exact at any 64-bit coordinate, one point at a time or a rectangle at a
// time.
//
// Source: K. Perlin, "Improving noise", 2002 (fade, gradients), in two dimensions with 16 unit
// gradients. Positions are 64.64 fixed point, so nothing is lost far from the origin, and every
// octave has a random fractional offset, so that the zeros on the lattices of layers do not line
// up. The row form (Rectangle) gives the same bits as the scalar form and is what terrain uses:
// along a row of fixed z the four corner gradients of a lattice cell fold into two lines in x.
#pragma once

#include "generator/terrain/kernels/row_kernels.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {

inline constexpr std::int32_t kNoiseOctavesMax = 6;

/// One octave's constants.
struct NoiseOctave {
    std::uint64_t seed = 0;
    std::uint64_t offset_x = 0;  ///< fraction of a lattice cell, 0.64 fixed point
    std::uint64_t offset_z = 0;
    std::uint64_t frequency = 0;  ///< cells per voxel, 0.64 fixed point
    float amplitude = 0;
    float period = 0;  ///< voxels
};

/// |noise| <= 1. Octaves whose period is under 2 voxels are dropped.
struct Noise {
    std::array<NoiseOctave, kNoiseOctavesMax> octaves{};
    std::int32_t octave_count = 0;

    /// `period` >= 2 voxels of the first octave; it halves from octave to octave. 1..6 octaves.
    static Noise make(std::uint64_t noise_key, double period, std::int32_t octaves);
};

/// The noise at one column.
float noise_at(const Noise& noise, std::int64_t x, std::int64_t z);

/// A rectangle of columns, one value each. Rows of `stride` values, padded for whole vectors.
struct RectangleShape {
    std::int64_t x0 = 0;  ///< first column
    std::int64_t z0 = 0;
    std::int32_t width = 0;   ///< columns along x, 1..kRectangleSideMax
    std::int32_t length = 0;  ///< columns along z, likewise
    std::int64_t step = 1;    ///< voxels from column to column: 2^lod

    std::int32_t stride() const { return padded_width(width); }

    /// Where the value of a column lies, both counted from the first.
    std::size_t index(std::int32_t column, std::int32_t row) const {
        return static_cast<std::size_t>(row) * static_cast<std::size_t>(stride()) +
               static_cast<std::size_t>(column);
    }

    std::size_t padded_size() const {
        return static_cast<std::size_t>(stride()) * static_cast<std::size_t>(length) + kVectorPad;
    }
};

/// Reused memory of `noise_rectangle`; one thread's.
struct NoiseBuffers {
    std::vector<float> floats;
    std::vector<std::int32_t> integers;
    std::vector<std::uint64_t> hashes;
};

/// Fills `out` (padded_size() floats) with the noise, bit for bit noise_at's.
void noise_rectangle(float* out, const Noise& noise, const RectangleShape& shape,
                     const RowKernels& kernels, NoiseBuffers& buffers);

/// The noise at every (x, z) of two ascending lists of columns, which need not be evenly apart nor
/// few: rows of padded_width(xs.size()) values and kVectorPad behind them, bit for bit noise_at's.
void noise_grid(float* out, const Noise& noise, std::span<const std::int64_t> xs,
                std::span<const std::int64_t> zs, const RowKernels& kernels, NoiseBuffers& buffers);

}  // namespace terrane
