#include "generator/volume/chunk.h"

#include "generator/volume/cut_columns.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/world/composition.h"
#include "protocol/base/check.h"

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace terrane {
namespace {

void make_uniform(Chunk& out, const PaletteEntry& content) {
    out.uniform = true;
    out.uniform_content = content;
    out.columns.x_first = out.columns.z_first = out.columns.width = out.columns.length = 0;
    out.columns.offsets.clear();
    out.columns.limits.clear();
    out.palette.clear();
    out.stack_palette_ids.clear();
}

/// The whole columns of a level above 0, without the apron.
void copy_columns(ColumnGrid& out, const Stack& stack) {
    out.x_first = out.z_first = 0;
    out.width = out.length = stack.side;
    out.limits.clear();
    out.offsets.assign(1, 0);
    for (std::int32_t z = 0; z < stack.side; ++z) {
        for (std::int32_t x = 0; x < stack.side; ++x) {
            const auto column = stack.columns.column(x, z);
            out.limits.insert(out.limits.end(), column.begin(), column.end());
            out.offsets.push_back(static_cast<std::uint32_t>(out.limits.size()));
        }
    }
}

/// Keeps the entries in use, in ascending stack id, and points the limits at them.
void localize_palette(Chunk& out, const Palette& palette, std::vector<std::uint16_t>& local_ids) {
    local_ids.assign(palette.size(), 0);
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
    if (out.stack_palette_ids.back() + std::size_t{1} == out.palette.size()) {
        return;  // none is left out below the last: the numbers are the same
    }
    for (Limit& limit : out.columns.limits) {
        limit.palette_id = local_ids[limit.palette_id];
    }
}

}  // namespace

void ChunkCutter::cut(Chunk& out, const Stack& stack, std::int32_t y, std::int32_t height) {
    TERRANE_ASSERT(stack.side > 0 && height > 0 && (stack.position.lod == 0 || y == 0));
    TERRANE_ASSERT(!stack.palette.empty());
    out.position = {
        .lod = stack.position.lod, .x = stack.position.x, .y = y, .z = stack.position.z};
    out.side = stack.side;
    out.height = height;
    if (y < 0) {
        make_uniform(out, stack.palette[0]);  // The base goes down for ever.
        return;
    }
    if (stack.position.lod > 0) {
        copy_columns(out.columns, stack);
        if (is_uniform(out.columns.limits, stack.palette)) {
            make_uniform(out, stack.palette[out.columns.limits[0].palette_id]);
            return;
        }
    } else {
        cut_.resize(1);
        std::swap(cut_[0].columns, out.columns);  // the caller's memory is used, not this one's
        columns_.cut(cut_, stack.columns, stack.palette,
                     {.x0 = 0, .z0 = 0, .side = stack.side, .height = height, .first_y = y});
        std::swap(cut_[0].columns, out.columns);
        if (cut_[0].uniform) {
            make_uniform(out, stack.palette[cut_[0].content_id]);
            return;
        }
    }
    out.uniform = false;
    out.uniform_content = {};
    localize_palette(out, stack.palette, local_ids_);
}

void cut_chunk(Chunk& out, const Stack& stack, std::int32_t y, std::int32_t height) {
    ChunkCutter().cut(out, stack, y, height);
}

}  // namespace terrane
