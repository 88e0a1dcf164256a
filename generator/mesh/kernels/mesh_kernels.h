// The mesher's inner loop, compiled once per instruction set like the row kernels and under the
// same rules: see generator/terrain/kernels/row_kernels.h. Plain data and declarations only.
#pragma once

#include <cstdint>

namespace terrane {

/// Cells are made so many at a time, in blocks of kCellBlock.
inline constexpr std::int32_t kCellBatch = 64;
inline constexpr std::int32_t kCellBlock = 16;
inline constexpr std::int32_t kCellUnits = 256;                      ///< kUnitsPerVoxel
inline constexpr std::int32_t kCellDistanceMax256 = 4 * kCellUnits;  ///< kDistanceMax256

/// What surface-nets cells become. Their columns are (x, z), (x+1, z), (x, z+1), (x+1, z+1); their
/// corners those four at the floor, then at the ceiling.
struct CellResults {
    alignas(64) std::int32_t offset256[3][kCellBatch];  ///< x, y, z in 0..255 from the least corner
    alignas(64) float normal[3][kCellBatch];            ///< x, y, z; unit length, out of the solid
    /// The first column whose own edge crosses; 4 if none does.
    alignas(64) std::int32_t first_upright[kCellBatch];
    /// Corners: how far the nearest end is, in 1/256 voxel up to kDistanceMax256; less than or
    /// equal to 0 outside the solid.
    alignas(64) std::int32_t distance256[8][kCellBatch];
    alignas(64) std::int32_t solid[kCellBatch];  ///< bit i: corner i is solid
};

struct MeshKernels {
    /// Makes the first `count` cells, a multiple of kCellBlock and at most kCellBatch. `ends256` is
    /// planes x 4 columns x kCellBatch cells: plane i holds every column's end i, from the cell's
    /// floor, in 1/256 voxel. Cells that no edge crosses get harmless results.
    void (*cell_vertices)(CellResults& out, const std::int32_t* ends256, std::int32_t planes,
                          std::int32_t count);
};

/// Of the instruction set that the row kernels are chosen from too (RowKernels::mesh).
const MeshKernels& chosen_mesh_kernels();

}  // namespace terrane
