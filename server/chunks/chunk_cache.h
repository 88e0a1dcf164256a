// The two caches of the service: encoded answers for everybody, and the last few stacks for
// workers.
#pragma once

#include "generator/volume/stack.h"
#include "server/chunks/answer.h"
#include "server/chunks/chunk_key.h"
#include "server/chunks/lru.h"

#include <cstddef>
#include <memory>

namespace terrane {

/// Encoded chunks and files. Sixteen shards: with ten times fewer threads than that, two seldom
/// meet.
using ChunkCache = ShardedLru<WorkKey, EncodedChunk, KeyHash, 16>;
/// Stacks, so that the heights of one stack are cut from one generation. Few, large values: four
/// shards.
using StackCache = ShardedLru<StackPos, Stack, KeyHash, 4>;

inline std::size_t memory_bytes(const EncodedChunk& chunk) {
    return sizeof(EncodedChunk) + chunk.payload_bytes();
}

inline std::size_t memory_bytes(const Stack& stack) {
    return sizeof(Stack) + stack.columns.offsets.size() * sizeof(std::uint32_t) +
           stack.columns.limits.size() * sizeof(Limit) +
           stack.palette.size() * sizeof(PaletteEntry);
}

}  // namespace terrane
