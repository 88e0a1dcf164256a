// A chunk: N x M x N voxels as limits, cut out of a stack.
//
// A chunk column has the last limit at or below the chunk's floor, all limits inside, and the first
// at or above its ceiling, so that interpolation gives the same values in every chunk. A chunk that
// is one composition throughout is `uniform` and has no columns.
#pragma once

#include "generator/volume/cut_columns.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/world/composition.h"
#include "protocol/base/coords.h"

#include <cstdint>
#include <vector>

namespace terrane {

struct Chunk {
    ChunkPos position;
    std::int32_t side = 0;    ///< N
    std::int32_t height = 0;  ///< M
    bool uniform = false;
    PaletteEntry uniform_content;  ///< meaningful if `uniform`; flow is 0 then
    ColumnGrid columns;            ///< columns 0..N-1; empty if `uniform`
    /// The stack's palette entries that the chunk's limits use, in ascending stack id; limits hold
    /// positions in this list.
    Palette palette;
    std::vector<std::uint16_t> stack_palette_ids;  ///< id in the stack of each palette entry

    friend bool operator==(const Chunk&, const Chunk&) = default;
};

/// Cuts chunk after chunk without allocating anything but what they grow. One thread's; its
/// contents never change results.
class ChunkCutter {
  public:
    /// As cut_chunk, below.
    void cut(Chunk& out, const Stack& stack, std::int32_t y, std::int32_t height);

  private:
    ColumnCutter columns_;
    std::vector<ChunkLimits> cut_;
    std::vector<std::uint16_t> local_ids_;
};

/// Cuts the chunk at height `y` (in chunk heights, any int32) out of `stack`. `out` is overwritten;
/// its buffers are reused. Below the ground (y < 0) the chunk is uniform base. Thread: any, `out`
/// being the caller's own. At levels above 0 a chunk is its stack's whole columns, whatever their
/// height, and `y` must be 0.
void cut_chunk(Chunk& out, const Stack& stack, std::int32_t y, std::int32_t height);

}  // namespace terrane
