// The vertices of surface-nets cells: where the surface is in each and which way it faces; a lane a
// cell. No function of another header may be inlined here, see row_kernels.cpp.
//
// Source: S. F. Gibson, "Constrained elastic surface nets", 1998: the vertex is the mean of the
// crossings of the cell's twelve edges. An upright edge crosses where its column ends; a level one
// where the distances to the ends of its two columns say.
#include "generator/mesh/kernels/mesh_kernels.h"

namespace terrane::TERRANE_KERNEL_SET {
namespace {

constexpr std::int32_t kUnits = kCellUnits;

std::int32_t clamped_size(std::int32_t distance) {
    const std::int32_t size = distance < 0 ? -distance : distance;
    return size < kCellDistanceMax256 ? size : kCellDistanceMax256;
}

/// The corners of a block of cells.
struct Corners {
    std::int32_t distance[8][kCellBlock];
    std::int32_t outside[8][kCellBlock];  ///< 1 or 0
    /// By column: its lowest end that is not below the floor; those below are the largest without a
    /// sign.
    std::uint32_t crossing[4][kCellBlock];
};

void find_corners(Corners& out, const std::int32_t* ends256, std::int32_t planes) {
    for (std::int32_t column = 0; column < 4; ++column) {
        std::int32_t* __restrict const low = out.distance[column];
        std::int32_t* __restrict const high = out.distance[column + 4];
        std::int32_t* __restrict const low_outside = out.outside[column];
        std::int32_t* __restrict const high_outside = out.outside[column + 4];
        std::uint32_t* __restrict const crossing = out.crossing[column];
        const std::int32_t* __restrict end = ends256 + column * kCellBatch;
        for (std::int32_t i = 0; i < kCellBlock; ++i) {
            low[i] = clamped_size(end[i]);
            high[i] = clamped_size(end[i] - kUnits);
            low_outside[i] = end[i] < 0 ? 1 : 0;
            high_outside[i] = end[i] < kUnits ? 1 : 0;
            crossing[i] = static_cast<std::uint32_t>(end[i]);
        }
        // Every further end under a corner turns it over.
        for (std::int32_t plane = 1; plane < planes; ++plane) {
            end += 4 * kCellBatch;
            for (std::int32_t i = 0; i < kCellBlock; ++i) {
                const std::int32_t to_low = clamped_size(end[i]);
                const std::int32_t to_high = clamped_size(end[i] - kUnits);
                const auto above = static_cast<std::uint32_t>(end[i]);
                low[i] = to_low < low[i] ? to_low : low[i];
                high[i] = to_high < high[i] ? to_high : high[i];
                low_outside[i] ^= end[i] < 0 ? 1 : 0;
                high_outside[i] ^= end[i] < kUnits ? 1 : 0;
                crossing[i] = above < crossing[i] ? above : crossing[i];
            }
        }
        for (std::int32_t i = 0; i < kCellBlock; ++i) {
            low[i] = low_outside[i] != 0 ? -low[i] : low[i];
            high[i] = high_outside[i] != 0 ? -high[i] : high[i];
        }
    }
}

/// Where an edge crosses, in 1/256 of it, from the distances at its ends: half way if both are 0. 0
/// if it does not cross.
std::int32_t crossing256(std::int32_t from, std::int32_t to, std::int32_t crosses) {
    const std::int32_t length = from - to;
    const bool is_slanted = crosses != 0 && length != 0;
    const std::int32_t divisor = is_slanted ? length : 2;
    const std::int32_t dividend = is_slanted ? from : 1;
    const float at = static_cast<float>(dividend) * 256.0F / static_cast<float>(divisor) + 0.5F;
    return crosses != 0 ? static_cast<std::int32_t>(at) : 0;
}

/// sum / count, rounded to nearest; exact, for sums are far below 2^24.
std::int32_t rounded_mean(std::int32_t sum, std::int32_t count) {
    const float mean = static_cast<float>(sum + (count >> 1)) / static_cast<float>(count);
    const auto whole = static_cast<std::int32_t>(mean);
    return whole < kUnits - 1 ? whole : kUnits - 1;
}

void find_vertices(CellResults& out, const Corners& corners, std::int32_t first) {
    const auto& d = corners.distance;
    const auto& o = corners.outside;
    for (std::int32_t i = 0; i < kCellBlock; ++i) {
        const std::int32_t up0 = o[0][i] ^ o[4][i];
        const std::int32_t up1 = o[1][i] ^ o[5][i];
        const std::int32_t up2 = o[2][i] ^ o[6][i];
        const std::int32_t up3 = o[3][i] ^ o[7][i];
        const std::int32_t low_x0 = o[0][i] ^ o[1][i];  // level edges along x and z
        const std::int32_t low_x2 = o[2][i] ^ o[3][i];
        const std::int32_t low_z0 = o[0][i] ^ o[2][i];
        const std::int32_t low_z1 = o[1][i] ^ o[3][i];
        const std::int32_t high_x0 = o[4][i] ^ o[5][i];
        const std::int32_t high_x2 = o[6][i] ^ o[7][i];
        const std::int32_t high_z0 = o[4][i] ^ o[6][i];
        const std::int32_t high_z1 = o[5][i] ^ o[7][i];
        // Crossings on the far sides of the cell count a whole voxel along that axis.
        const std::int32_t far_x = (up1 + up3) + (low_z1 + high_z1);
        const std::int32_t far_y = (high_x0 + high_x2) + (high_z0 + high_z1);
        const std::int32_t far_z = (up2 + up3) + (low_x2 + high_x2);
        const std::int32_t crossed =
            far_y + ((up0 + up1) + (up2 + up3)) + ((low_x0 + low_x2) + (low_z0 + low_z1));
        const std::int32_t count = crossed > 0 ? crossed : 1;
        const std::int32_t x = kUnits * far_x + crossing256(d[0][i], d[1][i], low_x0) +
                               crossing256(d[2][i], d[3][i], low_x2) +
                               crossing256(d[4][i], d[5][i], high_x0) +
                               crossing256(d[6][i], d[7][i], high_x2);
        const std::int32_t z = kUnits * far_z + crossing256(d[0][i], d[2][i], low_z0) +
                               crossing256(d[1][i], d[3][i], low_z1) +
                               crossing256(d[4][i], d[6][i], high_z0) +
                               crossing256(d[5][i], d[7][i], high_z1);
        const std::int32_t y = kUnits * far_y +
                               (up0 != 0 ? static_cast<std::int32_t>(corners.crossing[0][i]) : 0) +
                               (up1 != 0 ? static_cast<std::int32_t>(corners.crossing[1][i]) : 0) +
                               (up2 != 0 ? static_cast<std::int32_t>(corners.crossing[2][i]) : 0) +
                               (up3 != 0 ? static_cast<std::int32_t>(corners.crossing[3][i]) : 0);
        out.offset256[0][first + i] = rounded_mean(x, count);
        out.offset256[1][first + i] = rounded_mean(y, count);
        out.offset256[2][first + i] = rounded_mean(z, count);
        const std::int32_t from_2 = up2 != 0 ? 2 : up3 != 0 ? 3 : 4;
        const std::int32_t from_1 = up1 != 0 ? 1 : from_2;
        out.first_upright[first + i] = up0 != 0 ? 0 : from_1;
    }
}

void find_normals(CellResults& out, const Corners& corners, std::int32_t first) {
    const auto& d = corners.distance;
    for (std::int32_t i = 0; i < kCellBlock; ++i) {
        // Against the gradient of the distance, which grows into the solid; up where there is none.
        const std::int32_t low_even = d[0][i] + d[2][i];
        const std::int32_t low_odd = d[1][i] + d[3][i];
        const std::int32_t high_even = d[4][i] + d[6][i];
        const std::int32_t high_odd = d[5][i] + d[7][i];
        const std::int32_t near_z = (d[0][i] + d[1][i]) + (d[4][i] + d[5][i]);
        const std::int32_t far_z = (d[2][i] + d[3][i]) + (d[6][i] + d[7][i]);
        const std::int32_t x = (low_even + high_even) - (low_odd + high_odd);
        const std::int32_t y = (low_even + low_odd) - (high_even + high_odd);
        const std::int32_t z = near_z - far_z;
        const std::int32_t squares = x * x + y * y + z * z;
        const std::int32_t square = squares == 0 ? 1 : squares;
        const std::int32_t rise = squares == 0 ? 1 : y;
        const float inverse = 1.0F / __builtin_sqrtf(static_cast<float>(square));
        out.normal[0][first + i] = static_cast<float>(x) * inverse;
        out.normal[1][first + i] = static_cast<float>(rise) * inverse;
        out.normal[2][first + i] = static_cast<float>(z) * inverse;
    }
}

void copy_corners(CellResults& out, const Corners& corners, std::int32_t first) {
    for (std::int32_t corner = 0; corner < 8; ++corner) {
        for (std::int32_t i = 0; i < kCellBlock; ++i) {
            out.distance256[corner][first + i] = corners.distance[corner][i];
        }
    }
    const auto& o = corners.outside;
    for (std::int32_t i = 0; i < kCellBlock; ++i) {
        const std::int32_t outside = o[0][i] | o[1][i] << 1 | o[2][i] << 2 | o[3][i] << 3 |
                                     o[4][i] << 4 | o[5][i] << 5 | o[6][i] << 6 | o[7][i] << 7;
        out.solid[first + i] = outside ^ 255;
    }
}

void cell_vertices(CellResults& out, const std::int32_t* ends256, std::int32_t planes,
                   std::int32_t count) {
    for (std::int32_t first = 0; first < count; first += kCellBlock) {
        Corners corners;
        find_corners(corners, ends256 + first, planes);
        find_vertices(out, corners, first);
        find_normals(out, corners, first);
        copy_corners(out, corners, first);
    }
}

}  // namespace

extern const MeshKernels kMeshKernels;
const MeshKernels kMeshKernels = {.cell_vertices = cell_vertices};

}  // namespace terrane::TERRANE_KERNEL_SET
