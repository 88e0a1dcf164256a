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

/// Beyond this distance from the nearest end all depths count alike: 4 voxels, in 1/256 voxel.
inline constexpr std::int32_t kDistanceMax256 = 4 * kUnitsPerVoxel;

/// Stands for an end above all heights, with room to add and subtract any height.
inline constexpr std::int32_t kEndlessly256 = 1 << 30;

/// A height where a column changes between solid and not, and the composition that shows there.
struct SolidEnd {
    std::int32_t y256 = 0;
    std::uint16_t palette_id = 0;

    friend bool operator==(const SolidEnd&, const SolidEnd&) = default;
};

/// The ends of all (N + 2) x (N + 2) columns of a stack, apron included, row by row (z slow, index
/// 0 is column (-1, -1)). A column's ends ascend strictly: the ground's top, then bottom and top of
/// every further interval. A height is solid iff an even number of ends lies below it, so a top is
/// solid and a bottom is not.
///
/// Plane i holds every column's end i, so that neighbouring columns are read together; there are as
/// many planes as the column of most ends has ends, and what a column lacks is kEndlessly256. Their
/// number is odd, and so is every column's own.
struct SolidColumns {
    std::size_t width = 0;  ///< N + 2
    std::size_t plane_count = 0;
    std::vector<std::int32_t> planes256;   ///< plane_count x width x width
    std::vector<std::uint16_t> plane_ids;  ///< what shows at each end
    std::vector<std::int32_t> top256;      ///< the highest end of each column
    std::vector<std::uint16_t> top_id;     ///< what shows there
    /// From this height up the nearest end within kDistanceMax256 can only be top256: far below
    /// everything for a column of one end.
    std::vector<std::int32_t> simple_from256;
    std::int32_t lowest256 = 0;      ///< the lowest end of all
    std::int32_t lowest_top256 = 0;  ///< the lowest of top256
    std::int32_t highest256 = 0;     ///< the highest end of all

    std::size_t column_count() const { return width * width; }

    const std::int32_t* plane256(std::size_t i) const {
        return planes256.data() + i * column_count();
    }

    /// End i of a column; {kEndlessly256} if it has fewer.
    SolidEnd end(std::size_t column, std::size_t i) const {
        const std::size_t at = i * column_count() + column;
        return {.y256 = planes256[at], .palette_id = plane_ids[at]};
    }

    /// The columns that have more than one end, and how many: column, count, column, count...
    std::vector<std::uint32_t> many;
    std::vector<SolidEnd> many_ends;  ///< their ends, one column behind the other

    /// Scratch of find_solid_columns.
    std::vector<std::uint8_t> is_hollow;       ///< by palette id: 1 for void and caves
    std::vector<std::uint32_t> hollow_limits;  ///< the limits that show such a thing
};

/// Overwrites `out`; allocates only while its buffers grow. Needs: columns of at least one limit.
void find_solid_columns(SolidColumns& out, const Stack& stack);

/// Overwrites `out` with one height a column: under it there is at least `roof256` of solid
/// overhead.
void find_covered(std::vector<std::int32_t>& out, const SolidColumns& columns,
                  std::int32_t roof256);

/// Bits of lattice points: bit b of word w of a column is point word_y[w] + b. Rows lie as
/// [z][word][x], so that a step along x is a step in memory.
struct SolidMask {
    std::vector<std::int32_t> word_y;  ///< voxels, ascending in steps of 64 or multiples of it
    std::size_t width = 0;
    std::vector<std::uint64_t> bits;

    std::size_t words() const { return word_y.size(); }

    const std::uint64_t* row(std::size_t z, std::size_t word) const {
        return bits.data() + (z * words() + word) * width;
    }

    /// True if the word after this one goes on where it ends.
    bool goes_on(std::size_t word) const {
        return word + 1 < words() && word_y[word + 1] == word_y[word] + 64;
    }
};

/// Overwrites all but `out.word_y`, which says what to fill; allocates only while it grows.
void fill_solid_mask(SolidMask& out, const SolidColumns& columns);

}  // namespace terrane
