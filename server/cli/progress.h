// How far a long command has come: a bar on a terminal, now and then a line elsewhere.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace terrane {

struct ProgressState {
    std::uint64_t done = 0;
    std::uint64_t total = 0;
    std::string_view unit;             ///< "stacks"
    std::optional<double> per_second;  ///< nothing yet, or standing still: nothing
};

/// "0:07", "12:34" or "3:04:05"; "-" for nothing or more than 99 hours.
std::string format_duration(std::optional<double> seconds);

/// "[######--------------]  30 %  1234/4096 stacks  56.7/s  ETA 0:51"
std::string progress_bar(const ProgressState& state);

/// "1234 of 4096 stacks (30 %), 56.7/s, ETA 0:51"
std::string progress_line(const ProgressState& state);

/// One thread. Draws on `out` itself; nothing else should write there until `finish`.
class Progress {
  public:
    using Clock = std::chrono::steady_clock;

    /// Of `total` things called `unit`, which must outlive it.
    Progress(std::uint64_t total, std::string_view unit, std::FILE* out, bool is_terminal);

    /// Draws if it is time to: often on a terminal, every 10 s elsewhere.
    void show(std::uint64_t done, Clock::time_point now = Clock::now());
    /// Clears the bar.
    void finish();

  private:
    struct Sample {
        Clock::time_point time;
        std::uint64_t done = 0;
    };

    const std::uint64_t total_;
    const std::string_view unit_;
    std::FILE* const out_;
    const bool is_terminal_;
    bool drawn_ = false;
    Clock::time_point next_;
    std::deque<Sample> samples_;  ///< of the last 20 s, at most two a second
};

/// Progress on the standard error stream, of work that tells its total as it goes.
class ShownProgress {
  public:
    explicit ShownProgress(std::string_view unit) : unit_(unit) {}

    /// To be called by one thread at a time, and not after `finish`.
    std::function<void(std::uint64_t done, std::uint64_t total)> teller();
    void finish();

  private:
    const std::string_view unit_;
    std::optional<Progress> progress_;
};

}  // namespace terrane
