// terrane slice: a picture of a vertical cut.
#pragma once

#include "generator/terrain/world.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/cli/png.h"

#include <cstdint>
#include <vector>

namespace terrane {

/// Both ends included. `scale` is pixels a voxel, 0 to choose one that fits a screen.
struct SliceLine {
    ColumnPos from;
    ColumnPos to;
    std::int32_t scale = 0;
};

inline constexpr std::int32_t kSliceScaleMax = 64;

/// The columns nearest to the line, one for each step along its longer axis. Needs less than
/// kImageSideMax steps.
std::vector<ColumnPos> columns_on(const SliceLine& line);

/// Draws the cut: colours mixed by composition in linear light, blends smooth, caves dark, above it
/// the sky. Fails with `too_large` when the picture would be, `out_of_range` when a column is.
Result<Image> draw_slice(const World& world, const SliceLine& line);

}  // namespace terrane
