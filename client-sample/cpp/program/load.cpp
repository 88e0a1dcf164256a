#include "client-sample/cpp/program/load.h"

#include "client-sample/cpp/program/carrier.h"
#include "client-sample/cpp/program/load_client.h"
#include "client-sample/cpp/program/load_report.h"
#include "client-sample/cpp/program/local_check.h"
#include "client-sample/cpp/program/movement.h"
#include "client-sample/cpp/program/stream_loop.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace terrane {

namespace {

using Clock = LoadClient::Clock;

/// Between two looks at all clients; each moves once a kLoadStep of its own.
constexpr std::chrono::milliseconds kRound{25};
constexpr std::chrono::milliseconds kProgress{1000};
constexpr std::size_t kNotesMax = 8;
/// HTTP says a uniform chunk's shares with six decimals.
constexpr double kHttpShareTolerance = 1e-6;

/// Of this process so far.
double cpu_seconds() {
    rusage usage{};
    if (getrusage(RUSAGE_SELF, &usage) != 0) {
        return 0;
    }
    const auto seconds = [](const timeval& time) {
        return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) / 1e6;
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// One run: all is on the calling thread but the checks.
class LoadRun {
  public:
    LoadRun(const LoadOptions& options, const std::function<void(const std::string&)>& progress)
        : options_(options), progress_(progress), begin_(Clock::now()) {
        handlers_.chunk = [this](const ChunkAnswer& answer, std::span<const std::byte> payload) {
            sample(answer, payload);
        };
        handlers_.world = [this](const WorldAnswer& answer, const ServerHello& hello) {
            take_world(answer, hello);
        };
    }

    Result<LoadResult> run();

  private:
    struct Viewer {
        StreamLoop::StreamId stream = 0;
        std::unique_ptr<LoadClient> client;
        Clock::time_point begun;
        Clock::time_point next_tick;
        bool is_open = false;  ///< connected, and not over
        bool is_over = false;
        bool is_hung = false;
        LoadStart start;
    };

    void sample(const ChunkAnswer& answer, std::span<const std::byte> payload);
    void take_world(const WorldAnswer& answer, const ServerHello& hello);
    void start_clients(Clock::time_point now);
    void tick_clients(Clock::time_point now);
    bool has_work() const;
    void flush(Viewer& viewer);
    void end(Viewer& viewer, const Error& error);
    void note(const std::string& text);
    void tell_progress(Clock::time_point now);
    LoadResult finish();

    const LoadOptions& options_;
    const std::function<void(const std::string&)>& progress_;
    const Clock::time_point begin_;
    LoadClient::Handlers handlers_;
    StreamLoop* loop_ = nullptr;  ///< of `run`, from which all else is called
    std::vector<Viewer> viewers_;
    std::unique_ptr<LocalCheck> check_;
    std::uint64_t seen_ = 0;  ///< chunks, of which every check_every-th is checked
    std::size_t disconnected_ = 0;
    std::vector<std::string> notes_;
    std::set<std::string> noted_;
    Clock::time_point next_progress_;
    std::uint64_t chunks_told_ = 0;
};

void LoadRun::note(const std::string& text) {
    if (!text.empty() && notes_.size() < kNotesMax && noted_.insert(text).second) {
        notes_.push_back(text);
    }
}

void LoadRun::sample(const ChunkAnswer& answer, std::span<const std::byte> payload) {
    if (check_ && ++seen_ % options_.check_every == 0) {
        check_->offer(answer, payload);
    }
}

void LoadRun::take_world(const WorldAnswer& answer, const ServerHello& hello) {
    auto world = build_sent_world(answer, hello.fingerprint);
    if (world) {
        check_ = std::make_unique<LocalCheck>(
            std::move(*world), options_.carrier == CarrierKind::http ? kHttpShareTolerance : 0.0);
    } else {
        note("nothing can be checked: " + world.error().message);
    }
}

void LoadRun::flush(Viewer& viewer) {
    if (viewer.is_open) {
        loop_->send(viewer.stream, viewer.client->take_output());
    }
}

void LoadRun::end(Viewer& viewer, const Error& error) {
    if (viewer.is_over) {
        return;
    }
    viewer.is_over = true;
    viewer.is_open = false;
    ++disconnected_;
    note(error.message);
    loop_->close(viewer.stream);
}

/// As many as the ramp has reached by now.
void LoadRun::start_clients(Clock::time_point now) {
    const double seconds = std::chrono::duration<double>(now - begin_).count();
    const double share =
        options_.ramp_seconds > 0 ? std::min(seconds / options_.ramp_seconds, 1.0) : 1.0;
    const auto due = std::max<std::size_t>(
        1, static_cast<std::size_t>(share * static_cast<double>(options_.clients)));
    if (viewers_.size() == options_.clients) {
        return;
    }
    while (viewers_.size() < due) {
        const std::size_t i = viewers_.size();
        const MovementStart movement{
            .kind = options_.movements[i % options_.movements.size()],
            .seed = options_.seed * 1'000'003 + i,
            .x = options_.at_x,
            .y = 0,
            .z = options_.at_z,
            .spread_voxels = options_.spread_voxels,
            .path = options_.path,
            .path_offset_seconds = options_.path
                                       ? options_.path->back().seconds * static_cast<double>(i) /
                                             static_cast<double>(options_.clients)
                                       : 0};
        LoadClientOptions client = options_.client;
        client.asks_world = i == 0 && options_.check_every > 0;
        auto carrier =
            make_carrier(options_.carrier,
                         {.host = options_.host, .port = options_.port, .seed = movement.seed});
        Viewer viewer;
        viewer.client =
            std::make_unique<LoadClient>(client, movement, std::move(carrier), handlers_);
        viewer.begun = now;
        viewer.next_tick = now + kLoadStep;
        viewers_.push_back(std::move(viewer));
        viewers_.back().stream = loop_->connect();  // its id is its place in viewers_
    }
    if (viewers_.size() == options_.clients) {
        for (Viewer& viewer : viewers_) {
            const LoadCounts& counts = viewer.client->counts();
            viewer.start = {.chunks = counts.chunks, .wanting = counts.wanting};
        }
    }
}

void LoadRun::tick_clients(Clock::time_point now) {
    for (Viewer& viewer : viewers_) {
        if (viewer.is_over || now < viewer.next_tick) {
            continue;
        }
        viewer.next_tick += kLoadStep;
        viewer.next_tick = std::max(viewer.next_tick, now);
        if (viewer.is_open) {
            viewer.client->tick(now);
            flush(viewer);
            viewer.is_hung = viewer.is_hung ||
                             (viewer.client->is_hung(now) && !loop_->has_unread(viewer.stream));
        } else if (now - viewer.begun > options_.client.patience) {
            viewer.is_hung = true;  // it could not even connect
        }
    }
}

/// A client that got nothing for its patience is not waited for any more.
bool LoadRun::has_work() const {
    return std::ranges::any_of(viewers_, [](const Viewer& viewer) {
        return !viewer.is_over && !viewer.is_hung &&
               (!viewer.client->is_greeted() || viewer.client->missing() > 0);
    });
}

void LoadRun::tell_progress(Clock::time_point now) {
    if (now < next_progress_) {
        return;
    }
    next_progress_ = now + kProgress;
    std::uint64_t chunks = 0;
    std::uint64_t bytes = 0;
    std::size_t missing = 0;
    std::size_t open = 0;
    for (const Viewer& viewer : viewers_) {
        chunks += viewer.client->counts().chunks;
        bytes += viewer.client->counts().bytes;
        missing += viewer.client->missing();
        open += viewer.is_open ? 1 : 0;
    }
    std::array<char, 160> text{};
    std::snprintf(text.data(), text.size(),
                  "%5.0f s  %zu clients  %llu chunks (+%llu)  %.1f MB  %zu missing",
                  std::chrono::duration<double>(now - begin_).count(), open,
                  static_cast<unsigned long long>(chunks),
                  static_cast<unsigned long long>(chunks - chunks_told_),
                  static_cast<double>(bytes) / 1e6, missing);
    chunks_told_ = chunks;
    progress_(text.data());
}

Result<LoadResult> LoadRun::run() {
    StreamLoop::Handlers handlers;
    handlers.opened = [this](StreamLoop::StreamId id) {
        Viewer& viewer = viewers_[id];
        viewer.is_open = true;
        viewer.is_hung = false;  // if it took longer than its patience, it is waited for again
        viewer.client->open(Clock::now());
        flush(viewer);
    };
    handlers.received = [this](StreamLoop::StreamId id, std::span<const std::byte> bytes) {
        Viewer& viewer = viewers_[id];
        if (const auto taken = viewer.client->receive(bytes, Clock::now()); !taken) {
            end(viewer, taken.error());
            return;
        }
        flush(viewer);
    };
    handlers.closed = [this](StreamLoop::StreamId id, const Error& error) {
        end(viewers_[id], error);
    };
    auto loop =
        StreamLoop::open({.host = options_.host, .port = options_.port, .tls = options_.tls},
                         std::move(handlers), begin_ + options_.client.patience);
    if (!loop) {
        return tl::unexpected(loop.error());
    }
    loop_ = &*loop;
    viewers_.reserve(options_.clients);
    const auto duration = std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(options_.seconds));
    const Clock::time_point still = begin_ + duration;
    const Clock::time_point latest = still + options_.client.patience;
    bool is_moving = true;
    next_progress_ = begin_ + kProgress;
    for (Clock::time_point now = begin_; now < still || (has_work() && now < latest);
         now = Clock::now()) {
        start_clients(now);
        if (is_moving && now >= still) {
            is_moving = false;
            for (Viewer& viewer : viewers_) {
                viewer.client->stop_moving();
            }
        }
        tick_clients(now);
        tell_progress(now);
        if (disconnected_ == options_.clients) {
            break;
        }
        loop_->run_until(now + kRound);
    }
    return finish();
}

LoadResult LoadRun::finish() {
    LoadResult result;
    result.clients = viewers_.size();
    result.disconnected = disconnected_;
    std::vector<double> rates;
    for (Viewer& viewer : viewers_) {
        const LoadCounts& counts = viewer.client->counts();
        add(result, counts);
        note(counts.first_fault);
        if (const auto rate = rate_of(counts, viewer.start)) {
            rates.push_back(*rate);
        }
        result.hung += viewer.is_hung ? 1 : 0;
        if (!viewer.is_over && !viewer.is_hung && viewer.client->missing() > 0) {
            ++result.unfilled;
        }
        if (viewer.is_open) {
            viewer.client->leave();
            flush(viewer);
            viewer.is_over = true;
        }
    }
    loop_->run_until(Clock::now() + kRound);
    for (const Viewer& viewer : viewers_) {
        loop_->close(viewer.stream);
    }
    result.seconds = std::chrono::duration<double>(Clock::now() - begin_).count();
    result.cpu_seconds = cpu_seconds();
    if (check_) {
        check_->finish();
        const CheckCounts counts = check_->counts();
        result.checked = counts.checked;
        result.wrong += counts.wrong;
        note(counts.first_wrong);
    }
    if (!rates.empty()) {
        result.fairness = jain_index(rates);
        const auto [least, most] = std::ranges::minmax(rates);
        result.fairness_min_max = most > 0 ? least / most : 1;
    }
    result.notes = notes_;
    return result;
}

}  // namespace

Result<LoadResult> run_load(const LoadOptions& options,
                            const std::function<void(const std::string&)>& progress) {
    LoadRun run(options, progress);
    return run.run();
}

}  // namespace terrane
