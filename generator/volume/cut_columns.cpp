#include "generator/volume/cut_columns.h"

#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/check.h"
#include "protocol/base/clones.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

namespace terrane {
namespace {

using Place = ColumnCutter::Place;

/// So many limits are copied at once, needed or not.
constexpr std::size_t kCopyBlock = 8;
constexpr std::size_t kColumnsMax = static_cast<std::size_t>(kChunkSideMax);

std::uint16_t void_id_of(const Palette& palette) {
    const auto found = std::find_if(palette.begin(), palette.end(), [](const PaletteEntry& entry) {
        return entry.kind == PaletteKind::void_;
    });
    TERRANE_ASSERT(found != palette.end());
    return static_cast<std::uint16_t>(found - palette.begin());
}

/// A column's limits. Whole blocks may be read behind it if it has slack.
struct Source {
    const Limit* limits = nullptr;
    std::uint32_t count = 0;
    bool has_slack = false;
};

inline void copy_limits(Limit* to, const Limit* from, std::uint32_t count, bool has_slack) {
    if (!has_slack) {
        std::copy_n(from, count, to);
        return;
    }
    std::memcpy(static_cast<void*>(to), from, kCopyBlock * sizeof(Limit));
    for (std::uint32_t i = kCopyBlock; i < count; i += kCopyBlock) {
        std::memcpy(static_cast<void*>(to + i), from + i, kCopyBlock * sizeof(Limit));
    }
}

/// The first limit at or above `hi`, from `above` on; `guess` is where it was in the column before.
inline std::uint32_t first_at_or_above(const Source& source, std::uint32_t above,
                                       std::uint32_t guess, std::int64_t hi) {
    const Limit* const limits = source.limits;
    std::uint32_t end = std::clamp(guess, above, source.count);
    while (end > above && limits[end - 1].y256 >= hi) {
        --end;
    }
    while (end < source.count && limits[end].y256 < hi) {
        ++end;
    }
    return end;
}

/// A chunk's part of a column, from the limit before `above` to the limit `end`, or to its ceiling
/// if there is none.
inline void put_part(Place& place, const Source& source, std::uint32_t above, std::uint32_t end,
                     std::uint16_t void_id) {
    const bool closed = end < source.count;
    const std::uint32_t copied = end - above + (closed ? 2 : 1);
    Limit* const to = place.base + place.used;
    copy_limits(to, source.limits + above - 1, copied, source.has_slack);
    if (!closed) {
        const std::int64_t y256 =
            std::min<std::int64_t>(place.hi, std::numeric_limits<std::int32_t>::max());
        to[copied] = {.y256 = static_cast<std::int32_t>(y256), .palette_id = void_id, .flow = {}};
    }
    place.used += copied + (closed ? 0 : 1);
    *place.ends++ = place.used;
}

/// Cuts a column; the search begins where the one before was cut.
inline void cut_column(Place* places, std::size_t count, const Source& source,
                       std::uint16_t void_id) {
    const Limit* const limits = source.limits;
    // The first limit above the floor: the first at or above one more.
    std::uint32_t above = 1;
    if (places->lo > 0 || (source.count > 1 && limits[1].y256 <= 0)) {
        above = first_at_or_above(source, 1, places->end, places->lo + 1);
    }
    for (Place* place = places; place != places + count; ++place) {
        const std::uint32_t guess = place->end;
        if (source.has_slack && guess - above < source.count - above &&
            limits[guess - 1].y256 < place->hi && limits[guess].y256 > place->hi) {
            // The rule: as before, and strictly between two limits.
            const std::uint32_t copied = guess - above + 2;
            Limit* const to = place->base + place->used;
            copy_limits(to, limits + above - 1, copied, true);
            place->used += copied;
            *place->ends++ = place->used;
            above = guess;
            continue;
        }
        const std::uint32_t end = first_at_or_above(source, above, guess, place->hi);
        place->end = end;
        put_part(*place, source, above, end, void_id);
        above = end;
        while (above < source.count && limits[above].y256 <= place->hi) {
            ++above;
        }
    }
}

/// Cuts a row of columns. Whole blocks may be read behind each of the first `with_slack`.
TERRANE_CLONES
void cut_row(std::span<Place> places, std::uint16_t void_id, const Limit* limits,
             std::span<const std::uint32_t> offsets, std::size_t with_slack) {
    for (std::size_t i = 0; i + 1 < offsets.size(); ++i) {
        const Source source{.limits = limits + offsets[i],
                            .count = offsets[i + 1] - offsets[i],
                            .has_slack = i < with_slack};
        cut_column(places.data(), places.size(), source, void_id);
    }
}

/// Room for a row of columns whose limits are `limits` in all: each chunk may have every limit of a
/// column and a void.
void make_room(ChunkLimits& chunk, Place& place, std::size_t limits, std::size_t columns) {
    const std::size_t most = place.used + limits + columns + kCopyBlock;
    Limits& all = chunk.columns.limits;
    if (all.size() < most) {
        all.resize(std::max(most, 2 * all.size()));
        place.base = all.data();
    }
}

void make_uniform(ChunkLimits& chunk, std::uint16_t content_id) {
    chunk.uniform = true;
    chunk.content_id = content_id;
    ColumnGrid& columns = chunk.columns;
    columns.x_first = columns.z_first = columns.width = columns.length = 0;
    columns.offsets.clear();
    columns.limits.clear();
}

/// The columns' highest limit.
std::int32_t highest_limit(const ColumnGrid& columns, const ChunkSquare& square) {
    std::int32_t highest = 0;
    for (std::int32_t z = square.z0; z < square.z0 + square.side; ++z) {
        const std::size_t row = columns.index_of(square.x0, z) + 1;
        for (std::size_t i = row; i < row + static_cast<std::size_t>(square.side); ++i) {
            highest = std::max(highest, columns.limits[columns.offsets[i] - 1].y256);
        }
    }
    return highest;
}

void begin_chunk(ChunkLimits& chunk, Place& place, const ChunkSquare& square, std::int32_t y) {
    const std::int64_t chunk_units = std::int64_t{square.height} * kUnitsPerVoxel;
    chunk.uniform = false;
    ColumnGrid& columns = chunk.columns;
    columns.x_first = columns.z_first = 0;
    columns.width = columns.length = square.side;
    const auto side = static_cast<std::size_t>(square.side);
    columns.offsets.resize(side * side + 1);
    columns.offsets[0] = 0;
    place = {.base = columns.limits.data(),
             .ends = columns.offsets.data() + 1,
             .lo = y * chunk_units,
             .hi = (y + std::int64_t{1}) * chunk_units};
}

}  // namespace

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

void ColumnCutter::cut(std::vector<ChunkLimits>& out, const ColumnGrid& columns,
                       const Palette& palette, const ChunkSquare& square) {
    const auto count = static_cast<std::size_t>(square.count);
    const auto side = static_cast<std::size_t>(square.side);
    TERRANE_ASSERT(side >= 1 && side <= kColumnsMax && square.first_y >= 0);
    if (out.size() < count) {
        out.resize(count);
    }
    places_.resize(std::max(places_.size(), count));
    const std::uint16_t void_id = void_id_of(palette);
    const std::int32_t highest = highest_limit(columns, square);
    std::size_t standing = 0;  // chunks that anything reaches into
    for (; standing < count; ++standing) {
        const auto y =
            static_cast<std::int32_t>(square.first_y + static_cast<std::int32_t>(standing));
        if (std::int64_t{y} * square.height * kUnitsPerVoxel >= highest) {
            break;
        }
        begin_chunk(out[standing], places_[standing], square, y);
    }
    for (std::size_t i = standing; i < count; ++i) {
        make_uniform(out[i], void_id);
    }
    if (standing == 0) {
        return;
    }
    for (std::int32_t z = square.z0; z < square.z0 + square.side; ++z) {
        const auto offsets =
            std::span(columns.offsets).subspan(columns.index_of(square.x0, z), side + 1);
        for (std::size_t i = 0; i < standing; ++i) {
            make_room(out[i], places_[i], offsets.back() - offsets.front(), side);
        }
        std::size_t with_slack = side;
        while (with_slack > 0 && offsets[with_slack] + kCopyBlock > columns.limits.size()) {
            --with_slack;
        }
        cut_row(std::span(places_).first(standing), void_id, columns.limits.data(), offsets,
                with_slack);
    }
    for (std::size_t i = 0; i < standing; ++i) {
        Limits& limits = out[i].columns.limits;
        limits.resize(places_[i].used);
        if (is_uniform(limits, palette)) {
            make_uniform(out[i], limits[0].palette_id);
        }
    }
}

}  // namespace terrane
