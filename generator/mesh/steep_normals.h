// Which way a steep side faces.
//
// The columns of a wall have no height in common, so a cell of two by two of them sees the wall
// along an axis or across the diagonal, nothing between, and a wall that is askew to the lattice
// would be shaded in flutes. Its normal comes from four by four columns.
#pragma once

#include "generator/mesh/kernels/mesh_kernels.h"
#include "generator/mesh/solid_mask.h"

#include <cstddef>
#include <cstdint>

namespace terrane {

/// True if a level edge of cell `i` is crossed and has an end kDistanceMax256 away from all
/// heights.
bool is_steep(const CellResults& results, std::size_t i);

/// Overwrites the normal of cell `i`, whose first column is (x, z). Across a side of the tile that
/// the cell straddles it stays with the two columns that both tiles know.
void smooth_steep_normal(CellResults& results, std::size_t i, const SolidColumns& columns,
                         std::size_t x, std::size_t z, std::int32_t floor256);

}  // namespace terrane
