// What the service counts, for tests, logs and metrics. Every counter only ever rises.
#pragma once

#include <atomic>
#include <cstdint>

namespace terrane {

using Counter = std::atomic<std::uint64_t>;

/// Read and raised from any thread; relaxed, so no order between two counters is promised.
struct ServiceCounters {
    Counter generations{0};     ///< stacks made
    Counter stack_hits{0};      ///< stacks found in memory
    Counter store_hits{0};      ///< records found in the store, stacks and meshes
    Counter store_corrupt{0};   ///< records that could not be read back: made anew
    Counter store_failures{0};  ///< reads or writes that the store refused: served all the same
    Counter cache_hits{0};      ///< answers given from the cache of encoded bytes
    Counter joins{0};           ///< requests that joined one already in flight
    Counter answers{0};         ///< answers made by workers
    Counter busy{0};            ///< requests refused at a limit
    Counter cancelled{0};       ///< pieces of work that nobody wanted any more
    Counter failed{0};          ///< pieces of work that ended in an error
    Counter credit_stalls{0};   ///< times that a view began to wait for its client's credit
};

inline void raise(Counter& counter) {
    counter.fetch_add(1, std::memory_order_relaxed);
}

inline std::uint64_t count_of(const Counter& counter) {
    return counter.load(std::memory_order_relaxed);
}

}  // namespace terrane
