// The columns of a vertical cut, and the terrain between two of them.
//
// Columns are samples: between two neighbours a frontier runs from its height in the one to its
// height in the other. Limits are paired in order where both show the same; what only one of the
// two has (a vein, a cave, a layer that pinches out) closes to nothing at the other.
#pragma once

#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/render/drawing.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {

/// A limit with what it looks like. `sort` is the same for what belongs together in two columns.
struct SeenLimit {
    float y = 0;  ///< voxels
    PaletteKind kind = PaletteKind::layer;
    std::size_t sort = 0;
    LinearColor color;
};

/// Bottom first; the last is the void's.
using SeenColumn = std::vector<SeenLimit>;

/// The columns nearest to the line, one for each step along its longer axis, both ends included.
std::vector<ColumnPos> columns_on(ColumnPos from, ColumnPos to);

Result<std::vector<SeenColumn>> see_columns(const Drawing& drawing,
                                            std::span<const ColumnPos> positions);

/// A limit that runs from one column to the next.
struct PairedLimit {
    float y_left = 0;
    float y_right = 0;
    bool in_left = false;   ///< the left column itself has it
    bool in_right = false;  ///< likewise
    PaletteKind kind = PaletteKind::layer;
    LinearColor color_left;
    LinearColor color_right;
};

/// Pairs the limits of neighbours, bottom first; heights ascend on both sides. Overwrites `out`;
/// `scratch` is a buffer.
void pair_limits(std::vector<PairedLimit>& out, const SeenColumn& left, const SeenColumn& right,
                 std::vector<float>& scratch);

}  // namespace terrane
