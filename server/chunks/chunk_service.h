// The one place that decides what happens to a wish: answer it from the cache, let it join work
// under way, queue it, or say `busy`. It owns the cache, the queue, the in-flight table and the
// workers.
//
// How answers are made is a function it is given (build_chunk.h makes the real one), so that tests
// can step it.
#pragma once

#include "server/chunks/answer.h"
#include "server/chunks/chunk_cache.h"
#include "server/chunks/counters.h"
#include "server/chunks/in_flight.h"
#include "server/chunks/work_queue.h"
#include "server/chunks/worker_pool.h"

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

namespace terrane {

/// Makes one answer. Belongs to one worker. May throw; that is an `internal` failure of this task.
using BuildStep = std::function<Result<Answer>(const Task&)>;

struct ServiceOptions {
    std::size_t workers = 1;
    std::size_t cache_bytes_max = std::size_t{256} << 20U;
    std::int32_t side_columns = 32;       ///< the world's N
    std::size_t queued_jobs_max = 16384;  ///< stacks; at 1 ms each, 16 s of one worker
    std::size_t keys_in_flight_max = 65536;
    std::size_t waiters_max = 262144;
};

/// Work of one job that a worker does before the job goes back behind its equals: a stack with
/// endlessly many wishes must not keep a worker from the others.
inline constexpr std::size_t kTasksPerTurnMax = 64;

/// Any thread, but `stop` and the destructor: the owner's.
class ChunkService {
  public:
    /// `make_step` is called once per worker, on its thread. `counters` outlives the service.
    ChunkService(const ServiceOptions& options, ServiceCounters& counters,
                 std::function<BuildStep()> make_step);
    ~ChunkService();
    ChunkService(const ChunkService&) = delete;
    ChunkService& operator=(const ChunkService&) = delete;

    WaiterId new_waiter_id() { return next_waiter_.fetch_add(1, std::memory_order_relaxed); }

    /// For a Waiter's `flow`: a name for a client, between which work is shared fairly.
    FlowId new_flow_id() { return new_waiter_id(); }

    /// Three outcomes. An answer: it was in the cache, and `waiter.answer` is not called. Nothing:
    /// `waiter.answer` will be called once, unless `cancel` comes first. An error, and it is not
    /// called: `busy` (see retry_after_ms), `unsupported`, `out_of_range` or `draining`.
    /// A higher priority is served sooner among those of one flow; from kNearPriority on, also
    /// before what is not near of all others.
    Result<std::optional<Answer>> request(const WorkKey& key, std::int32_t priority, Waiter waiter);
    /// The answer if it is in the cache, for who would make a waiter only if it isn't.
    std::optional<Answer> at_hand(const WorkKey& key);
    /// The waiter is not interested any more. An answer already on its way may still reach it.
    void cancel(const WorkKey& key, WaiterId waiter);
    /// The waiter's interest has become another: higher or lower. Counts for all that its flow
    /// wants of the key's stack. Does nothing if the waiter does not wait any more.
    void change_priority(const WorkKey& key, WaiterId waiter, std::int32_t priority);

    /// How long until the queue may have room: its length times the mean job, 20..5,000 ms.
    std::uint32_t retry_after_ms() const;

    /// From now on every request fails with `draining`; work under way goes on.
    void drain() { draining_.store(true); }

    /// Different keys pending or running.
    std::size_t in_flight() const { return in_flight_.size(); }

    /// How long the oldest of them has been wanted.
    std::chrono::steady_clock::duration oldest_in_flight() const { return in_flight_.oldest(); }

    std::size_t queued_jobs() const { return queue_.size(); }

    ServiceCounters& counters() const { return counters_; }

    std::size_t cache_bytes() { return cache_.size_bytes(); }

    /// Stops all work, joins the workers, and answers who still waits with `draining`.
    void stop();

  private:
    Result<WorkKey> checked(const WorkKey& key) const;
    void claim_again(JobId job);
    void run_job(const BuildStep& step, const JobTurn& turn);
    void put_back(JobId job);
    Result<Answer> run_task(const BuildStep& step, const Task& task);
    Result<Answer> build(const BuildStep& step, const Task& task);
    void tell(const std::vector<Waiter>& waiters, const Result<Answer>& answer);
    std::optional<Answer> cached(const WorkKey& key);

    OutcomeCounters& outcomes_of(const WorkKey& key) { return counters_.outcomes[key.index()]; }

    tl::unexpected<Error> busy(const WorkKey& key, const char* what);

    const ServiceOptions options_;
    ServiceCounters& counters_;
    std::atomic<bool> draining_ = false;
    std::atomic<WaiterId> next_waiter_ = 1;
    std::atomic<std::uint64_t> busy_us_ = 0;  ///< time spent in jobs, over all workers
    std::atomic<std::uint64_t> jobs_done_ = 0;
    ChunkCache cache_;
    WorkQueue queue_;
    InFlight in_flight_;
    std::optional<WorkerPool> workers_;
};

}  // namespace terrane
