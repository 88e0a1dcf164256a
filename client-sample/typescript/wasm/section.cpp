#include "client-sample/typescript/wasm/section.h"

#include "client-sample/typescript/wasm/column_room.h"
#include "generator/mesh/shade.h"
#include "generator/volume/color.h"
#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {
namespace {

/// A column of the cut: the nearest column's limits at mixed heights.
struct CutColumn {
    std::span<const Limit> limits;
    std::vector<float> heights;
};

bool is_alike(std::span<const Limit> a, std::span<const Limit> b) {
    return a.size() == b.size() &&
           std::equal(a.begin(), a.end(), b.begin(), [](const Limit& one, const Limit& other) {
               return one.palette_id == other.palette_id;
           });
}

void find_column(CutColumn& out, const ColumnRoom& room, double x, double z) {
    const auto x_low = static_cast<std::int64_t>(std::floor(x));
    const auto z_low = static_cast<std::int64_t>(std::floor(z));
    const double part_x = x - static_cast<double>(x_low);
    const double part_z = z - static_cast<double>(z_low);
    out.limits = room.column_at(x_low + (part_x < 0.5 ? 0 : 1), z_low + (part_z < 0.5 ? 0 : 1));
    out.heights.assign(out.limits.size(), 0.0F);
    if (out.limits.empty()) {
        return;
    }
    double weight = 0;
    for (std::int64_t i = 0; i < 4; ++i) {
        const auto neighbour = room.column_at(x_low + (i & 1), z_low + (i >> 1));
        if (!is_alike(neighbour, out.limits)) {
            continue;
        }
        const double share =
            ((i & 1) != 0 ? part_x : 1 - part_x) * ((i >> 1) != 0 ? part_z : 1 - part_z);
        weight += share;
        for (std::size_t at = 0; at < neighbour.size(); ++at) {
            out.heights[at] += static_cast<float>(share * neighbour[at].y256);
        }
    }
    for (float& height : out.heights) {
        height /= static_cast<float>(weight);
    }
}

/// What is on either side of a height and how far between them it is.
struct Mix {
    std::size_t low = 0;
    std::size_t high = 0;
    float t = 0;
};

Mix mix_at(const CutColumn& column, std::size_t& above, float y256) {
    const auto& heights = column.heights;
    while (above < heights.size() && heights[above] <= y256) {
        ++above;
    }
    if (above == 0) {
        return {};
    }
    if (above == heights.size()) {
        return {.low = above - 1, .high = above - 1};
    }
    const float thickness = heights[above] - heights[above - 1];
    return {.low = above - 1, .high = above, .t = (y256 - heights[above - 1]) / thickness};
}

std::uint8_t signed_byte(float value) {
    return static_cast<std::uint8_t>(std::clamp(std::round(value), -127.0F, 127.0F) + 128.0F);
}

}  // namespace

void draw_section(SectionPixels& out, const ColumnRoom& room, const SectionLine& line) {
    const auto width = static_cast<std::size_t>(std::max(line.width, 0));
    const auto height = static_cast<std::size_t>(std::max(line.height, 0));
    out.colors.assign(4 * width * height, 0);
    out.contents.assign(4 * width * height, 0);
    const Palette& palette = room.palette();
    const auto colors = palette_colors(palette, room.world().materials);
    const double length = std::max(std::hypot(line.x1 - line.x0, line.z1 - line.z0), 1e-9);
    const auto along_x = static_cast<float>((line.x1 - line.x0) / length);
    const auto along_z = static_cast<float>((line.z1 - line.z0) / length);
    CutColumn column;
    for (std::size_t i = 0; i < width; ++i) {
        const double t = (static_cast<double>(i) + 0.5) / static_cast<double>(width);
        find_column(column, room, line.x0 + t * (line.x1 - line.x0),
                    line.z0 + t * (line.z1 - line.z0));
        if (column.limits.empty()) {
            continue;
        }
        std::size_t above = 0;
        for (std::size_t j = 0; j < height; ++j) {
            const double y = line.y0 + (line.y1 - line.y0) * (static_cast<double>(j) + 0.5) /
                                           static_cast<double>(height);
            const Mix mix = mix_at(column, above, static_cast<float>(y * kUnitsPerVoxel));
            const Limit& low = column.limits[mix.low];
            const Limit& high = column.limits[mix.high];
            const PaletteEntry& shown = palette[mix.t < 0.5F ? low.palette_id : high.palette_id];
            const LinearColor& from = colors[low.palette_id];
            const LinearColor& to = colors[high.palette_id];
            const Rgb8 color = srgb_from_linear({.r = from.r + mix.t * (to.r - from.r),
                                                 .g = from.g + mix.t * (to.g - from.g),
                                                 .b = from.b + mix.t * (to.b - from.b)});
            const std::size_t at = 4 * (j * width + i);
            out.colors[at] = color.r;
            out.colors[at + 1] = color.g;
            out.colors[at + 2] = color.b;
            out.colors[at + 3] = shown.is_solid() ? 255 : 0;
            out.contents[at] =
                main_material(palette[low.palette_id].composition,
                              palette[high.palette_id].composition, static_cast<double>(mix.t));
            out.contents[at + 1] = static_cast<std::uint8_t>(static_cast<int>(shown.kind) + 1);
            const auto mixed = [&mix](std::int8_t a, std::int8_t b) {
                return static_cast<float>(a) + mix.t * static_cast<float>(b - a);
            };
            out.contents[at + 2] = signed_byte(mixed(low.flow.x, high.flow.x) * along_x +
                                               mixed(low.flow.z, high.flow.z) * along_z);
            out.contents[at + 3] = signed_byte(mixed(low.flow.y, high.flow.y));
        }
    }
}

}  // namespace terrane
