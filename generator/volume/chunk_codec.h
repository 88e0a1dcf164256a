// Chunks and stacks as bytes. The layout, byte by byte, is in CHUNK_FORMAT.md.
#pragma once

#include <cstdint>
#include <span>

#include "generator/volume/chunk.h"
#include "generator/volume/stack.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

namespace terrane {

/// Appends nothing to what was there: `out` is overwritten. The bytes are a pure function of the
/// chunk; they are what `terrane verify` hashes and what COLUMNS payloads carry (before zstd).
void encode_chunk(Bytes& out, const Chunk& chunk);

/// Every length and id is checked; fails with `malformed`, `too_large` or `version_mismatch`.
Result<Chunk> decode_chunk(std::span<const std::byte> bytes);

/// A whole stack with its apron, for the store.
void encode_stack(Bytes& out, const Stack& stack);
Result<Stack> decode_stack(std::span<const std::byte> bytes);

}  // namespace terrane
