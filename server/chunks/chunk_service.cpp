#include "server/chunks/chunk_service.h"

#include "server/render/map_tile.h"
#include "server/render/section.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <limits>
#include <string>
#include <utility>

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

}  // namespace

ChunkService::ChunkService(const ServiceOptions& options, ServiceCounters& counters,
                           std::function<BuildStep()> make_step)
    : options_(options),
      counters_(counters),
      cache_(options.cache_bytes_max),
      queue_(options.queued_jobs_max),
      in_flight_({.keys_max = options.keys_in_flight_max, .waiters_max = options.waiters_max}) {
    workers_.emplace(options.workers, queue_, [this, make_step = std::move(make_step)] {
        return [this, step = make_step()](JobId job) { run_job(step, job); };
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
        return std::optional(*std::move(answer));
    }
    const WaiterId waiter_id = waiter.id;
    const auto admission =
        in_flight_.admit(*key, stack_of(*key, options_.side_columns), priority, std::move(waiter));
    switch (admission.outcome) {
        case InFlight::Admitted::refused:
            return busy("too many requests are in flight");
        case InFlight::Admitted::joined_key:
            raise(counters_.joins);
            queue_.raise(admission.job, admission.priority);
            return std::optional<Answer>{};
        case InFlight::Admitted::joined_job:
            queue_.raise(admission.job, admission.priority);
            return std::optional<Answer>{};
        case InFlight::Admitted::new_job:
            break;
    }
    if (queue_.push(admission.job, admission.priority)) {
        return std::optional<Answer>{};
    }
    auto refused = busy("the work queue is full");
    for (const Waiter& other : in_flight_.abandon(admission.job)) {
        if (other.id != waiter_id) {  // those who joined in between
            other.answer(refused);
        }
    }
    return refused;
}

void ChunkService::cancel(const WorkKey& wish, WaiterId waiter) {
    const auto key = checked(wish);
    if (!key) {
        return;
    }
    const auto left = in_flight_.leave(*key, waiter);
    if (left.stopped) {
        raise(counters_.cancelled);
    }
    if (left.idle_job) {
        queue_.remove(*left.idle_job);
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

void ChunkService::run_job(const BuildStep& step, JobId job) {
    const auto start = Clock::now();
    std::size_t tasks = 0;
    while (tasks < kTasksPerTurnMax) {
        const auto task = in_flight_.next(job);
        if (!task) {
            break;
        }
        run_task(step, *task);
        ++tasks;
    }
    if (tasks == kTasksPerTurnMax) {
        queue_.put_back(job, in_flight_.priority_of(job));
    }
    busy_us_.fetch_add(microseconds_since(start), std::memory_order_relaxed);
    jobs_done_.fetch_add(1, std::memory_order_relaxed);
}

void ChunkService::run_task(const BuildStep& step, const Task& task) {
    if (task.stop.stop_requested()) {
        return;
    }
    const std::uint32_t queue_us = clamped_us(microseconds_since(task.asked));
    Result<Answer> answer = fail(ErrorCode::internal, "no answer");
    if (auto known = cached(task.key)) {  // finished between the asker's two looks
        answer = *std::move(known);
    } else {
        answer = build(step, task);
    }
    if (answer) {
        raise(counters_.answers);
        if (auto* chunk = std::get_if<ServedChunk>(&*answer)) {
            chunk->timings.queue_us = queue_us;
            // Before the waiters are taken: who misses the table from here on finds the cache.
            cache_.put(chunk->key, chunk->chunk, memory_bytes(*chunk->chunk));
        } else if (const auto* file = std::get_if<ServedFile>(&*answer)) {
            cache_.put(task.key, file->file, memory_bytes(*file->file));
        }
    } else if (answer.error().code != ErrorCode::cancelled) {
        raise(counters_.failed);
    }
    for (const Waiter& waiter : in_flight_.finish(task)) {
        waiter.answer(answer);
    }
}

Result<Answer> ChunkService::build(const BuildStep& step, const Task& task) {
    try {
        return step(task);
    } catch (const std::exception& error) {
        return fail(ErrorCode::internal, std::string("making the answer failed: ") + error.what());
    }
}

std::optional<Answer> ChunkService::cached(const WorkKey& key) {
    auto encoded = cache_.get(key);
    if (!encoded) {
        return std::nullopt;
    }
    raise(counters_.cache_hits);
    const auto* chunk = std::get_if<ChunkKey>(&key);
    if (chunk == nullptr) {
        return ServedFile{.file = std::move(encoded), .source = ChunkSource::cache};
    }
    return ServedChunk{
        .key = *chunk, .chunk = std::move(encoded), .source = ChunkSource::cache, .timings = {}};
}

tl::unexpected<Error> ChunkService::busy(const char* what) {
    raise(counters_.busy);
    return fail(ErrorCode::busy,
                std::string(what) + "; try again in " + std::to_string(retry_after_ms()) + " ms");
}

}  // namespace terrane
