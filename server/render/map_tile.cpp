#include "server/render/map_tile.h"

#include "generator/landscape/river_map.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/world.h"
#include "generator/volume/color.h"
#include "generator/volume/limit.h"
#include "generator/volume/water.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/render/draw_pieces.h"
#include "server/render/drawing.h"
#include "server/render/picture_keys.h"
#include "server/render/relief.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace terrane {
namespace {

/// Pixels a side that are shaded at once.
constexpr std::int32_t kBlockPixels = 256;
/// Columns a side that are generated at once; the generator takes 126 at most.
constexpr std::int32_t kPatchColumns = 124;
/// Voxels of water in rivers that are drawn wider than they are.
constexpr float kRiverDepth = 2;

struct Patch {
    std::int32_t x = 0;
    std::int32_t y = 0;
    std::int32_t width = 0;
    std::int32_t length = 0;
};

/// The highest limit that shows something solid; the base always is.
std::size_t top_of(std::span<const Limit> column, const Palette& palette) {
    std::size_t i = column.size() - 1;
    while (i > 0 && !palette[column[i].palette_id].is_solid()) {
        --i;
    }
    return i;
}

float voxels_of(const Limit& limit) {
    return static_cast<float>(limit.y256) / static_cast<float>(kUnitsPerVoxel);
}

/// What is seen of the ground through water of this depth: the bed shows where it is shallow, and
/// deep water is darker.
LinearColor under_water(LinearColor bed, LinearColor water, float depth_voxels) {
    constexpr float kClear = 3;  // voxels after which a quarter of the bed's light is left
    constexpr float kDeep = 40;  // voxels after which the water itself has lost a fifth
    const float share = kClear / (kClear + depth_voxels);
    const float bed_share = share * share * 0.8F;
    const float water_share = (1 - bed_share) * (0.6F + 0.4F * kDeep / (kDeep + depth_voxels));
    return {.r = bed.r * bed_share * 0.8F + water.r * water_share,
            .g = bed.g * bed_share * 0.95F + water.g * water_share,
            .b = bed.b * bed_share + water.b * water_share};
}

struct Seen {
    float height = 0;
    LinearColor color;
    bool is_water = false;
};

/// The ground, or the water that stands over it.
Seen seen_from_above(std::span<const Limit> column, const Palette& palette,
                     std::span<const LinearColor> colors, std::span<const Material> materials) {
    const std::size_t top = top_of(column, palette);
    const float ground = voxels_of(column[top]);
    const LinearColor bed = colors[column[top].palette_id];
    for (std::size_t i = column.size() - 1; i-- > top + 1;) {
        const std::uint16_t id = column[i].palette_id;
        const float surface = voxels_of(column[i + 1]);
        if (surface > ground && is_water(palette[id], materials)) {
            return {.height = surface,
                    .color = under_water(bed, colors[id], surface - ground),
                    .is_water = true};
        }
    }
    return {.height = ground, .color = bed, .is_water = false};
}

/// Rivers narrower than a pixel become as wide as one, or they would be dashes.
/// Samples that are `wet` show water as it is.
void draw_rivers(Relief& relief, const Patch& patch, RiverMap& rivers, const ColumnPos& first,
                 std::int64_t step, LinearColor water, std::span<const std::uint8_t> wet) {
    const auto half_pixel = static_cast<float>(step << relief.detail) * 0.5F;
    const RectangleShape shape{
        .x0 = first.x, .z0 = first.z, .width = patch.width, .length = patch.length, .step = step};
    const std::span<const float> distances = rivers.distances(shape, half_pixel);
    const auto stride = static_cast<std::size_t>(shape.stride());
    const auto width = static_cast<std::size_t>(patch.width);
    for (std::int32_t z = 0; z < patch.length; ++z) {
        const auto row = static_cast<std::size_t>(z);
        for (std::int32_t x = 0; x < patch.width; ++x) {
            const auto column = static_cast<std::size_t>(x);
            const bool is_near = distances[row * stride + column] < half_pixel;
            if (is_near && wet[row * width + column] == 0) {
                LinearColor& color = relief.colors[relief.index_of(patch.x + x, patch.y + z)];
                color = under_water(color, water, kRiverDepth);
            }
        }
    }
}

/// What water looks like, if the world has some.
std::optional<LinearColor> water_color(const World& world) {
    for (const Material& material : world.definition.materials) {
        if (material.kind == MaterialKind::water) {
            return linear_from_srgb(material.color);
        }
    }
    return std::nullopt;
}

/// Overwrites `wet`: 1 for each sample that shows water, row by row.
void fill_patch(Relief& relief, std::vector<std::uint8_t>& wet, const ColumnSet& set,
                const Patch& patch, std::span<const Material> materials) {
    wet.clear();
    const std::vector<LinearColor> colors = palette_colors(set.palette, materials);
    for (std::int32_t z = 0; z < patch.length; ++z) {
        for (std::int32_t x = 0; x < patch.width; ++x) {
            const Seen seen =
                seen_from_above(set.columns.column(x, z), set.palette, colors, materials);
            const std::size_t at = relief.index_of(patch.x + x, patch.y + z);
            relief.heights[at] = seen.height;
            relief.colors[at] = seen.color;
            wet.push_back(seen.is_water ? 1 : 0);
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
    std::vector<std::uint8_t> wet;
    RiverMap rivers(*drawing.world);
    const std::optional<LinearColor> water = water_color(*drawing.world);
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
            fill_patch(relief, wet, set, patch, drawing.world->definition.materials);
            if (lod > 0 && water) {
                draw_rivers(relief, patch, rivers,
                            {.x = first.x - apron + x * step, .z = first.z - apron + y * step},
                            step, *water, wet);
            }
        }
    }
    return {};
}

std::int32_t blocks_along(std::int32_t pixels) {
    return (pixels + kBlockPixels - 1) / kBlockPixels;
}

std::int32_t blocks_of(const MapArea& area) {
    return blocks_along(area.width) * blocks_along(area.height);
}

/// Blocks are numbered row by row, 0..blocks_of - 1; none looks at another's pixels.
Result<void> draw_block(Image& image, const Drawing& drawing, const MapArea& area,
                        std::int32_t block) {
    const std::int32_t x = block % blocks_along(area.width) * kBlockPixels;
    const std::int32_t y = block / blocks_along(area.width) * kBlockPixels;
    Relief relief;
    // Four samples a pixel, but where a pixel is a column.
    relief.detail = area.lod > 0 ? 1 : 0;
    relief.step_voxels = static_cast<float>(std::int64_t{1} << (area.lod - relief.detail));
    relief.bound_voxels = static_cast<float>(std::max(1.0, drawing.world->stack.height_bound));
    relief.width = std::min(kBlockPixels, area.width - x);
    relief.height = std::min(kBlockPixels, area.height - y);
    const ColumnPos first{.x = area.first.x + (std::int64_t{x} << area.lod),
                          .z = area.first.z + (std::int64_t{y} << area.lod)};
    if (auto made = sample(relief, drawing, first, area.lod); !made) {
        return made;
    }
    shade_relief(image, x, y, relief);
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
    for (std::int32_t block = 0; block < blocks_of(area); ++block) {
        if (auto drawn = draw_block(*image, drawing, area, block); !drawn) {
            return tl::unexpected(drawn.error());
        }
    }
    return image;
}

Result<Image> draw_map(const World& world, const MapArea& area, std::int32_t threads,
                       const TellDrawn& tell) {
    auto image = make_image(area.width, area.height);
    if (!image) {
        return image;
    }
    const auto drawn = draw_pieces(blocks_of(area), threads, tell, [&]() -> DrawPiece {
        const auto generator = std::make_shared<StackGenerator>(world);
        return [&, generator](std::int32_t block) {
            return draw_block(*image, {.world = &world, .generator = generator.get()}, area, block);
        };
    });
    if (!drawn) {
        return tl::unexpected(drawn.error());
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
