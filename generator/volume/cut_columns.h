// Columns to the columns of chunks: all chunks over a square, in one pass over its limits.
//
// Neighbouring columns are cut between the same limits as a rule, so the search begins where the
// column before was cut.
#pragma once

#include "generator/volume/limit.h"
#include "generator/world/composition.h"

#include <cstdint>
#include <span>
#include <vector>

namespace terrane {

/// A chunk as limits, with the palette ids of what it was cut from.
struct ChunkLimits {
    bool uniform = false;
    std::uint16_t content_id = 0;  ///< if `uniform`: what it is throughout
    ColumnGrid columns;            ///< columns 0..N-1; empty if `uniform`
};

/// Chunks first_y <= y < first_y + count over the columns x0.. and z0.. of a grid.
struct ChunkSquare {
    std::int32_t x0 = 0;  ///< local to the grid
    std::int32_t z0 = 0;
    std::int32_t side = 0;     ///< N columns
    std::int32_t height = 0;   ///< M voxels
    std::int32_t first_y = 0;  ///< at least 0
    std::int32_t count = 1;
};

/// Cuts chunk after chunk without allocating anything but what its results grow. One thread's.
class ColumnCutter {
  public:
    /// Overwrites out[0..count), growing it but never shrinking it: their buffers are reused. The
    /// palette has one void. Limits as CHUNK_FORMAT.md has them: the last at or below a chunk's
    /// floor, those inside, and the first at or above its ceiling, or the void there.
    void cut(std::vector<ChunkLimits>& out, const ColumnGrid& columns, const Palette& palette,
             const ChunkSquare& square);

    /// One chunk while columns are cut.
    struct Place {
        Limit* base = nullptr;          ///< the chunk's first limit
        std::uint32_t* ends = nullptr;  ///< of its columns, from `base`; of those to come
        std::int64_t lo = 0;            ///< floor in 1/256 voxel
        std::int64_t hi = 0;            ///< ceiling
        std::uint32_t used = 0;         ///< limits so far
        std::uint32_t end = 0;          ///< of the column before: its first at or above the ceiling
    };

  private:
    std::vector<Place> places_;
};

/// Whether all limits show one content: equal compositions, whatever their ids.
bool is_uniform(std::span<const Limit> limits, const Palette& palette);

}  // namespace terrane
