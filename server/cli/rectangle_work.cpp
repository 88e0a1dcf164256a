#include "server/cli/rectangle_work.h"

#include "protocol/base/check.h"
#include "protocol/base/coords.h"
#include "protocol/base/mutex.h"
#include "protocol/base/result.h"
#include "server/chunks/worker_pool.h"
#include "server/cli/arguments.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr std::chrono::milliseconds kTick{20};

/// SplitMix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators, 2014).
class SplitMix {
  public:
    explicit SplitMix(std::uint64_t seed) : state_(seed) {}

    std::uint64_t next() {
        state_ += 0x9e3779b97f4a7c15U;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
        z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
        return z ^ (z >> 31U);
    }

  private:
    std::uint64_t state_;
};

/// Fisher and Yates; the modulo's bias does not matter for an order.
std::vector<std::uint32_t> shuffled(std::uint64_t count, std::uint64_t seed) {
    std::vector<std::uint32_t> order(count);
    std::iota(order.begin(), order.end(), 0U);
    SplitMix random(seed);
    for (std::uint64_t i = count; i > 1; --i) {
        std::swap(order[i - 1], order[random.next() % i]);
    }
    return order;
}

/// What the workers of one run share.
struct Run {
    std::atomic<std::size_t> next_batch = 0;
    std::atomic<std::uint64_t> stacks_done = 0;
    std::atomic<bool> stop = false;
    Mutex mutex;
    std::condition_variable_any worker_left;
    std::size_t working TERRANE_GUARDED_BY(mutex) = 0;
    std::optional<Error> failure TERRANE_GUARDED_BY(mutex);
};

Result<void> work(Run& run, const StackBatches& batches, const BatchWorkers& workers) {
    const BatchStep step = workers.make_step();
    std::vector<StackPos> stacks;
    while (!run.stop) {
        const std::size_t batch = run.next_batch.fetch_add(1);
        if (batch >= batches.size()) {
            break;
        }
        batches.fill(stacks, batch);
        if (auto done = step(stacks); !done) {
            return done;
        }
        run.stacks_done += stacks.size();
    }
    return {};
}

void run_worker(Run& run, const StackBatches& batches, const BatchWorkers& workers) {
    Result<void> outcome;
    try {
        outcome = work(run, batches, workers);
    } catch (const std::exception& error) {
        outcome = fail(ErrorCode::internal, error.what());
    }
    const MutexLock lock(run.mutex);
    if (!outcome) {
        run.stop = true;
        run.failure = run.failure ? std::move(run.failure) : std::move(outcome.error());
    }
    --run.working;
    run.worker_left.notify_all();
}

/// Ticks until every worker has left.
void watch(Run& run, const BatchWorkers& workers) {
    for (bool working = true; working;) {
        {
            MutexLock lock(run.mutex);
            if (run.working > 0) {
                lock.wait_until(run.worker_left, std::chrono::steady_clock::now() + kTick);
            }
            working = run.working > 0;
        }
        if (workers.tick && !workers.tick(run.stacks_done)) {
            run.stop = true;
        }
    }
}

}  // namespace

StackBatches::StackBatches(const StackRectangle& rectangle)
    : rectangle_(rectangle),
      width_(rectangle.x_end - rectangle.x_first),
      length_(rectangle.z_end - rectangle.z_first) {}

Result<StackBatches> StackBatches::cut(const StackRectangle& rectangle,
                                       std::optional<std::uint64_t> shuffle_seed) {
    StackBatches out(rectangle);
    TERRANE_ASSERT(out.width_ > 0 && out.length_ > 0);
    constexpr auto kMost = static_cast<std::int64_t>(kRectangleStacksMax);
    if (out.width_ > kMost || out.length_ > kMost / out.width_) {
        return fail(ErrorCode::too_large, "a rectangle of " + std::to_string(out.width_) + " x " +
                                              std::to_string(out.length_) + " stacks; at most " +
                                              std::to_string(kMost) + " at once");
    }
    if (shuffle_seed) {
        out.order_ = shuffled(out.stacks(), *shuffle_seed);
        out.batches_ = (out.order_.size() + kBatchStacksMax - 1) / kBatchStacksMax;
    } else {
        const std::int64_t columns = (out.width_ + kBatchSide - 1) / kBatchSide;
        const std::int64_t rows = (out.length_ + kBatchSide - 1) / kBatchSide;
        out.batches_ = static_cast<std::size_t>(columns * rows);
    }
    return out;
}

StackPos StackBatches::stack_at(std::int64_t x, std::int64_t z) const {
    return {.lod = 0,
            .x = static_cast<std::int32_t>(rectangle_.x_first + x),
            .z = static_cast<std::int32_t>(rectangle_.z_first + z)};
}

void StackBatches::fill(std::vector<StackPos>& out, std::size_t index) const {
    TERRANE_ASSERT(index < batches_);
    out.clear();
    if (!order_.empty()) {
        const auto rest = std::span(order_).subspan(index * kBatchStacksMax);
        for (const std::uint32_t i : rest.first(std::min(rest.size(), kBatchStacksMax))) {
            out.push_back(stack_at(i % width_, i / width_));
        }
        return;
    }
    const std::int64_t columns = (width_ + kBatchSide - 1) / kBatchSide;
    const std::int64_t x_first = static_cast<std::int64_t>(index) % columns * kBatchSide;
    const std::int64_t z_first = static_cast<std::int64_t>(index) / columns * kBatchSide;
    for (std::int64_t z = z_first; z < std::min(z_first + kBatchSide, length_); ++z) {
        for (std::int64_t x = x_first; x < std::min(x_first + kBatchSide, width_); ++x) {
            out.push_back(stack_at(x, z));
        }
    }
}

Result<std::uint64_t> for_each_batch(const StackBatches& batches, const BatchWorkers& workers) {
    TERRANE_ASSERT(workers.count >= 1 && workers.count <= kWorkersMax);
    Run run;
    {
        const MutexLock lock(run.mutex);
        run.working = workers.count;
    }
    {
        std::vector<std::jthread> threads;
        threads.reserve(workers.count);
        try {
            for (std::size_t i = 0; i < workers.count; ++i) {
                threads.emplace_back([&] { run_worker(run, batches, workers); });
            }
            watch(run, workers);
        } catch (const std::exception& error) {  // no such thread, or the tick's own
            run.stop = true;
            const MutexLock lock(run.mutex);
            if (!run.failure) {
                run.failure = Error{.code = ErrorCode::internal, .message = error.what()};
            }
        }
    }
    const MutexLock lock(run.mutex);
    if (run.failure) {
        return tl::unexpected(*run.failure);
    }
    return run.stacks_done.load();
}

}  // namespace terrane
