// Generates an area ahead of time into a store, so that no client waits for it.
#pragma once

#include "generator/terrain/world.h"
#include "protocol/base/result.h"
#include "server/cli/rectangle_work.h"
#include "storage/chunk_store.h"

#include <cstddef>
#include <cstdint>
#include <functional>

namespace terrane {

struct Preseeded {
    std::uint64_t stacks_generated = 0;
    std::uint64_t stacks_present = 0;  ///< were in the store already
    bool whole = false;                ///< false if `tick` stopped it
};

/// Puts every stack that `store` lacks, a batch at a time, and flushes it at the end, also when it
/// was stopped. What was put stays, so the same call goes on where another ended. Fails as the
/// generator and the store do.
Result<Preseeded> preseed_area(const World& world, ChunkStore& store, const StackBatches& batches,
                               std::size_t workers, std::function<bool(std::uint64_t)> tick = {});

}  // namespace terrane
