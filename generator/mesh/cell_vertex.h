// The vertex of one surface-nets cell: where its surface is and which way it faces.
//
// Source: S. F. Gibson, "Constrained elastic surface nets", 1998: the vertex is the mean of the
// crossings of the cell's twelve edges. Four lanes stand for the cell's four columns in the order
// (x, z), (x+1, z), (x, z+1), (x+1, z+1); the vectors are the compilers' own, so the same code and
// the same bits come out on every machine.
#pragma once

#include "generator/mesh/solid_mask.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace terrane {

using Lanes = std::int32_t __attribute__((vector_size(16)));
using FloatLanes = float __attribute__((vector_size(16)));
using HalfLanes = std::int16_t __attribute__((vector_size(16)));

// What x86 does in one instruction and the vectors of the compilers do not offer by name.

/// The lanes of a, then those of b, each kept within 16 bits.
inline HalfLanes narrowed(Lanes a, Lanes b) {
#ifdef __SSE2__
    return std::bit_cast<HalfLanes>(__builtin_ia32_packssdw128(a, b));
#else
    const auto within = [](Lanes lanes) {
        const Lanes most = Lanes{} + INT16_MAX;
        const Lanes low = lanes < most ? lanes : most;
        return low > -most ? low : -most;
    };
    a = within(a);
    b = within(b);
    HalfLanes all{};
    for (int i = 0; i < 4; ++i) {
        all[i] = static_cast<std::int16_t>(a[i]);
        all[i + 4] = static_cast<std::int16_t>(b[i]);
    }
    return all;
#endif
}

/// Products of neighbouring lanes, added two and two.
inline Lanes paired(HalfLanes a, HalfLanes b) {
#ifdef __SSE2__
    return std::bit_cast<Lanes>(__builtin_ia32_pmaddwd128(a, b));
#else
    Lanes sums{};
    for (int i = 0; i < 4; ++i) {
        sums[i] = a[2 * i] * b[2 * i] + a[2 * i + 1] * b[2 * i + 1];
    }
    return sums;
#endif
}

/// Bit i is set where lane i of a mask is.
inline unsigned bits_of(Lanes mask) {
#ifdef __SSE2__
    return static_cast<unsigned>(__builtin_ia32_movmskps(std::bit_cast<FloatLanes>(mask)));
#else
    return static_cast<unsigned>((mask[0] & 1) | (mask[1] & 2) | (mask[2] & 4) | (mask[3] & 8));
#endif
}

/// The same for lanes 0..3 of eight.
inline unsigned bits_of(HalfLanes mask) {
    return bits_of(__builtin_convertvector(__builtin_shufflevector(mask, mask, 0, 1, 2, 3), Lanes));
}

/// The four lanes' sums, in order.
inline Lanes sums_of(Lanes a, Lanes b, Lanes c, Lanes d) {
    const Lanes ab =
        __builtin_shufflevector(a, b, 0, 4, 1, 5) + __builtin_shufflevector(a, b, 2, 6, 3, 7);
    const Lanes cd =
        __builtin_shufflevector(c, d, 0, 4, 1, 5) + __builtin_shufflevector(c, d, 2, 6, 3, 7);
    return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) +
           __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

/// A cell's eight corners: the four columns at its floor, then at its ceiling.
struct CellCorners {
    HalfLanes distance{};  ///< signed vertical distance to the nearest end, clamped
    HalfLanes solid{};     ///< mask: -1 for yes and 0 for no
    /// Four columns: the height above the floor where the column's own edge crosses, if it does.
    HalfLanes crossing{};
};

struct CellVertex {
    Lanes offset256{};    ///< x, y, z in 0..255 from the cell's least corner, in 1/256 voxel
    FloatLanes normal{};  ///< x, y, z; unit length
};

/// Corners of a cell whose columns have one end each, seen from its floor at y256 = 0.
inline CellCorners corners_of_one_end(Lanes end256) {
    const HalfLanes most = HalfLanes{} + static_cast<std::int16_t>(kDistanceMax256);
    const HalfLanes raw = narrowed(end256, end256 - kUnitsPerVoxel);
    const HalfLanes low = raw < most ? raw : most;
    return {.distance = low > -most ? low : -most, .solid = raw >= 0, .crossing = raw};
}

/// Adds one more end a column; `distance` must not have its sign yet.
inline void add_end(CellCorners& corners, const CellCorners& end) {
    using Unsigned = std::uint16_t __attribute__((vector_size(16)));
    const HalfLanes distance = end.distance < 0 ? -end.distance : end.distance;
    corners.distance = distance < corners.distance ? distance : corners.distance;
    corners.solid ^= ~end.solid;
    // The lowest end that is not below the floor: those below are the largest without a sign.
    const auto known = std::bit_cast<Unsigned>(corners.crossing);
    const auto added = std::bit_cast<Unsigned>(end.crossing);
    corners.crossing = std::bit_cast<HalfLanes>(added < known ? added : known);
}

/// The same for columns of any number of ends; `end256(i)` is end i of the four columns.
template <typename EndsAt>
CellCorners corners_of_ends(std::size_t count, EndsAt end256) {
    CellCorners corners = corners_of_one_end(end256(0));
    corners.distance = corners.distance < 0 ? -corners.distance : corners.distance;
    for (std::size_t i = 1; i < count; ++i) {
        add_end(corners, corners_of_one_end(end256(i)));
    }
    corners.distance = (corners.distance ^ ~corners.solid) - ~corners.solid;
    return corners;
}

/// Masks of the upright edges that cross, in lanes 0..3; the other lanes are 0.
inline HalfLanes crossed_upright(const CellCorners& c) {
    const HalfLanes differs =
        c.solid ^ __builtin_shufflevector(c.solid, c.solid, 4, 5, 6, 7, 0, 1, 2, 3);
    return differs & HalfLanes{-1, -1, -1, -1, 0, 0, 0, 0};
}

/// Against the gradient of the distance, which grows into the solid; up where there is none.
inline FloatLanes normal_of(HalfLanes distance) {
    constexpr HalfLanes kX = {1, -1, 1, -1, 1, -1, 1, -1};
    constexpr HalfLanes kY = {1, 1, 1, 1, -1, -1, -1, -1};
    constexpr HalfLanes kZ = {1, 1, -1, -1, 1, 1, -1, -1};
    Lanes fall = sums_of(paired(distance, kX), paired(distance, kY), paired(distance, kZ), Lanes{});
    Lanes squares = fall * fall;  // each at most (8 * 1024)^2
    if (squares[0] + squares[1] + squares[2] == 0) [[unlikely]] {
        fall = squares = Lanes{0, 1, 0, 0};
    }
    const auto square = static_cast<float>(squares[0] + squares[1] + squares[2]);
    return __builtin_convertvector(fall, FloatLanes) * (1.0F / std::sqrt(square));
}

/// Where edges from corners at distance `from` to corners `length` less far in cross, in 1/256 of
/// the edge. Needs: length != 0 and of the sign of `from` where the answer matters.
inline Lanes crossings256(Lanes from, Lanes length) {
    const FloatLanes numerator = __builtin_convertvector(from, FloatLanes) * 256.0F;
    return __builtin_convertvector(numerator / __builtin_convertvector(length, FloatLanes) + 0.5F,
                                   Lanes);
}

/// The same for eight edges, with half way where both ends are at distance 0.
inline HalfLanes crossings256(HalfLanes from, HalfLanes to) {
    const HalfLanes length = from - to;
    const HalfLanes is_level = length == 0;
    const auto low = [](HalfLanes lanes) {
        return __builtin_convertvector(__builtin_shufflevector(lanes, lanes, 0, 1, 2, 3), Lanes);
    };
    const auto high = [](HalfLanes lanes) {
        return __builtin_convertvector(__builtin_shufflevector(lanes, lanes, 4, 5, 6, 7), Lanes);
    };
    const HalfLanes divisor = length - is_level;  // 1 instead of 0
    const HalfLanes at =
        narrowed(crossings256(low(from), low(divisor)), crossings256(high(from), high(divisor)));
    return is_level ? HalfLanes{} + static_cast<std::int16_t>(kUnitsPerVoxel / 2) : at;
}

/// sum / count for whole sums of at most 12 * 256 and counts of 1..12, rounded as (sum + count / 2)
/// / count, by multiplication: 65536 / count rounded up errs by less than 4096 / 65536 in all, and
/// whole numbers over 12 keep more than that from the next.
inline Lanes rounded_means(Lanes sums, std::int32_t count) {
    static constexpr std::array<std::int32_t, 13> kReciprocals = [] {
        std::array<std::int32_t, 13> reciprocals{};
        for (std::int32_t i = 1; i <= 12; ++i) {
            reciprocals[static_cast<std::size_t>(i)] = (65536 + i - 1) / i;
        }
        return reciprocals;
    }();
    return (sums + count / 2) * kReciprocals[static_cast<std::size_t>(count)] >> 16;
}

/// Needs: at least one crossing edge.
inline CellVertex cell_vertex(const CellCorners& c) {
    // Level edges: four along x, from columns 0 and 2 at the floor and at the ceiling, then four
    // along z, from columns 0 and 1.
    const auto starts = [](HalfLanes v) {
        return __builtin_shufflevector(v, v, 0, 2, 4, 6, 0, 1, 4, 5);
    };
    const auto ends = [](HalfLanes v) {
        return __builtin_shufflevector(v, v, 1, 3, 5, 7, 2, 3, 6, 7);
    };
    // Masks are -1, so what stands at the far side of a cell counts -256.
    constexpr std::int16_t kFar = -kUnitsPerVoxel;
    const HalfLanes level = starts(c.solid) ^ ends(c.solid);
    const HalfLanes at = crossings256(starts(c.distance), ends(c.distance)) & level;
    // Upright edges in lanes 0..3, and how high they cross in lanes 4..7.
    const HalfLanes crossed = crossed_upright(c);
    const HalfLanes upright =
        __builtin_shufflevector(crossed, crossed & c.crossing, 0, 1, 2, 3, 8, 9, 10, 11);
    const Lanes sums = sums_of(
        paired(at, HalfLanes{1, 1, 1, 1, 0, 0, 0, 0}) +
            paired(level, HalfLanes{0, 0, 0, 0, 0, kFar, 0, kFar}) +
            paired(upright, HalfLanes{0, kFar, 0, kFar, 0, 0, 0, 0}),
        paired(level, HalfLanes{0, 0, kFar, kFar, 0, 0, kFar, kFar}) +
            paired(upright, HalfLanes{0, 0, 0, 0, 1, 1, 1, 1}),
        paired(at, HalfLanes{0, 0, 0, 0, 1, 1, 1, 1}) +
            paired(level, HalfLanes{0, kFar, 0, kFar, 0, 0, 0, 0}) +
            paired(upright, HalfLanes{0, 0, kFar, kFar, 0, 0, 0, 0}),
        paired(level, HalfLanes{} - 1) + paired(upright, HalfLanes{-1, -1, -1, -1, 0, 0, 0, 0}));
    const Lanes means = rounded_means(sums, sums[3]);
    const Lanes most = Lanes{} + (kUnitsPerVoxel - 1);
    return {.offset256 = means < most ? means : most, .normal = normal_of(c.distance)};
}

/// x, y, z of a position in 1/256 voxel, each without what is above 16 bits: enough for distances
/// between vertices of neighbouring cells.
using PackedPosition = std::uint64_t;

inline PackedPosition packed_position(Lanes position) {
    const Lanes wrapped = position << 16 >> 16;
    using Pair = std::uint64_t __attribute__((vector_size(16)));
    return std::bit_cast<Pair>(narrowed(wrapped, wrapped))[0];
}

/// True if a to b is not longer than c to d; all less than 128 voxels apart.
inline bool is_first_shorter(PackedPosition a, PackedPosition b, PackedPosition c,
                             PackedPosition d) {
    using Pair = std::uint64_t __attribute__((vector_size(16)));
    using Wrapping = std::uint16_t __attribute__((vector_size(16)));
    const auto apart = std::bit_cast<HalfLanes>(std::bit_cast<Wrapping>(Pair{a, c}) -
                                                std::bit_cast<Wrapping>(Pair{b, d}));
    const Lanes squares = paired(apart, apart);
    return squares[0] + squares[1] <= squares[2] + squares[3];
}

}  // namespace terrane
