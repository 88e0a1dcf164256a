#include "generator/mesh/solid_mask.h"

#include "protocol/base/check.h"

#include <algorithm>
#include <cstdint>

namespace terrane {
namespace {

/// One bit a palette id; stacks have few compositions that are not solid.
class SolidIds {
  public:
    explicit SolidIds(const Palette& palette) : palette_(palette) {
        has_caves_ = std::any_of(palette.begin(), palette.end(), [](const PaletteEntry& entry) {
            return entry.kind == PaletteKind::cave;
        });
    }

    bool has_caves() const { return has_caves_; }

    bool is_solid(std::uint16_t id) const {
        TERRANE_DEBUG_ASSERT(id < palette_.size());
        return palette_[id].is_solid();
    }

  private:
    const Palette& palette_;
    bool has_caves_ = false;
};

/// True if the whole column is one interval that ends at its last limit, as all are without caves.
bool is_plain(std::span<const Limit> limits, const SolidIds& ids) {
    const std::size_t last = limits.size() - 1;
    if (last == 0 || limits[last].y256 != limits[last - 1].y256 ||
        ids.is_solid(limits[last].palette_id)) {
        return false;
    }
    if (!ids.has_caves()) {
        return ids.is_solid(limits[last - 1].palette_id);
    }
    return std::all_of(limits.begin(), limits.end() - 1,
                       [&ids](const Limit& limit) { return ids.is_solid(limit.palette_id); });
}

/// Appends the column's intervals at `next` and returns the end.
SolidInterval* append_intervals(SolidInterval* next, std::span<const Limit> limits,
                                const SolidIds& ids) {
    const Limit& first = limits.front();
    *next = {.bottom256 = kGroundBottom256,
             .top256 = first.y256,
             .bottom_id = first.palette_id,
             .top_id = first.palette_id};
    bool is_open = true;
    for (std::size_t i = 0; i + 1 < limits.size(); ++i) {
        const Limit& low = limits[i];
        const Limit& high = limits[i + 1];
        if (low.y256 >= high.y256) {
            continue;
        }
        if (!ids.is_solid(low.palette_id) || !ids.is_solid(high.palette_id)) {
            next += is_open ? 1 : 0;
            is_open = false;
            continue;
        }
        if (!is_open) {
            next->bottom256 = low.y256;
            next->bottom_id = low.palette_id;
            is_open = true;
        }
        next->top256 = high.y256;
        next->top_id = high.palette_id;
    }
    return next + (is_open ? 1 : 0);
}

/// Bits [first, last) of `words` words, `stride` apart; first may lie below 0, last above the end.
void set_points(std::uint64_t* out, std::size_t stride, std::size_t words, std::int64_t first,
                std::int64_t last) {
    for (std::size_t word = 0; word < words; ++word) {
        const std::int64_t base = static_cast<std::int64_t>(word) * 64;
        const auto from = static_cast<unsigned>(std::clamp<std::int64_t>(first - base, 0, 64));
        const auto to = static_cast<unsigned>(std::clamp<std::int64_t>(last - base, 0, 64));
        const auto below = [](unsigned count) {
            return count == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1;
        };
        out[word * stride] |= below(to) & ~below(from);
    }
}

}  // namespace

void find_solid_columns(SolidColumns& out, const Stack& stack) {
    const ColumnGrid& grid = stack.columns;
    TERRANE_ASSERT(grid.width == stack.side + 2 && grid.length == stack.side + 2);
    out.width = static_cast<std::size_t>(grid.width);
    const std::size_t count = out.width * out.width;
    out.offsets.resize(count + 1);
    out.intervals.resize(grid.limits.size() / 2 + count);  // an interval has two limits of its own
    out.top256.resize(count);
    out.top_id.resize(count);
    out.simple_from256.resize(count);
    const SolidIds ids(stack.palette);
    std::int32_t lowest = INT32_MAX;
    std::int32_t highest = INT32_MIN;
    SolidInterval* next = out.intervals.data();
    for (std::size_t i = 0; i < count; ++i) {
        const auto limits =
            std::span(grid.limits).subspan(grid.offsets[i], grid.offsets[i + 1] - grid.offsets[i]);
        SolidInterval* const first = next;
        out.offsets[i] = static_cast<std::uint32_t>(first - out.intervals.data());
        if (is_plain(limits, ids)) {
            const Limit& top = limits[limits.size() - 2];
            *next++ = {.bottom256 = kGroundBottom256,
                       .top256 = top.y256,
                       .bottom_id = limits.front().palette_id,
                       .top_id = top.palette_id};
        } else {
            next = append_intervals(next, limits, ids);
        }
        const SolidInterval& topmost = next[-1];
        out.top256[i] = topmost.top256;
        out.top_id[i] = topmost.top_id;
        out.simple_from256[i] = topmost.bottom256 + kDistanceMax256;
        lowest = std::min(lowest, first->top256);
        highest = std::max(highest, topmost.top256);
    }
    out.offsets[count] = static_cast<std::uint32_t>(next - out.intervals.data());
    out.lowest256 = lowest;
    out.highest256 = highest;
}

void fill_solid_mask(SolidMask& out, const SolidColumns& columns, std::int32_t y_first,
                     std::size_t words) {
    out.y_first = y_first;
    out.words = words;
    out.width = columns.width;
    out.bits.assign(columns.width * columns.width * words, 0);
    for (std::size_t z = 0; z < columns.width; ++z) {
        for (std::size_t x = 0; x < columns.width; ++x) {
            std::uint64_t* const bits = out.bits.data() + z * words * columns.width + x;
            for (const SolidInterval& interval : columns.column(z * columns.width + x)) {
                // The points above an end at y256 begin at floor(y256 / 256) + 1.
                set_points(bits, columns.width, words,
                           std::int64_t{interval.bottom256 >> 8} + 1 - y_first,
                           std::int64_t{interval.top256 >> 8} + 1 - y_first);
            }
        }
    }
}

}  // namespace terrane
