// How often one kind of event is told: what a client or a full disk repeats must not fill the log.
#pragma once

#include <atomic>
#include <chrono>

namespace terrane {

/// Any thread.
class NoticeLimit {
  public:
    using Clock = std::chrono::steady_clock;

    explicit NoticeLimit(Clock::duration interval) : interval_(interval) {}

    /// True the first time, and then at most once an interval.
    bool allows(Clock::time_point now = Clock::now()) {
        auto last = last_.load();
        const auto at = now.time_since_epoch().count();
        const bool due = last == kNever || at - last >= interval_.count();
        return due && last_.compare_exchange_strong(last, at);
    }

  private:
    static constexpr Clock::rep kNever = -1;

    const Clock::duration interval_;
    std::atomic<Clock::rep> last_ = kNever;
};

}  // namespace terrane
