// The voxel methods that terrain is compared with, over a whole terrain: four noises a voxel, its
// material and its flow.
#pragma once

#include "generator/baseline/row_perlin.h"
#include "generator/baseline/voxel_perlin.h"

#include <array>
#include <cstdint>
#include <vector>

namespace terrane {

/// As the paper had it: each voxel on its own. Reuses its memory.
class VoxelBaseline {
  public:
    void generate(const VoxelBox& box);

    const std::vector<PerlinVoxel>& voxels() const { return voxels_; }

  private:
    std::array<ClassicPerlin, 4> noises_ = {ClassicPerlin(1), ClassicPerlin(2), ClassicPerlin(3),
                                            ClassicPerlin(4)};
    std::vector<PerlinVoxel> voxels_;
};

/// Tuned as hard as the terrain is.
class RowBaseline {
  public:
    void generate(const VoxelBox& box);

    const std::vector<float>& values() const { return values_; }  ///< noise after noise

  private:
    std::vector<RowPerlin> noises_ = {RowPerlin(1, 28), RowPerlin(2, 28), RowPerlin(3, 28),
                                      RowPerlin(4, 28)};
    std::vector<float> values_;
};

}  // namespace terrane
