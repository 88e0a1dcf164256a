// Chunks and stacks as bytes. The layout, byte by byte, is in CHUNK_FORMAT.md.
//
// Threads: every free function from any thread; nothing is shared. Built without exceptions in
// mind: every decoding error is a Result.
#pragma once

#include "generator/volume/chunk.h"
#include "generator/volume/column_encoder.h"
#include "generator/volume/stack.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace terrane {

inline constexpr std::uint8_t kChunkFormatVersion = 2;

/// The flow is a plane of its own and may be left out; it then decodes as 0.
enum class FlowPlane : std::uint8_t { with, without };

// Sanity limits of the decoder, checked before anything is allocated.
inline constexpr std::size_t kPaletteEntriesMax = 65536;
inline constexpr std::size_t kLimitsMax = std::size_t{1} << 24U;
/// No encoding of less than a byte for 32 limits is accepted (or made: the encoder pads), so that a
/// small payload can't ask for much memory.
inline constexpr std::size_t kLimitsPerByteMax = 32;

/// Encodes record after record without allocating anything but what `out` grows. One thread's; its
/// contents never change results.
class ChunkEncoder {
  public:
    /// As encode_chunk and encode_stack, below.
    void encode(Bytes& out, const Chunk& chunk, FlowPlane flow = FlowPlane::with);
    void encode(Bytes& out, const Stack& stack);

  private:
    ColumnEncoder columns_;
};

/// `out` is overwritten. The bytes are a pure function of the chunk; with the flow they are what
/// `terrane verify` hashes, and they are what COLUMNS payloads carry (before zstd). Needs what
/// cut_chunk gives: columns 0..N-1 (none if uniform), palette positions in range, ascending stack
/// ids, limits of ascending or equal heights in every column.
void encode_chunk(Bytes& out, const Chunk& chunk, FlowPlane flow = FlowPlane::with);

/// Every length and id is checked, and all that readers of a chunk rely on: each column has a limit
/// and heights that do not fall, each composition 1 to 6 materials below `materials_max` (1..256,
/// the world's number). Fails with `malformed`, `too_large` or `version_mismatch`.
Result<Chunk> decode_chunk(std::span<const std::byte> bytes,
                           std::size_t materials_max = kMaterialsMax);

/// A whole stack with its apron (columns -1..N), flow included, for the store.
void encode_stack(Bytes& out, const Stack& stack);

/// The same; further, columns begin at 0, the palette is layers, one void, elements, and
/// highest_y256 is what it says.
Result<Stack> decode_stack(std::span<const std::byte> bytes,
                           std::size_t materials_max = kMaterialsMax);

}  // namespace terrane
