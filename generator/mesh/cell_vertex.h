// The vertex of one surface-nets cell: where its surface is and which way it faces.
//
// Source: S. F. Gibson, "Constrained elastic surface nets", 1998: the vertex is the mean of the
// crossings of the cell's twelve edges. Four lanes stand for the cell's four columns in the order
// (x, z), (x+1, z), (x, z+1), (x+1, z+1); the vectors are the compilers' own, so the same code and
// the same bits come out on every machine.
#pragma once

#include "generator/mesh/solid_mask.h"

#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace terrane {

using Lanes = std::int32_t __attribute__((vector_size(16)));
using FloatLanes = float __attribute__((vector_size(16)));

/// A cell's eight corners. Masks are -1 for yes and 0 for no.
struct CellCorners {
    Lanes low{};         ///< signed vertical distance to the nearest end at the floor, clamped
    Lanes high{};        ///< the same at the ceiling
    Lanes solid_low{};   ///< mask
    Lanes solid_high{};  ///< mask
    Lanes crossing{};    ///< height above the floor where the column's own edge crosses, if it does
};

/// Offsets are 0..255 from the cell's least corner, in 1/256 voxel.
struct CellVertex {
    glm::i32vec3 offset256{};
    glm::vec3 normal{};
};

inline Lanes clamped_distance(Lanes distance) {
    const Lanes most = Lanes{} + kDistanceMax256;
    const Lanes clamped = distance < most ? distance : most;
    return clamped > -most ? clamped : -most;
}

/// Bit i is set where lane i of a mask is.
inline unsigned bits_of(Lanes mask) {
    return static_cast<unsigned>((mask[0] & 1) | (mask[1] & 2) | (mask[2] & 4) | (mask[3] & 8));
}

/// Corners of a cell whose columns are solid below their tops, seen from its floor at y256 = 0.
inline CellCorners corners_below_tops(Lanes top256) {
    return {.low = clamped_distance(top256),
            .high = clamped_distance(top256 - kUnitsPerVoxel),
            .solid_low = top256 >= 0,
            .solid_high = top256 >= kUnitsPerVoxel,
            .crossing = top256};
}

inline glm::vec3 unit_normal(std::int32_t x, std::int32_t y, std::int32_t z) {
    const std::int32_t square = x * x + y * y + z * z;  // at most 3 * (8 * 1024)^2
    if (square == 0) {
        return {0.0F, 1.0F, 0.0F};
    }
    const float scale = 1.0F / std::sqrt(static_cast<float>(square));
    return {static_cast<float>(x) * scale, static_cast<float>(y) * scale,
            static_cast<float>(z) * scale};
}

/// Against the gradient of the distance, which grows into the solid.
inline glm::vec3 normal_of(Lanes low, Lanes high) {
    const Lanes sum = low + high;
    const Lanes fall = low - high;
    return unit_normal(sum[0] - sum[1] + sum[2] - sum[3], fall[0] + fall[1] + fall[2] + fall[3],
                       sum[0] + sum[1] - sum[2] - sum[3]);
}

/// Where the edges from corners at distance `from` to corners at distance `to` cross, in 1/256 of
/// the edge; 0 where `crosses` is not set. Half way if both ends are 0.
inline Lanes crossings256(Lanes from, Lanes to, Lanes crosses) {
    const Lanes length = from - to;
    const Lanes usable = crosses & (length != 0);
    const FloatLanes numerator = __builtin_convertvector(from & usable, FloatLanes);
    const FloatLanes denominator =
        __builtin_convertvector(usable ? length : Lanes{} + 1, FloatLanes);
    const Lanes at = __builtin_convertvector(numerator * 256.0F / denominator + 0.5F, Lanes);
    return (at & usable) | (Lanes{128, 128, 128, 128} & crosses & ~usable);
}

inline std::int32_t sum_of(Lanes lanes) {
    return (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
}

/// Needs: at least one crossing edge.
inline CellVertex cell_vertex(const CellCorners& c) {
    constexpr Lanes kOddAtFar = {0, kUnitsPerVoxel, 0, kUnitsPerVoxel};
    constexpr Lanes kLastAtFar = {0, 0, kUnitsPerVoxel, kUnitsPerVoxel};
    const Lanes upright = c.solid_low ^ c.solid_high;
    // Edges along x, two at the floor and two at the ceiling: columns 0 to 1 and 2 to 3; edges
    // along z: columns 0 to 2 and 1 to 3.
    const auto even = [](Lanes a, Lanes b) { return __builtin_shufflevector(a, b, 0, 2, 4, 6); };
    const auto odd = [](Lanes a, Lanes b) { return __builtin_shufflevector(a, b, 1, 3, 5, 7); };
    const auto first = [](Lanes a, Lanes b) { return __builtin_shufflevector(a, b, 0, 1, 4, 5); };
    const auto last = [](Lanes a, Lanes b) { return __builtin_shufflevector(a, b, 2, 3, 6, 7); };
    const Lanes along_x = even(c.solid_low, c.solid_high) ^ odd(c.solid_low, c.solid_high);
    const Lanes along_z = first(c.solid_low, c.solid_high) ^ last(c.solid_low, c.solid_high);
    const Lanes at_x = crossings256(even(c.low, c.high), odd(c.low, c.high), along_x);
    const Lanes at_z = crossings256(first(c.low, c.high), last(c.low, c.high), along_z);

    const std::int32_t x = sum_of((kOddAtFar & upright) + (kOddAtFar & along_z) + at_x);
    const std::int32_t y =
        sum_of((c.crossing & upright) + (kLastAtFar & along_x) + (kLastAtFar & along_z));
    const std::int32_t z = sum_of((kLastAtFar & upright) + (kOddAtFar & along_x) + at_z);
    const std::int32_t count = -sum_of(upright + along_x + along_z);
    const auto mean = [count](std::int32_t sum) {
        return std::min((sum + count / 2) / count, kUnitsPerVoxel - 1);
    };
    return {.offset256 = {mean(x), mean(y), mean(z)}, .normal = normal_of(c.low, c.high)};
}

/// The same for a cell whose four upright edges all cross at tops, its floor solid and its ceiling
/// not: three vertices of four on open ground.
inline CellVertex flat_cell_vertex(Lanes top256) {
    return {.offset256 = {kUnitsPerVoxel / 2, (sum_of(top256) + 2) / 4, kUnitsPerVoxel / 2},
            .normal =
                unit_normal(2 * (top256[0] - top256[1] + top256[2] - top256[3]), 4 * kUnitsPerVoxel,
                            2 * (top256[0] + top256[1] - top256[2] - top256[3]))};
}

/// A cell's corners near caves, and the compositions that show where its upright edges cross.
struct CaveCell {
    CellCorners corners;
    std::array<std::uint16_t, 4> crossing_ids{};
};

/// Needs: `at`, the indices of the cell's columns in lane order.
CaveCell cave_cell(const SolidColumns& columns, const std::array<std::size_t, 4>& at,
                   std::int32_t floor256);

}  // namespace terrane
