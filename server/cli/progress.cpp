#include "server/cli/progress.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace terrane {
namespace {

using namespace std::chrono_literals;

constexpr auto kBarInterval = 200ms;
constexpr auto kLineInterval = 10s;
constexpr auto kSampleInterval = 500ms;
constexpr auto kRateWindow = 20s;
constexpr std::uint64_t kBarCells = 20;
constexpr std::string_view kClearLine = "\r\x1b[K";
constexpr double kDurationMaxSeconds = 99.0 * 3600;

std::string decimal(double value, const char* format) {
    char text[64];
    const int size = std::snprintf(text, sizeof(text), format, value);
    return {text, static_cast<std::size_t>(std::clamp(size, 0, 63))};
}

std::uint64_t share_of(const ProgressState& state, std::uint64_t whole) {
    return state.total == 0 ? whole : std::min(state.done, state.total) * whole / state.total;
}

std::string rate_of(const ProgressState& state) {
    return state.per_second ? decimal(*state.per_second, "%.1f/s") : "-/s";
}

std::string eta_of(const ProgressState& state) {
    if (!state.per_second || *state.per_second <= 0) {
        return format_duration(std::nullopt);
    }
    return format_duration(static_cast<double>(state.total - std::min(state.done, state.total)) /
                           *state.per_second);
}

}  // namespace

std::string format_duration(std::optional<double> seconds) {
    if (!seconds || !(*seconds >= 0) || *seconds > kDurationMaxSeconds) {
        return "-";
    }
    const auto whole = static_cast<int>(*seconds);
    char text[32];
    if (whole >= 3600) {
        std::snprintf(text, sizeof(text), "%d:%02d:%02d", whole / 3600, whole / 60 % 60,
                      whole % 60);
    } else {
        std::snprintf(text, sizeof(text), "%d:%02d", whole / 60, whole % 60);
    }
    return text;
}

std::string progress_bar(const ProgressState& state) {
    const std::uint64_t cells = share_of(state, kBarCells);
    std::string percent = std::to_string(share_of(state, 100));
    percent.insert(0, 3 - std::min<std::size_t>(percent.size(), 3), ' ');
    return "[" + std::string(cells, '#') + std::string(kBarCells - cells, '-') + "] " + percent +
           " %  " + std::to_string(state.done) + "/" + std::to_string(state.total) + " " +
           std::string(state.unit) + "  " + rate_of(state) + "  ETA " + eta_of(state);
}

std::string progress_line(const ProgressState& state) {
    return std::to_string(state.done) + " of " + std::to_string(state.total) + " " +
           std::string(state.unit) + " (" + std::to_string(share_of(state, 100)) + " %), " +
           rate_of(state) + ", ETA " + eta_of(state);
}

Progress::Progress(std::uint64_t total, std::string_view unit, std::FILE* out, bool is_terminal)
    : total_(total),
      unit_(unit),
      out_(out),
      is_terminal_(is_terminal),
      next_(Clock::now() + (is_terminal ? Clock::duration(kBarInterval) : kLineInterval)) {}

void Progress::show(std::uint64_t done, Clock::time_point now) {
    if (samples_.empty() || now - samples_.back().time >= kSampleInterval) {
        samples_.push_back({.time = now, .done = done});
    }
    while (samples_.size() > 1 && now - samples_.front().time > kRateWindow) {
        samples_.pop_front();
    }
    if (now < next_) {
        return;
    }
    const std::chrono::duration<double> window = now - samples_.front().time;
    const std::uint64_t made = done - samples_.front().done;
    ProgressState state{.done = done, .total = total_, .unit = unit_, .per_second = std::nullopt};
    if (window.count() > 0 && made > 0) {
        state.per_second = static_cast<double>(made) / window.count();
    }
    if (is_terminal_) {
        std::fprintf(out_, "\r%s\x1b[K", progress_bar(state).c_str());
        drawn_ = true;
        next_ = now + kBarInterval;
    } else {
        std::fprintf(out_, "%s\n", progress_line(state).c_str());
        next_ = now + kLineInterval;
    }
    std::fflush(out_);
}

void Progress::finish() {
    if (drawn_) {
        std::fwrite(kClearLine.data(), 1, kClearLine.size(), out_);
        std::fflush(out_);
        drawn_ = false;
    }
}

std::function<void(std::uint64_t, std::uint64_t)> ShownProgress::teller() {
    return [this](std::uint64_t done, std::uint64_t total) {
        if (!progress_) {
            progress_.emplace(total, unit_, stderr, isatty(STDERR_FILENO) == 1);
        }
        progress_->show(done);
    };
}

void ShownProgress::finish() {
    if (progress_) {
        progress_->finish();
    }
}

}  // namespace terrane
