// Two passes over the stack's limits: the first copies each column's part and notes which palette
// entries it uses, the second numbers these entries anew.
#include "generator/volume/chunk.h"

#include "protocol/base/check.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace terrane {
namespace {

/// Floor and ceiling of the chunk in 1/256 voxel; a chunk with anything in it has lo < 2^31.
struct Span256 {
    std::int64_t lo = 0;
    std::int64_t hi = 0;
};

void make_uniform(Chunk& out, const PaletteEntry& content) {
    out.uniform = true;
    out.uniform_content = content;
    out.columns.x_first = out.columns.z_first = out.columns.width = out.columns.length = 0;
    out.columns.offsets.clear();
    out.columns.limits.clear();
    out.palette.clear();
    out.stack_palette_ids.clear();
}

std::uint16_t void_id_of(const Palette& palette) {
    const auto found = std::find_if(palette.begin(), palette.end(), [](const PaletteEntry& entry) {
        return entry.kind == PaletteKind::void_;
    });
    TERRANE_ASSERT(found != palette.end());
    return static_cast<std::uint16_t>(found - palette.begin());
}

/// Appends the last limit at or below lo, those between, and the first at or above hi; the void at
/// hi where nothing is that high.
void append_cut(Limits& out, std::span<const Limit> column, Span256 span, std::uint16_t void_id) {
    TERRANE_ASSERT(!column.empty());
    std::size_t first = 0;
    while (first + 1 < column.size() && column[first + 1].y256 <= span.lo) {
        ++first;
    }
    std::size_t end = first + 1;
    while (end < column.size() && column[end].y256 < span.hi) {
        ++end;
    }
    const bool closed = end < column.size();
    const auto part = column.subspan(first, end - first + (closed ? 1 : 0));
    out.insert(out.end(), part.begin(), part.end());
    if (!closed) {
        const std::int64_t y256 =
            std::min<std::int64_t>(span.hi, std::numeric_limits<std::int32_t>::max());
        out.push_back({.y256 = static_cast<std::int32_t>(y256), .palette_id = void_id, .flow = {}});
    }
}

/// Copies every column's part with the stack's palette ids.
void cut_columns(Chunk& out, const Stack& stack, Span256 span, std::uint16_t void_id) {
    ColumnGrid& columns = out.columns;
    columns.x_first = columns.z_first = 0;
    columns.width = columns.length = stack.side;
    columns.limits.clear();
    columns.offsets.clear();
    columns.offsets.push_back(0);
    for (std::int32_t z = 0; z < stack.side; ++z) {
        for (std::int32_t x = 0; x < stack.side; ++x) {
            const auto column = stack.columns.column(x, z);
            if (stack.position.lod == 0) {
                append_cut(columns.limits, column, span, void_id);
            } else {  // the whole height at once
                columns.limits.insert(columns.limits.end(), column.begin(), column.end());
            }
            columns.offsets.push_back(static_cast<std::uint32_t>(columns.limits.size()));
        }
    }
}

/// Whether all limits show one content: equal compositions, whatever their ids.
bool is_uniform(std::span<const Limit> limits, const Palette& palette) {
    const PaletteEntry& content = palette[limits[0].palette_id];
    std::uint16_t equal_id = limits[0].palette_id;
    for (const Limit& limit : limits) {
        if (limit.palette_id != equal_id) {
            if (palette[limit.palette_id] != content) {
                return false;
            }
            equal_id = limit.palette_id;
        }
    }
    return true;
}

/// Keeps the entries in use, in ascending stack id, and points the limits at them.
void localize_palette(Chunk& out, const Palette& palette) {
    std::vector<std::uint16_t> local_ids(palette.size(), 0);
    for (const Limit& limit : out.columns.limits) {
        local_ids[limit.palette_id] = 1;
    }
    out.palette.clear();
    out.stack_palette_ids.clear();
    for (std::size_t id = 0; id < palette.size(); ++id) {
        if (local_ids[id] != 0) {
            local_ids[id] = static_cast<std::uint16_t>(out.palette.size());
            out.palette.push_back(palette[id]);
            out.stack_palette_ids.push_back(static_cast<std::uint16_t>(id));
        }
    }
    for (Limit& limit : out.columns.limits) {
        limit.palette_id = local_ids[limit.palette_id];
    }
}

}  // namespace

void cut_chunk(Chunk& out, const Stack& stack, std::int32_t y, std::int32_t height) {
    TERRANE_ASSERT(stack.side > 0 && height > 0 && (stack.position.lod == 0 || y == 0));
    TERRANE_ASSERT(!stack.palette.empty());
    out.position = {
        .lod = stack.position.lod, .x = stack.position.x, .y = y, .z = stack.position.z};
    out.side = stack.side;
    out.height = height;
    const std::int64_t chunk_units = std::int64_t{height} * kUnitsPerVoxel;
    const Span256 span = {.lo = y * chunk_units, .hi = (y + std::int64_t{1}) * chunk_units};
    const std::uint16_t void_id = void_id_of(stack.palette);
    if (y < 0) {
        make_uniform(out, stack.palette[0]);  // The base goes down for ever.
        return;
    }
    if (span.lo >= stack.highest_y256) {
        make_uniform(out, stack.palette[void_id]);
        return;
    }
    cut_columns(out, stack, span, void_id);
    if (is_uniform(out.columns.limits, stack.palette)) {
        make_uniform(out, stack.palette[out.columns.limits[0].palette_id]);
        return;
    }
    out.uniform = false;
    out.uniform_content = {};
    localize_palette(out, stack.palette);
}

}  // namespace terrane
