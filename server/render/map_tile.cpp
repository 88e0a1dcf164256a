#include "server/render/map_tile.h"

#include "generator/volume/color.h"
#include "generator/volume/water.h"
#include "server/render/relief.h"

#include <algorithm>
#include <string>
#include <vector>

namespace terrane {
namespace {

/// Pixels a side that are shaded at once.
constexpr std::int32_t kBlockPixels = 256;
/// Columns a side that are generated at once; the generator takes 126 at most.
constexpr std::int32_t kPatchColumns = 124;

struct Patch {
    std::int32_t x = 0;
    std::int32_t y = 0;
    std::int32_t width = 0;
    std::int32_t length = 0;
};

/// The highest limit that shows something solid or water; the base always is.
const Limit& top_of(std::span<const Limit> column, const Palette& palette,
                    std::span<const Material> materials) {
    std::size_t i = column.size() - 1;
    while (i > 0 && !palette[column[i].palette_id].is_solid() &&
           !is_water(palette[column[i].palette_id], materials)) {
        --i;
    }
    return column[i];
}

void fill_patch(Relief& relief, const ColumnSet& set, const Patch& patch,
                std::span<const Material> materials) {
    const std::vector<LinearColor> colors = palette_colors(set.palette, materials);
    for (std::int32_t z = 0; z < patch.length; ++z) {
        for (std::int32_t x = 0; x < patch.width; ++x) {
            const Limit& top = top_of(set.columns.column(x, z), set.palette, materials);
            const std::size_t at = relief.index_of(patch.x + x, patch.y + z);
            relief.heights[at] = static_cast<float>(top.y256) / static_cast<float>(kUnitsPerVoxel);
            relief.colors[at] = colors[top.palette_id];
        }
    }
}

/// Fills the samples of a relief whose picture begins at column `first`.
Result<void> sample(Relief& relief, const Drawing& drawing, ColumnPos first, std::int32_t lod) {
    const std::int32_t sample_lod = lod - relief.detail;
    const std::int64_t step = std::int64_t{1} << sample_lod;
    const std::int64_t apron = static_cast<std::int64_t>(kReliefApron) << lod;
    const std::int32_t columns = relief.columns();
    const std::int32_t rows = relief.rows();
    const auto count = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
    relief.heights.resize(count);
    relief.colors.resize(count);
    ColumnSet set;
    for (std::int32_t y = 0; y < rows; y += kPatchColumns) {
        for (std::int32_t x = 0; x < columns; x += kPatchColumns) {
            if (auto on = go_on(drawing); !on) {
                return on;
            }
            const Patch patch{.x = x,
                              .y = y,
                              .width = std::min(kPatchColumns, columns - x),
                              .length = std::min(kPatchColumns, rows - y)};
            auto made = drawing.generator->generate(set, {.x0 = first.x - apron + x * step,
                                                          .z0 = first.z - apron + y * step,
                                                          .width = patch.width,
                                                          .length = patch.length,
                                                          .lod = sample_lod});
            if (!made) {
                return made;
            }
            fill_patch(relief, set, patch, drawing.world->definition.materials);
        }
    }
    return {};
}

}  // namespace

Result<void> check_map_tile(const MapTile& tile) {
    if (tile.zoom < 0 || tile.zoom > kMapZoomMax) {
        return fail(ErrorCode::out_of_range, "zoom " + std::to_string(tile.zoom) +
                                                 ": there are 0 to " + std::to_string(kMapZoomMax));
    }
    const std::int32_t tiles = 1 << tile.zoom;
    if (tile.x < 0 || tile.x >= tiles || tile.y < 0 || tile.y >= tiles) {
        return fail(ErrorCode::out_of_range, "tile " + std::to_string(tile.x) + "/" +
                                                 std::to_string(tile.y) + ": zoom " +
                                                 std::to_string(tile.zoom) + " has 0 to " +
                                                 std::to_string(tiles - 1) + " along each side");
    }
    return {};
}

ColumnPos first_column_of(const MapTile& tile) {
    constexpr std::int64_t kHalfWorld = std::int64_t{kMapTilePixels} << (kMapZoomMax - 1);
    const std::int64_t columns = std::int64_t{kMapTilePixels} << (kMapZoomMax - tile.zoom);
    return {.x = tile.x * columns - kHalfWorld, .z = tile.y * columns - kHalfWorld};
}

Result<Image> draw_map(const Drawing& drawing, const MapArea& area) {
    auto image = make_image(area.width, area.height);
    if (!image) {
        return image;
    }
    const World& world = *drawing.world;
    Relief relief;
    // Four samples a pixel, but where a pixel is a column.
    relief.detail = area.lod > 0 ? 1 : 0;
    relief.step_voxels = static_cast<float>(std::int64_t{1} << (area.lod - relief.detail));
    relief.bound_voxels = static_cast<float>(std::max(1.0, world.stack.height_bound));
    for (std::int32_t y = 0; y < area.height; y += kBlockPixels) {
        for (std::int32_t x = 0; x < area.width; x += kBlockPixels) {
            relief.width = std::min(kBlockPixels, area.width - x);
            relief.height = std::min(kBlockPixels, area.height - y);
            const ColumnPos first{.x = area.first.x + (std::int64_t{x} << area.lod),
                                  .z = area.first.z + (std::int64_t{y} << area.lod)};
            if (auto made = sample(relief, drawing, first, area.lod); !made) {
                return tl::unexpected(made.error());
            }
            shade_relief(*image, x, y, relief);
        }
    }
    return image;
}

Result<Image> draw_map_tile(const Drawing& drawing, const MapTile& tile) {
    if (auto checked = check_map_tile(tile); !checked) {
        return tl::unexpected(checked.error());
    }
    return draw_map(drawing, {.first = first_column_of(tile),
                              .width = kMapTilePixels,
                              .height = kMapTilePixels,
                              .lod = kMapZoomMax - tile.zoom});
}

}  // namespace terrane
