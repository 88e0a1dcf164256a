// Solid or not: the first step from limits to a mesh.
//
// Every column of a stack becomes a list of solid intervals (bottom, top] in 1/256 voxel, and those
// a bit mask of solid lattice points: point y is solid iff bottom < y * 256 <= top. Layers and
// veins are solid, void and caves are not; neighbouring solid spans of different materials are one
// interval. Below its first limit a column is solid ground without end, so the world has no
// underside.
#pragma once

#include "generator/volume/stack.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {

/// The bottom of a column's lowest interval: minus infinity, with room to subtract heights from it.
inline constexpr std::int32_t kGroundBottom256 = -(1 << 30);

/// Beyond this distance from the nearest end all depths count alike: 4 voxels, in 1/256 voxel.
inline constexpr std::int32_t kDistanceMax256 = 4 * kUnitsPerVoxel;

/// Solid at bottom256 < y <= top256. The ids say which composition shows at either end.
struct SolidInterval {
    std::int32_t bottom256 = 0;
    std::int32_t top256 = 0;
    std::uint16_t bottom_id = 0;
    std::uint16_t top_id = 0;

    friend bool operator==(const SolidInterval&, const SolidInterval&) = default;
};

/// The intervals of all (N + 2) x (N + 2) columns of a stack, apron included, row by row (z slow,
/// index 0 is column (-1, -1)). What most columns need, their topmost interval, is also in plain
/// arrays.
struct SolidColumns {
    std::size_t width = 0;                 ///< N + 2
    std::vector<std::uint32_t> offsets;    ///< width * width + 1, into `intervals`
    std::vector<SolidInterval> intervals;  ///< ascending in each column, never empty
    std::vector<std::int32_t> top256;      ///< top of the highest interval
    std::vector<std::uint16_t> top_id;     ///< what shows there
    /// From this height up the nearest end within kDistanceMax256 can only be top256: the least
    /// value for a column of one interval.
    std::vector<std::int32_t> simple_from256;
    std::int32_t lowest256 = 0;   ///< the lowest end of all, the ground's bottom aside
    std::int32_t highest256 = 0;  ///< the highest end of all

    std::span<const SolidInterval> column(std::size_t index) const {
        return std::span(intervals).subspan(offsets[index], offsets[index + 1] - offsets[index]);
    }
};

/// Overwrites `out`; allocates only while its buffers grow. Needs: columns of at least one limit.
void find_solid_columns(SolidColumns& out, const Stack& stack);

/// Bits of lattice points: bit b of word w of a column is point y_first + 64 * w + b. Rows lie as
/// [z][word][x], so that a step along x is a step in memory. A column of `words` words is filled
/// whole, however few of the points are wanted.
struct SolidMask {
    std::int32_t y_first = 0;  ///< voxels
    std::size_t words = 0;
    std::size_t width = 0;
    std::vector<std::uint64_t> bits;

    const std::uint64_t* row(std::size_t z, std::size_t word) const {
        return bits.data() + (z * words + word) * width;
    }

    bool is_solid(std::size_t x, std::size_t z, std::int32_t y) const {
        const auto bit = static_cast<std::size_t>(y - y_first);
        return ((row(z, bit / 64)[x] >> (bit % 64)) & 1U) != 0;
    }
};

/// Overwrites `out` with the points [y_first, y_first + 64 * words); allocates only while it grows.
void fill_solid_mask(SolidMask& out, const SolidColumns& columns, std::int32_t y_first,
                     std::size_t words);

}  // namespace terrane
