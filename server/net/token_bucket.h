// A rate, kept on average: what is spent comes back with time, up to a quarter of a second's worth
// or what one step may take. One step may overdraw, and is then waited for.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace terrane {

/// One thread; the time is given.
class TokenBucket {
  public:
    using Clock = std::chrono::steady_clock;

    TokenBucket() = default;

    /// `per_second` 0: no cap. Starts full.
    TokenBucket(double per_second, double burst, Clock::time_point now)
        : per_second_(per_second), burst_(burst), level_(burst), now_(now) {}

    /// From now on another rate; what was overdrawn stays so.
    void set(double per_second, double burst) {
        level_ = per_second_ > 0 ? std::min(level_, burst) : burst;
        per_second_ = per_second;
        burst_ = burst;
    }

    void refill(Clock::time_point now) {
        if (now > now_) {
            const std::chrono::duration<double> passed = now - now_;
            level_ = std::min(burst_, level_ + passed.count() * per_second_);
            now_ = now;
        }
    }

    /// Whether something may be spent while `reserved` more is spoken for.
    bool has(double reserved = 0) const { return per_second_ <= 0 || level_ > reserved; }

    void take(double amount) {
        if (per_second_ > 0) {
            level_ -= amount;
        }
    }

    /// When `has()` will be true, at the latest.
    Clock::time_point ready_at() const {
        if (has()) {
            return now_;
        }
        const std::chrono::duration<double> wait((1e-3 - level_) / per_second_);
        return now_ + std::chrono::duration_cast<Clock::duration>(wait) + Clock::duration{1};
    }

  private:
    double per_second_ = 0;
    double burst_ = 0;
    double level_ = 0;
    Clock::time_point now_;
};

}  // namespace terrane
