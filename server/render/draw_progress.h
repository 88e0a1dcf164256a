// How far a drawing has come, told by the threads that draw.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <utility>

namespace terrane {

/// Called as parts are done, from whichever thread drew one, by one at a time; while it runs others
/// are counted and not told of.
using TellDrawn = std::function<void(std::uint64_t done, std::uint64_t total)>;

/// Counts the parts of one drawing. Any thread.
class DrawProgress {
  public:
    /// `tell` may be empty.
    DrawProgress(std::uint64_t total, TellDrawn tell) : total_(total), tell_(std::move(tell)) {}

    void add_one() {
        const std::uint64_t done = ++done_;
        if (tell_ && !telling_.test_and_set(std::memory_order_acquire)) {
            tell_(done, total_);
            telling_.clear(std::memory_order_release);
        }
    }

  private:
    const std::uint64_t total_;
    const TellDrawn tell_;
    std::atomic<std::uint64_t> done_ = 0;
    std::atomic_flag telling_;
};

}  // namespace terrane
