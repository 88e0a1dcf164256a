// Who may connect: counts connections over all ports, in all and per address.
#pragma once

#include "protocol/base/mutex.h"

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <string>
#include <unordered_map>

namespace terrane {

/// Any thread.
class Admission {
  public:
    using Clock = std::chrono::steady_clock;

    Admission(std::size_t sessions_max, std::size_t per_address_max)
        : sessions_max_(sessions_max), per_address_max_(per_address_max) {}

    /// False at a limit; else `leave` follows some day.
    bool enter(const std::string& address);
    void leave(const std::string& address);
    std::size_t sessions() const;
    /// True if nobody is left before `deadline`.
    bool wait_until_empty(Clock::time_point deadline);

  private:
    const std::size_t sessions_max_;
    const std::size_t per_address_max_;
    mutable Mutex mutex_;
    std::condition_variable_any changed_;
    std::size_t sessions_ TERRANE_GUARDED_BY(mutex_) = 0;
    std::unordered_map<std::string, std::size_t> by_address_ TERRANE_GUARDED_BY(mutex_);
};

}  // namespace terrane
