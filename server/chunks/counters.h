// What the service counts, for tests, logs and metrics. Every counter only ever rises.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace terrane {

using Counter = std::atomic<std::uint64_t>;

/// How requests of one kind ended. Store and generated: made by a worker, without or with
/// generating anything.
struct OutcomeCounters {
    Counter cache{0};  ///< answers given from the cache of encoded bytes
    Counter store{0};
    Counter generated{0};
    Counter busy{0};       ///< refused at a limit
    Counter cancelled{0};  ///< pieces of work that nobody wanted any more
    Counter failed{0};     ///< pieces of work that ended in an error
};

/// In the order of WorkKey's alternatives.
inline constexpr std::array<std::string_view, 5> kRequestKinds = {"chunk", "column", "tile", "map",
                                                                  "section"};

/// Read and raised from any thread; relaxed, so no order between two counters is promised.
struct ServiceCounters {
    Counter generations{0};     ///< stacks made
    Counter stack_hits{0};      ///< stacks found in memory
    Counter store_hits{0};      ///< records found in the store, stacks and meshes
    Counter store_corrupt{0};   ///< records that could not be read back: made anew
    Counter store_failures{0};  ///< reads or writes that the store refused: served all the same
    Counter joins{0};           ///< requests that joined one already in flight
    Counter answers{0};         ///< answers made by workers
    Counter undelivered{0};     ///< answers that could not be handed on for want of memory
    Counter limited{0};         ///< native requests refused at a session's rate, unread
    Counter credit_stalls{0};   ///< times that a view began to wait for its client's credit
    std::array<OutcomeCounters, kRequestKinds.size()> outcomes;  ///< by kind
};

inline void raise(Counter& counter) {
    counter.fetch_add(1, std::memory_order_relaxed);
}

inline std::uint64_t count_of(const Counter& counter) {
    return counter.load(std::memory_order_relaxed);
}

/// Of all kinds together.
inline std::uint64_t count_of(const ServiceCounters& counters, Counter OutcomeCounters::* outcome) {
    std::uint64_t sum = 0;
    for (const OutcomeCounters& kind : counters.outcomes) {
        sum += count_of(kind.*outcome);
    }
    return sum;
}

}  // namespace terrane
