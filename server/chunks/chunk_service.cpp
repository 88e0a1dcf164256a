#include "server/chunks/chunk_service.h"

#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"
#include "server/chunks/answer.h"
#include "server/chunks/chunk_cache.h"
#include "server/chunks/chunk_key.h"
#include "server/chunks/counters.h"
#include "server/chunks/in_flight.h"
#include "server/chunks/work_queue.h"
#include "server/render/map_tile.h"
#include "server/render/picture_keys.h"
#include "server/render/section.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <iterator>
#include <limits>
#include <new>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace terrane {

namespace {

using Clock = std::chrono::steady_clock;

std::uint64_t microseconds_since(Clock::time_point start) {
    return static_cast<std::uint64_t>(
        std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - start).count());
}

std::uint32_t clamped_us(std::uint64_t us) {
    return static_cast<std::uint32_t>(
        std::min<std::uint64_t>(us, std::numeric_limits<std::uint32_t>::max()));
}

bool fits_int32(std::int64_t value) {
    return value >= std::numeric_limits<std::int32_t>::min() &&
           value <= std::numeric_limits<std::int32_t>::max();
}

static_assert(std::variant_size_v<WorkKey> == kRequestKinds.size());

}  // namespace

ChunkService::ChunkService(const ServiceOptions& options, ServiceCounters& counters,
                           std::function<BuildStep()> make_step)
    : options_(options),
      counters_(counters),
      cache_(options.cache_bytes_max),
      queue_(options.queued_jobs_max),
      in_flight_({.keys_max = options.keys_in_flight_max, .waiters_max = options.waiters_max}) {
    workers_.emplace(options.workers, queue_, [this, make_step = std::move(make_step)] {
        return [this, step = make_step()](const JobTurn& turn) { run_job(step, turn); };
    });
}

ChunkService::~ChunkService() {
    stop();
}

Result<std::optional<Answer>> ChunkService::request(const WorkKey& wish, std::int32_t priority,
                                                    Waiter waiter) {
    const auto key = checked(wish);
    if (!key) {
        return tl::unexpected(key.error());
    }
    if (draining_.load()) {
        return fail(ErrorCode::draining, "the server is shutting down");
    }
    if (auto answer = cached(*key)) {
        return answer;
    }
    const WaiterId waiter_id = waiter.id;
    const auto admission =
        in_flight_.admit(*key, stack_of(*key, options_.side_columns), priority, std::move(waiter));
    switch (admission.outcome) {
        case InFlight::Admitted::refused:
            return busy(*key, "too many requests are in flight");
        case InFlight::Admitted::joined_key:
            raise(counters_.joins);
            queue_.raise(admission.job, admission.claim);
            return std::optional<Answer>{};
        case InFlight::Admitted::joined_job:
            queue_.raise(admission.job, admission.claim);
            return std::optional<Answer>{};
        case InFlight::Admitted::new_job:
            break;
    }
    if (queue_.push(admission.job, admission.claim)) {
        claim_again(admission.job);
        return std::optional<Answer>{};
    }
    auto refused = busy(*key, "the work queue is full");
    for (const Waiter& other : in_flight_.abandon(admission.job)) {
        if (other.id != waiter_id) {  // those who joined in between
            other.answer(refused);
        }
    }
    return refused;
}

std::optional<Answer> ChunkService::at_hand(const WorkKey& wish) {
    const auto key = checked(wish);
    return key && !draining_.load() ? cached(*key) : std::nullopt;
}

void ChunkService::cancel(const WorkKey& wish, WaiterId waiter) {
    const auto key = checked(wish);
    if (!key) {
        return;
    }
    const auto left = in_flight_.leave(*key, waiter);
    if (left.stopped) {
        raise(outcomes_of(*key).cancelled);
    }
    if (left.idle_job) {
        queue_.remove(*left.idle_job);
    } else if (left.withdrawn && queue_.withdraw(left.withdrawn->job, left.withdrawn->claim.flow)) {
        claim_again(left.withdrawn->job);
    }
}

void ChunkService::change_priority(const WorkKey& wish, WaiterId waiter, std::int32_t priority) {
    const auto key = checked(wish);
    if (!key) {
        return;
    }
    if (const auto changed = in_flight_.change(*key, waiter, priority)) {
        queue_.change(changed->job, changed->claim);
    }
}

/// The claims of those who joined before the job was queued. Who joins later finds it there.
void ChunkService::claim_again(JobId job) {
    for (const JobClaim& claim : in_flight_.claims_of(job)) {
        queue_.raise(job, claim);
    }
}

std::uint32_t ChunkService::retry_after_ms() const {
    const std::uint64_t done = jobs_done_.load(std::memory_order_relaxed);
    const std::uint64_t mean_us =
        done == 0 ? 1000 : busy_us_.load(std::memory_order_relaxed) / done;
    const std::uint64_t wait_us = mean_us * queue_.size() / options_.workers;
    return static_cast<std::uint32_t>(std::clamp<std::uint64_t>(wait_us / 1000, 20, 5000));
}

void ChunkService::stop() {
    if (!workers_) {
        return;
    }
    drain();
    queue_.close();
    auto waiters = in_flight_.abandon_all();
    workers_.reset();
    // What slipped in between `drain` and `abandon_all`.
    auto late = in_flight_.abandon_all();
    std::move(late.begin(), late.end(), std::back_inserter(waiters));
    for (const Waiter& waiter : waiters) {
        waiter.answer(fail(ErrorCode::draining, "the server is shutting down"));
    }
}

Result<WorkKey> ChunkService::checked(const WorkKey& key) const {
    if (const auto* chunk = std::get_if<ChunkKey>(&key)) {
        const std::int32_t lod = chunk->position.lod;
        if (lod < 0 || lod >= levels_supported()) {
            return fail(ErrorCode::unsupported, "level of detail " + std::to_string(lod) +
                                                    ": this server has 0.." +
                                                    std::to_string(levels_supported() - 1));
        }
        if (lod > 0 && chunk->position.y != 0) {
            return fail(ErrorCode::out_of_range,
                        "y " + std::to_string(chunk->position.y) +
                            ": above level 0 a chunk is the whole height, and its y is 0");
        }
        if (chunk->format > ChunkFormat::glb) {
            return fail(ErrorCode::unsupported,
                        "format " + std::to_string(static_cast<int>(chunk->format)) +
                            ": this server has 0 (draco), 1 (columns), 2 (blocky) and 3 (glb)");
        }
        if (lod > 0 && chunk->format == ChunkFormat::draco_blocky) {
            return fail(ErrorCode::unsupported,
                        "level of detail " + std::to_string(lod) +
                            " as blocky: only level 0 has blocks; ask for draco");
        }
        return WorkKey(chunk->normalised());
    }
    if (const auto* tile = std::get_if<TileKey>(&key)) {
        const std::int32_t lod = tile->position.lod;
        if (lod < 0 || lod >= levels_supported()) {
            return fail(ErrorCode::unsupported, "level of detail " + std::to_string(lod) +
                                                    ": this server has 0.." +
                                                    std::to_string(levels_supported() - 1));
        }
        return key;
    }
    if (const auto* map = std::get_if<MapTile>(&key)) {
        return check_map_tile(*map).map([&key] { return key; });
    }
    if (const auto* section = std::get_if<Section>(&key)) {
        return check_section(*section).map([&key] { return key; });
    }
    const auto column = std::get<ColumnPos>(key);
    for (const std::int64_t at : {column.x, column.z}) {
        if (at <= -kColumnCoordinateLimit || at >= kColumnCoordinateLimit ||
            !fits_int32(floor_div(at, options_.side_columns))) {
            return fail(ErrorCode::out_of_range, "column coordinate " + std::to_string(at) +
                                                     ": chunk coordinates end at 2^31");
        }
    }
    return key;
}

void ChunkService::run_job(const BuildStep& step, const JobTurn& turn) {
    const auto start = Clock::now();
    std::size_t tasks = 0;
    while (tasks < kTasksPerTurnMax) {
        const auto task = in_flight_.next(turn.job);
        if (!task) {
            break;
        }
        if (!task->stop.stop_requested()) {
            const auto answer = run_task(step, *task);
            tell(in_flight_.finish(*task), answer);
        }
        ++tasks;
    }
    if (tasks == kTasksPerTurnMax) {
        put_back(turn.job);
    }
    const std::uint64_t cost_us = microseconds_since(start);
    queue_.charge(turn, cost_us);
    busy_us_.fetch_add(cost_us, std::memory_order_relaxed);
    jobs_done_.fetch_add(1, std::memory_order_relaxed);
}

/// A job that can't be queued again for want of memory is given up; the worker goes on.
void ChunkService::put_back(JobId job) {
    try {
        const auto claims = in_flight_.claims_of(job);
        // Without a claim its last wishes have just been cancelled: it is looked at once more.
        queue_.put_back(job, claims.empty() ? JobClaim{} : claims.front());
        claim_again(job);
    } catch (const std::exception&) {
        queue_.remove(job);
        tell(in_flight_.abandon(job), fail(ErrorCode::internal, "no memory"));
    }
}

/// One of the places where exceptions end: whatever is thrown fails this answer only.
Result<Answer> ChunkService::run_task(const BuildStep& step, const Task& task) {
    const std::uint32_t queue_us = clamped_us(microseconds_since(task.asked));
    auto known = cached(task.key);  // finished between the asker's two looks
    const bool is_known = known.has_value();
    auto answer = is_known ? Result<Answer>(*std::move(known)) : build(step, task);
    OutcomeCounters& outcomes = outcomes_of(task.key);
    if (!answer) {
        if (answer.error().code != ErrorCode::cancelled) {
            raise(outcomes.failed);
        }
        return answer;
    }
    raise(counters_.answers);
    if (!is_known) {
        raise(source_of(*answer) == ChunkSource::generated ? outcomes.generated : outcomes.store);
    }
    try {  // before the waiters are taken: who misses the table from here on finds the cache
        if (auto* chunk = std::get_if<ServedChunk>(&*answer)) {
            chunk->timings.queue_us = queue_us;
            cache_.put(chunk->key, chunk->chunk, memory_bytes(*chunk->chunk));
        } else if (const auto* file = std::get_if<ServedFile>(&*answer)) {
            cache_.put(task.key, file->file, memory_bytes(*file->file));
        }
    } catch (const std::exception&) {  // no memory: who asks next has it made again
    }
    return answer;
}

/// A callback must only hand the answer on; one that finds no memory for that fails alone.
void ChunkService::tell(const std::vector<Waiter>& waiters, const Result<Answer>& answer) {
    for (const Waiter& waiter : waiters) {
        try {
            waiter.answer(answer);
        } catch (const std::exception&) {
            raise(counters_.undelivered);
        }
    }
}

Result<Answer> ChunkService::build(const BuildStep& step, const Task& task) {
    try {
        return step(task);
    } catch (const std::bad_alloc&) {
        return fail(ErrorCode::internal, "no memory");  // short: the words need none
    } catch (const std::exception& error) {
        return fail(ErrorCode::internal, std::string("making the answer failed: ") + error.what());
    }
}

std::optional<Answer> ChunkService::cached(const WorkKey& key) {
    auto encoded = cache_.get(key);
    if (!encoded) {
        return std::nullopt;
    }
    raise(outcomes_of(key).cache);
    const auto* chunk = std::get_if<ChunkKey>(&key);
    if (chunk == nullptr) {
        return ServedFile{.file = std::move(encoded), .source = ChunkSource::cache};
    }
    return ServedChunk{
        .key = *chunk, .chunk = std::move(encoded), .source = ChunkSource::cache, .timings = {}};
}

tl::unexpected<Error> ChunkService::busy(const WorkKey& key, const char* what) {
    raise(outcomes_of(key).busy);
    return fail(ErrorCode::busy,
                std::string(what) + "; try again in " + std::to_string(retry_after_ms()) + " ms");
}

}  // namespace terrane
