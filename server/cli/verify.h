// One hash for an area, the same on every machine, for any number of workers and any order.
//
// The hash is the sum mod 2^128, over every chunk of the area, of XXH3-128(key || chunk): the key
// is lod, x, y, z as int32, little endian; the chunk is encode_chunk's bytes (CHUNK_FORMAT.md),
// before any compression. The chunks are all (x, z) of the rectangle at lod 0, and of each stack y
// from 0 up to the chunk that holds the world's height bound; uniform ones count like all others.
#pragma once

#include "generator/terrain/world.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "server/cli/rectangle_work.h"

#include <cstddef>
#include <cstdint>
#include <functional>

namespace terrane {

struct AreaHash {
    Hash128 hash;
    std::uint64_t chunks = 0;
    bool whole = false;  ///< false if `tick` stopped it: the hash is of no use then

    friend bool operator==(const AreaHash&, const AreaHash&) = default;
};

/// Chunks that are hashed in each stack of the world.
std::int32_t chunks_in_stack(const World& world);

/// Generates the area with `workers` threads; see BatchWorkers for `tick`. Fails as the generator
/// does.
Result<AreaHash> hash_area(const World& world, const StackBatches& batches, std::size_t workers,
                           std::function<bool(std::uint64_t)> tick = {});

}  // namespace terrane
