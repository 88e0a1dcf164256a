#include "server/render/section_columns.h"

#include "generator/terrain/generate_stack.h"
#include "generator/terrain/region.h"
#include "generator/terrain/world.h"
#include "generator/volume/color.h"
#include "generator/volume/limit.h"
#include "generator/volume/water.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/render/drawing.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

namespace terrane {
namespace {

/// Above this many comparisons two columns share no limit: some 500 limits
/// each, far more than any world has.
constexpr std::size_t kComparisonsMax = std::size_t{1} << 18;

/// Part of a line's columns, and the rectangle around them that is generated at once.
struct LinePart {
    std::size_t first = 0;
    std::size_t end = 0;
    ColumnRectangle box;
};

ColumnRectangle box_around(ColumnPos a, ColumnPos b) {
    return {.x0 = std::min(a.x, b.x),
            .z0 = std::min(a.z, b.z),
            .width = static_cast<std::int32_t>(std::abs(a.x - b.x)) + 1,
            .length = static_cast<std::int32_t>(std::abs(a.z - b.z)) + 1};
}

/// As many columns from `first` on as fit into a box that is not mostly of other columns: a
/// diagonal line needs one column of a row only.
LinePart part_from(std::span<const ColumnPos> columns, std::size_t first) {
    constexpr std::size_t kColumnsMax = 64;
    constexpr std::size_t kWasteMax = 16;
    LinePart part = {.first = first, .end = first, .box = {}};
    while (part.end < columns.size() && part.end - first < kColumnsMax) {
        const ColumnRectangle box = box_around(columns[first], columns[part.end]);
        const auto area =
            static_cast<std::size_t>(box.width) * static_cast<std::size_t>(box.length);
        if (area > kWasteMax * (part.end - first + 1)) {
            break;
        }
        part.box = box;
        ++part.end;
    }
    return part;
}

/// Layers have the same number in every column; the elements of two generations are told apart by
/// what they are made of.
std::size_t sort_of(const PaletteEntry& entry, std::size_t id, std::size_t layers) {
    if (id <= layers) {  // the void's is the number of layers
        return id;
    }
    std::size_t sort = static_cast<std::size_t>(entry.kind) + 1;
    for (const Share& share : entry.composition.shares()) {
        sort = sort * 1000003 + share.material + 1;
    }
    return sort + kMaterialsMax * kMaterialsMax;
}

SeenColumn seen(std::span<const Limit> column, const Palette& palette, const World& world) {
    SeenColumn out;
    out.reserve(column.size());
    for (const Limit& limit : column) {
        const PaletteEntry& entry = palette[limit.palette_id];
        out.push_back(
            {.y = static_cast<float>(limit.y256) / static_cast<float>(kUnitsPerVoxel),
             // Water fills what it is in: it has its own colour, not a hollow's dark.
             .kind = is_water(entry, world.definition.materials) ? PaletteKind::layer : entry.kind,
             .sort = sort_of(entry, limit.palette_id, world.stack.layers.size()),
             .color = color_of(entry.composition.shares(), world.definition.materials)});
    }
    return out;
}

/// The limits that two columns pair, by their places in each; ascending.
struct Match {
    std::size_t left = 0;
    std::size_t right = 0;
};

/// What it is worth to pair two limits: nothing if they don't show the same, else more the nearer
/// they are, but always more than to leave them unpaired.
float worth_of(const SeenLimit& left, const SeenLimit& right) {
    constexpr float kPair = 4096;  // voxels
    return left.sort == right.sort ? kPair - std::min(std::abs(left.y - right.y), kPair - 1) : 0.0F;
}

/// The common subsequence that is worth most.
std::vector<Match> matches_of(const SeenColumn& left, const SeenColumn& right,
                              std::vector<float>& scratch) {
    std::vector<Match> matches;
    const std::size_t row = right.size() + 1;
    if (left.size() * right.size() > kComparisonsMax) {
        return matches;
    }
    // scratch[i * row + j]: the most that left from i on and right from j on are worth.
    scratch.assign((left.size() + 1) * row, 0);
    for (std::size_t i = left.size(); i-- > 0;) {
        for (std::size_t j = right.size(); j-- > 0;) {
            const float worth = worth_of(left[i], right[j]);
            const float paired = worth > 0 ? worth + scratch[(i + 1) * row + j + 1] : 0.0F;
            scratch[i * row + j] =
                std::max({paired, scratch[(i + 1) * row + j], scratch[i * row + j + 1]});
        }
    }
    for (std::size_t i = 0, j = 0; i < left.size() && j < right.size();) {
        const float most = scratch[i * row + j];
        if (most == scratch[(i + 1) * row + j]) {
            ++i;
        } else if (most == scratch[i * row + j + 1]) {
            ++j;
        } else {
            matches.push_back({.left = i++, .right = j++});
        }
    }
    return matches;
}

float height_at(const SeenColumn& column, std::size_t i) {
    return column[std::min(i, column.size() - 1)].y;
}

/// Where limits `first` to `end` of one column close in the other: at the height of their middle as
/// far as there is room between `lowest` and `highest`.
float closing_height(const SeenColumn& column, std::size_t first, std::size_t end, float lowest,
                     float highest) {
    const float middle = first < end ? (column[first].y + column[end - 1].y) / 2 : lowest;
    return std::clamp(middle, lowest, std::max(lowest, highest));
}

/// Limits between two matches: those of the left column first, then those of the right, so that
/// heights ascend in both.
void add_unmatched(std::vector<PairedLimit>& out, const SeenColumn& left, Match first, Match end,
                   const SeenColumn& right) {
    const float right_y = closing_height(left, first.left, end.left,
                                         first.right > 0 ? right[first.right - 1].y : 0.0F,
                                         height_at(right, first.right));
    const float left_y =
        closing_height(right, first.right, end.right, end.left > 0 ? left[end.left - 1].y : 0.0F,
                       height_at(left, end.left));
    for (std::size_t i = first.left; i < end.left; ++i) {
        out.push_back({.y_left = left[i].y,
                       .y_right = right_y,
                       .in_left = true,
                       .in_right = false,
                       .kind = left[i].kind,
                       .color_left = left[i].color,
                       .color_right = left[i].color});
    }
    for (std::size_t j = first.right; j < end.right; ++j) {
        out.push_back({.y_left = left_y,
                       .y_right = right[j].y,
                       .in_left = false,
                       .in_right = true,
                       .kind = right[j].kind,
                       .color_left = right[j].color,
                       .color_right = right[j].color});
    }
}

}  // namespace

std::vector<ColumnPos> columns_on(ColumnPos from, ColumnPos to) {
    const std::int64_t dx = to.x - from.x;
    const std::int64_t dz = to.z - from.z;
    const std::int64_t steps = std::max(std::abs(dx), std::abs(dz));
    // i * d / steps to the nearest integer; the products fit, as there are few steps.
    const auto along = [steps](std::int64_t d, std::int64_t i) {
        return steps == 0 ? 0 : floor_div(2 * i * d + steps, 2 * steps);
    };
    std::vector<ColumnPos> columns;
    for (std::int64_t i = 0; i <= steps; ++i) {
        columns.push_back({.x = from.x + along(dx, i), .z = from.z + along(dz, i)});
    }
    return columns;
}

Result<std::vector<SeenColumn>> see_columns(const Drawing& drawing,
                                            std::span<const ColumnPos> positions) {
    ColumnSet set;
    std::vector<SeenColumn> columns;
    columns.reserve(positions.size());
    for (std::size_t first = 0; first < positions.size();) {
        if (auto on = go_on(drawing); !on) {
            return tl::unexpected(on.error());
        }
        const LinePart part = part_from(positions, first);
        if (const auto made = drawing.generator->generate(set, part.box); !made) {
            return tl::unexpected(made.error());
        }
        for (const ColumnPos at : positions.subspan(part.first, part.end - part.first)) {
            columns.push_back(
                seen(set.columns.column(static_cast<std::int32_t>(at.x - part.box.x0),
                                        static_cast<std::int32_t>(at.z - part.box.z0)),
                     set.palette, *drawing.world));
        }
        first = part.end;
    }
    return columns;
}

void pair_limits(std::vector<PairedLimit>& out, const SeenColumn& left, const SeenColumn& right,
                 std::vector<float>& scratch) {
    out.clear();
    Match next;
    for (const Match& match : matches_of(left, right, scratch)) {
        add_unmatched(out, left, next, match, right);
        const SeenLimit& a = left[match.left];
        const SeenLimit& b = right[match.right];
        out.push_back({.y_left = a.y,
                       .y_right = b.y,
                       .in_left = true,
                       .in_right = true,
                       .kind = a.kind,
                       .color_left = a.color,
                       .color_right = b.color});
        next = {.left = match.left + 1, .right = match.right + 1};
    }
    add_unmatched(out, left, next, {.left = left.size(), .right = right.size()}, right);
}

}  // namespace terrane
