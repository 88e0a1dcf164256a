// Voxels out of limits. Source: the paper, section 3: between two limits values are interpolated.
//
// The voxel `y` has its centre at yc = y * 256 + 128. With lo the last limit at or below yc and hi
// the next, t = (yc - lo) / (hi - lo) in double and the voxel is the linear mix of both:
// composition and flow, the void and caves being compositions like any other. Above the last limit
// the voxel is the last limit's, below the first the first's. A chunk's column gives the same
// voxels as the whole column that it was cut from.
#pragma once

#include "generator/volume/chunk.h"
#include "generator/volume/limit.h"
#include "generator/world/composition.h"

#include <array>
#include <cstdint>
#include <span>

namespace terrane {

/// A mix of two compositions. A material that both have is one share; shares of `lo` come first.
struct Voxel {
    std::array<Share, 2 * kCompositionMaterialsMax> storage{};
    std::uint8_t count = 0;
    Flow flow{};

    std::span<const Share> shares() const { return {storage.data(), count}; }

    friend bool operator==(const Voxel& a, const Voxel& b);
};

/// Voxel `y` (in the column's own height, not the chunk's). Needs at least one limit, ascending.
Voxel voxel_at(std::span<const Limit> column, const Palette& palette, std::int64_t y);

/// The row form: out[i] = voxel_at(column, palette, y_first + i), in one walk up the column.
void expand_column(std::span<Voxel> out, std::span<const Limit> column, const Palette& palette,
                   std::int64_t y_first);

/// Voxel `y` (0..height-1, from the chunk's floor) of the chunk's column (x, z).
Voxel voxel_of(const Chunk& chunk, std::int32_t x, std::int32_t y, std::int32_t z);

/// The colour at any height (1/256 voxel), given palette_colors: the mix that voxel_at would have
/// there.
LinearColor color_at(std::span<const Limit> column, std::span<const LinearColor> colors,
                     std::int64_t y256);

}  // namespace terrane
