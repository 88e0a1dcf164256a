// Per-voxel Perlin noise tuned as hard as the terrain's own noise, so that the comparison with it
// is not won against a slow opponent.
//
// The same function as ClassicPerlin in kind (K. Perlin, "Improving noise", 2002), organised for a
// box of voxels: the lattice points the box touches are hashed once; along a row the four corner
// gradients on each side of a cell fold into one line in x; and cell by cell the row is two
// multiply-adds and a mix a voxel, in floats, vectorised for the processor at hand.
#pragma once

#include <cstdint>
#include <vector>

namespace terrane {

/// A cube of voxels at whole coordinates, x fastest, then y, then z.
struct VoxelBox {
    std::int64_t x0 = 0;
    std::int64_t y0 = 0;
    std::int64_t z0 = 0;
    std::int32_t width = 0;   ///< x, 1..1024
    std::int32_t height = 0;  ///< y
    std::int32_t length = 0;  ///< z
};

/// One noise; reuses its memory from box to box. One thread's.
class RowPerlin {
  public:
    /// `period` voxels a lattice cell, at least 2.
    RowPerlin(std::uint64_t seed, float period);

    /// Fills width * height * length floats; |value| <= 1.
    void fill(float* out, const VoxelBox& box);

  private:
    struct Axis {
        std::int64_t cell_first = 0;
        std::vector<std::int32_t> cell;  ///< from cell_first
        std::vector<float> fraction;
        std::vector<float> fade;
        std::int32_t cells = 0;
    };

    void fill_axis(Axis& axis, std::int64_t first, std::int32_t count) const;
    void hash_lattice();
    void fold_row(std::int32_t y, std::int32_t z);

    std::uint64_t seed_;
    float period_;
    Axis x_;
    Axis y_;
    Axis z_;
    std::vector<float> gradients_;  ///< three a lattice point
    std::vector<float> lines_;      ///< slope and value of each lattice column of a row
};

}  // namespace terrane
