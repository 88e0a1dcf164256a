#include "generator/mesh/steep_normals.h"

#include "generator/mesh/kernels/mesh_kernels.h"
#include "generator/mesh/solid_mask.h"
#include "generator/volume/limit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>

namespace terrane {
namespace {

/// How four columns in a row count: in a mean over them, and in the difference along them.
struct Weights {
    std::array<std::int32_t, 4> mean;
    std::array<std::int32_t, 4> difference;
};

/// Of a plain slope both give the same.
constexpr Weights kInside = {.mean = {1, 3, 3, 1}, .difference = {-1, -1, 1, 1}};
constexpr Weights kAcrossSide = {.mean = {0, 4, 4, 0}, .difference = {0, -4, 4, 0}};

const Weights& weights_at(std::size_t place, std::size_t width) {
    return place == 0 || place == width - 2 ? kAcrossSide : kInside;
}

/// To the nearest end, up to kDistanceMax256; positive in the solid.
std::int32_t signed_distance(const SolidColumns& columns, std::size_t column, std::int32_t y256) {
    if (y256 >= columns.simple_from256[column]) {
        return std::clamp(columns.top256[column] - y256, -kDistanceMax256, kDistanceMax256);
    }
    std::int32_t nearest = kDistanceMax256;
    bool is_solid = true;
    for (std::size_t plane = 0; plane < columns.plane_count; ++plane) {
        const std::int32_t end256 = columns.plane256(plane)[column];
        nearest = std::min(nearest, std::abs(end256 - y256));
        if (end256 >= y256) {
            break;
        }
        is_solid = !is_solid;
    }
    return is_solid ? nearest : -nearest;
}

}  // namespace

bool is_steep(const CellResults& results, std::size_t i) {
    const auto solid = static_cast<unsigned>(results.solid[i]);
    const unsigned along_x = (solid ^ solid >> 1U) & 0x55U;
    const unsigned along_z = (solid ^ solid >> 2U) & 0x33U;
    const unsigned corners = along_x | along_x << 1U | along_z | along_z << 2U;
    unsigned far = 0;
    for (unsigned corner = 0; corner < 8; ++corner) {
        const std::int32_t distance = results.distance256[corner][i];
        const bool is_far = distance >= kDistanceMax256 || distance <= -kDistanceMax256;
        far |= (is_far ? 1U : 0U) << corner;
    }
    return (corners & far) != 0;
}

void smooth_steep_normal(CellResults& results, std::size_t i, const SolidColumns& columns,
                         std::size_t x, std::size_t z, std::int32_t floor256) {
    const Weights& along_x = weights_at(x, columns.width);
    const Weights& along_z = weights_at(z, columns.width);
    // The distance grows into the solid, so the normal is against its gradient.
    std::int32_t slope_x = 0;
    std::int32_t slope_y = 0;
    std::int32_t slope_z = 0;
    for (std::size_t row = 0; row < 4; ++row) {
        for (std::size_t step = 0; step < 4; ++step) {
            const std::int32_t mean = along_x.mean[step] * along_z.mean[row];
            if (mean == 0) {
                continue;
            }
            const std::size_t column = (z + row - 1) * columns.width + x + step - 1;
            const std::int32_t low = signed_distance(columns, column, floor256);
            const std::int32_t high = signed_distance(columns, column, floor256 + kUnitsPerVoxel);
            slope_x += (low + high) * along_x.difference[step] * along_z.mean[row];
            slope_z += (low + high) * along_z.difference[row] * along_x.mean[step];
            slope_y += (high - low) * mean;
        }
    }
    const auto down_x = static_cast<float>(-slope_x);
    const auto down_y = static_cast<float>(-slope_y);
    const auto down_z = static_cast<float>(-slope_z);
    const float length = std::sqrt(down_x * down_x + down_y * down_y + down_z * down_z);
    if (length > 0) {
        results.normal[0][i] = down_x / length;
        results.normal[1][i] = down_y / length;
        results.normal[2][i] = down_z / length;
    }
}

}  // namespace terrane
