#include "generator/mesh/solid_mask.h"

#include "generator/mesh/lanes.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/world/composition.h"
#include "protocol/base/check.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace terrane {
namespace {

/// Bit i is set if limit i of the four has a palette id of at least `least`.
unsigned ids_from(const Limit* limits, std::int32_t least) {
    static_assert(sizeof(Limit) == 12 && offsetof(Limit, palette_id) == 4);
    using Halves = std::uint16_t __attribute__((vector_size(16)));
    const auto sixteen = [limits](std::size_t at) {
        Halves halves;
        std::memcpy(&halves, reinterpret_cast<const char*>(limits) + at, sizeof halves);
        return halves;
    };
    // The four ids lie in halves 2 of the first vector, 0 and 6 of the second, 4 of the third: none
    // in another's way. So they come as limits 1, 0, 3, 2.
    const Halves two = __builtin_shufflevector(sixteen(0), sixteen(16), 8, 1, 2, 3, 4, 5, 14, 7);
    const Halves four = __builtin_shufflevector(two, sixteen(32), 0, 1, 2, 3, 12, 5, 6, 7);
    const Lanes ids = std::bit_cast<Lanes>(four) & 0xffff;
    const unsigned found = bits_of(ids >= least);
    return (found & 5U) << 1U | (found & 10U) >> 1U;
}

/// Overwrites `out` with the numbers of the limits that show void or a cave, ascending, and
/// UINT32_MAX behind them. Few do but a column's last one.
void find_hollow_limits(std::vector<std::uint32_t>& out, std::span<const Limit> limits,
                        std::span<const std::uint8_t> is_hollow) {
    // What is below the first hollow id needs no second look: a world's layers come first.
    const auto least = static_cast<std::int32_t>(
        std::find(is_hollow.begin(), is_hollow.end(), std::uint8_t{1}) - is_hollow.begin());
    out.resize(limits.size() + 1);
    std::uint32_t* next = out.data();
    const auto look_at = [&](std::size_t i) {
        *next = static_cast<std::uint32_t>(i);
        next += is_hollow[limits[i].palette_id];
    };
    std::size_t i = 0;
    for (; i + 4 <= limits.size(); i += 4) {
        for (unsigned bits = ids_from(&limits[i], least); bits != 0; bits &= bits - 1) {
            look_at(i + static_cast<std::size_t>(std::countr_zero(bits)));
        }
    }
    for (; i < limits.size(); ++i) {
        look_at(i);
    }
    *next = UINT32_MAX;
}

/// Appends the ends of the column of limits begin..end-1 to `out`. `hollow` are the hollow limits
/// from `begin` on: next to no other does anything end.
void append_ends(std::vector<SolidEnd>& out, const Limits& limits, std::size_t begin,
                 std::size_t end, const std::uint32_t* hollow,
                 std::span<const std::uint8_t> is_hollow) {
    bool is_solid = true;  // the ground
    for (std::size_t i = begin; i < end; ++i) {
        if (is_solid) {
            while (*hollow < i) {
                ++hollow;
            }
            i = std::max<std::size_t>(i + 1, std::min<std::size_t>(*hollow, end)) - 1;
        }
        const Limit& low = limits[i];
        const bool is_last = i + 1 == end;
        if (!is_last && low.y256 >= limits[i + 1].y256) {
            continue;  // no height between them
        }
        const bool is_solid_above =
            !is_last && is_hollow[low.palette_id] == 0 && is_hollow[limits[i + 1].palette_id] == 0;
        if (is_solid_above != is_solid) {
            // A top shows what is under it: the first limit at its height.
            std::size_t shown = i;
            while (is_solid && shown > begin && limits[shown - 1].y256 == low.y256) {
                --shown;
            }
            out.push_back({.y256 = low.y256, .palette_id = limits[shown].palette_id});
            is_solid = is_solid_above;
        }
    }
}

/// Fills the planes above the first from the columns of many ends, and corrects what was taken from
/// the tops alone.
void fill_planes(SolidColumns& out) {
    const std::size_t count = out.column_count();
    std::size_t most = 1;
    for (std::size_t i = 0; i < out.many.size(); i += 2) {
        most = std::max<std::size_t>(most, out.many[i + 1]);
    }
    out.plane_count = most;
    out.planes256.resize(most * count);
    out.plane_ids.resize(most * count);
    std::copy(out.top256.begin(), out.top256.end(), out.planes256.begin());
    std::copy(out.top_id.begin(), out.top_id.end(), out.plane_ids.begin());
    std::fill(out.planes256.begin() + static_cast<std::ptrdiff_t>(count), out.planes256.end(),
              kEndlessly256);
    std::fill(out.plane_ids.begin() + static_cast<std::ptrdiff_t>(count), out.plane_ids.end(),
              std::uint16_t{0});
    out.lowest256 = out.lowest_top256;
    const SolidEnd* end = out.many_ends.data();
    for (std::size_t i = 0; i < out.many.size(); i += 2) {
        const std::size_t column = out.many[i];
        const std::size_t ends = out.many[i + 1];
        for (std::size_t plane = 0; plane < ends; ++plane, ++end) {
            out.planes256[plane * count + column] = end->y256;
            out.plane_ids[plane * count + column] = end->palette_id;
        }
        out.lowest256 = std::min(out.lowest256, out.planes256[column]);
    }
}

/// Bits 0..count-1, for any count.
std::uint64_t lowest_bits(std::int32_t count) {
    if (count <= 0) {
        return 0;
    }
    return ~std::uint64_t{0} >> (64 - std::min(count, 64));
}

}  // namespace

void find_solid_columns(SolidColumns& out, const Stack& stack) {
    const ColumnGrid& grid = stack.columns;
    TERRANE_ASSERT(grid.width == stack.side + 2 && grid.length == stack.side + 2);
    out.width = static_cast<std::size_t>(grid.width);
    const std::size_t count = out.column_count();
    out.top256.resize(count);
    out.top_id.resize(count);
    out.simple_from256.resize(count);
    out.many.clear();
    out.many_ends.clear();
    out.is_hollow.clear();
    for (const PaletteEntry& entry : stack.palette) {
        out.is_hollow.push_back(entry.is_solid() ? 0 : 1);
    }
    find_hollow_limits(out.hollow_limits, grid.limits, out.is_hollow);

    out.lowest_top256 = INT32_MAX;
    out.highest256 = INT32_MIN;
    const std::uint32_t* next_hollow = out.hollow_limits.data();
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint32_t begin = grid.offsets[i];
        const std::uint32_t end = grid.offsets[i + 1];
        const Limit* const last = grid.limits.data() + end - 1;
        SolidEnd top = {.y256 = last->y256,
                        .palette_id = last[begin < end - 1 ? -1 : 0].palette_id};
        std::int32_t bottom256 = -kEndlessly256;
        // Solid up to the top and void above: one end. Anything else is read limit by limit.
        const bool is_plain =
            *next_hollow == end - 1 && end - begin > 1 && last[-1].y256 == last->y256;
        if (!is_plain) {
            const std::size_t before = out.many_ends.size();
            append_ends(out.many_ends, grid.limits, begin, end, next_hollow, out.is_hollow);
            const std::size_t ends = out.many_ends.size() - before;
            out.many.push_back(static_cast<std::uint32_t>(i));
            out.many.push_back(static_cast<std::uint32_t>(ends));
            top = out.many_ends.back();
            bottom256 = ends > 1 ? out.many_ends[out.many_ends.size() - 2].y256 : bottom256;
        }
        while (*next_hollow < end) {
            ++next_hollow;
        }
        out.top256[i] = top.y256;
        out.top_id[i] = top.palette_id;
        out.simple_from256[i] = bottom256 + kDistanceMax256;
        out.lowest_top256 = std::min(out.lowest_top256, top.y256);
        out.highest256 = std::max(out.highest256, top.y256);
    }
    fill_planes(out);
}

void find_covered(std::vector<std::int32_t>& out, const SolidColumns& columns,
                  std::int32_t roof256) {
    out.resize(columns.column_count());
    std::transform(columns.top256.begin(), columns.top256.end(), out.begin(),
                   [roof256](std::int32_t top256) { return top256 - roof256; });
    const SolidEnd* ends = columns.many_ends.data();
    for (std::size_t i = 0; i < columns.many.size(); i += 2) {
        const std::size_t count = columns.many[i + 1];
        std::int32_t missing256 = roof256;
        // The tops are ends 0, 2 and so on; the lowest solid has no bottom.
        std::size_t top = count - 1;
        while (top > 0 && ends[top].y256 - ends[top - 1].y256 < missing256) {
            missing256 -= ends[top].y256 - ends[top - 1].y256;
            top -= 2;
        }
        out[columns.many[i]] = ends[top].y256 - missing256;
        ends += count;
    }
}

void fill_solid_mask(SolidMask& out, const SolidColumns& columns) {
    out.width = columns.width;
    out.bits.resize(columns.column_count() * out.words());
    std::uint64_t* bits = out.bits.data();
    for (std::size_t z = 0; z < columns.width; ++z) {
        for (const std::int32_t y : out.word_y) {
            // The points up to an end are those up to floor(y256 / 256); every further end turns
            // the points under it over, and ends that are not there do so an even number of times.
            for (std::size_t plane = 0; plane < columns.plane_count; ++plane) {
                const std::int32_t* const ends256 = columns.plane256(plane) + z * columns.width;
                for (std::size_t x = 0; x < columns.width; ++x) {
                    const std::uint64_t points = lowest_bits((ends256[x] >> 8) + 1 - y);
                    bits[x] = plane == 0 ? points : bits[x] ^ points;
                }
            }
            bits += columns.width;
        }
    }
}

}  // namespace terrane
