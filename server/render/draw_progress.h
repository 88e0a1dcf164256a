// How far a drawing has come, told by the threads that draw.
#pragma once

#include "protocol/base/mutex.h"

#include <cstdint>
#include <functional>
#include <utility>

namespace terrane {

/// Called after each part, from whichever thread drew it, by one at a time.
using TellDrawn = std::function<void(std::uint64_t done, std::uint64_t total)>;

/// Counts the parts of one drawing. Any thread.
class DrawProgress {
  public:
    /// `tell` may be empty.
    DrawProgress(std::uint64_t total, TellDrawn tell) : total_(total), tell_(std::move(tell)) {}

    void add_one() {
        if (tell_) {
            const MutexLock lock(mutex_);
            tell_(++done_, total_);
        }
    }

  private:
    const std::uint64_t total_;
    const TellDrawn tell_;
    Mutex mutex_;
    std::uint64_t done_ TERRANE_GUARDED_BY(mutex_) = 0;
};

}  // namespace terrane
