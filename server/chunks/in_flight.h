// Who waits for what: the single-flight table.
//
// Work is grouped in jobs, one per chunk stack, so that a stack is generated once however many of
// its chunks and columns are wanted. Life of a piece of work:
//
//     admit ── new key ──> pending in its stack's job ──next──> running ──finish──> waiters
//     answered
//       └── known key: the waiter joins                 └── last waiter leaves: stopped and
//       forgotten
//
// Every piece of work has a task id of its own. `finish` hands out waiters only for the task that
// the table still knows, so the late result of a stopped task never answers its successor.
#pragma once

#include "protocol/base/mutex.h"
#include "server/chunks/answer.h"
#include "server/chunks/chunk_key.h"
#include "server/chunks/work_queue.h"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <stop_token>
#include <unordered_map>
#include <vector>

namespace terrane {

/// Names one wish of one client; the service gives them out and never uses one twice.
using WaiterId = std::uint64_t;

struct Waiter {
    WaiterId id = 0;
    AnswerCallback answer;
    FlowId flow = 0;  ///< whom it is for: work is shared fairly between flows
};

using TaskId = std::uint64_t;

/// A piece of work as a worker gets it.
struct Task {
    TaskId id = 0;
    JobId job = 0;
    WorkKey key;
    std::stop_token stop;
    std::chrono::steady_clock::time_point asked;
};

/// Any thread. Calls no callback.
class InFlight {
  public:
    struct Bounds {
        std::size_t keys_max = 0;     ///< different keys pending or running
        std::size_t waiters_max = 0;  ///< waiters in all
    };

    enum class Admitted : std::uint8_t {
        refused,     ///< a bound is reached
        joined_key,  ///< the same key was already wanted
        joined_job,  ///< the key's stack was already wanted
        new_job      ///< the caller must queue `job`, or `abandon` it
    };

    struct Admission {
        Admitted outcome = Admitted::refused;
        JobId job = 0;
        JobClaim claim;  ///< the flow's on the job, raised to that of its most urgent key
    };

    explicit InFlight(Bounds bounds) : bounds_(bounds) {}

    Admission admit(const WorkKey& key, StackPos stack, std::int32_t priority, Waiter waiter);
    /// The job's next pending work, oldest first. Nothing ends the job: it is forgotten in the same
    /// step, so a key that comes later opens a new one.
    std::optional<Task> next(JobId job);
    /// Who wants the job and how urgently; empty if it is not known any more.
    std::vector<JobClaim> claims_of(JobId job) const;

    /// Gives the waiter's flow another claim on the key's job, and says which; nothing if the
    /// waiter does not wait.
    struct Claimed {
        JobId job = 0;
        JobClaim claim;
    };

    std::optional<Claimed> change(const WorkKey& key, WaiterId waiter, std::int32_t priority);
    /// Ends a task and gives its waiters; none if the task was stopped in the meantime.
    std::vector<Waiter> finish(const Task& task);

    /// Takes a waiter off. The last one to leave stops the work. Gives the job if it has become
    /// idle before any worker took it: the caller takes it out of the queue. `stopped` says whether
    /// work was stopped. `withdrawn`: the waiter's flow wants nothing of the job any more.
    struct Left {
        bool found = false;
        bool stopped = false;
        std::optional<JobId> idle_job;
        std::optional<Claimed> withdrawn;
    };

    Left leave(const WorkKey& key, WaiterId waiter);
    /// Forgets a job that could not be queued and gives the waiters of all its work.
    std::vector<Waiter> abandon(JobId job);
    /// Stops and forgets everything.
    std::vector<Waiter> abandon_all();
    /// Different keys pending or running.
    std::size_t size() const;
    /// How long the oldest of them has been wanted; 0 if there is none.
    std::chrono::steady_clock::duration oldest() const;

  private:
    struct Entry {
        TaskId task = 0;
        JobId job = 0;
        std::stop_source stop;
        std::chrono::steady_clock::time_point asked;
        std::vector<Waiter> waiters;
    };

    struct Wants {
        JobClaim claim;
        std::size_t waiters = 0;  ///< of this flow, for keys of this job; at least 1
    };

    struct Job {
        StackPos stack;
        std::vector<Wants> flows;
        bool taken = false;  ///< a worker has asked for its work
        std::map<TaskId, WorkKey> pending;
    };

    std::vector<Waiter> take_entry(const WorkKey& key) TERRANE_REQUIRES(mutex_);
    /// One waiter of the flow less; true if it was the flow's last on the job.
    bool drop_claim(JobId job, FlowId flow) TERRANE_REQUIRES(mutex_);

    const Bounds bounds_;
    mutable Mutex mutex_;
    std::unordered_map<WorkKey, Entry, KeyHash> entries_ TERRANE_GUARDED_BY(mutex_);
    std::unordered_map<StackPos, JobId, KeyHash> job_of_stack_ TERRANE_GUARDED_BY(mutex_);
    std::unordered_map<JobId, Job> jobs_ TERRANE_GUARDED_BY(mutex_);
    std::size_t waiters_ TERRANE_GUARDED_BY(mutex_) = 0;
    std::uint64_t next_id_ TERRANE_GUARDED_BY(mutex_) = 1;
};

}  // namespace terrane
