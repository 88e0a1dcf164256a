// The jobs that wait for a worker: highest priority first, first come first among equals.
//
// A job is one chunk stack; what is wanted of it stands in the in-flight table. The queue is
// bounded: at the limit `push` refuses and the caller answers `busy`.
#pragma once

#include "protocol/base/mutex.h"

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <unordered_map>

namespace terrane {

/// Never 0, never used twice.
using JobId = std::uint64_t;

/// Any thread.
class WorkQueue {
  public:
    explicit WorkQueue(std::size_t jobs_max) : jobs_max_(jobs_max) {}

    /// False if the queue is full or closed. A job that is already queued is raised to the higher
    /// priority of the two, behind those that have it.
    bool push(JobId job, std::int32_t priority);
    /// Puts a job back that a worker has not finished: behind its equals, and never refused, for at
    /// most one job a worker comes back.
    void put_back(JobId job, std::int32_t priority);
    /// Raises a queued job; does nothing if it is not queued or has that priority.
    void raise(JobId job, std::int32_t priority);
    /// Takes a job out, if it is there.
    void remove(JobId job);
    /// Waits for a job; nothing once the queue is closed.
    std::optional<JobId> pop();
    /// Wakes everybody; nothing is given out any more.
    void close();
    std::size_t size() const;

  private:
    struct Rank {
        std::int64_t urgency = 0;  ///< the priority negated, so that the first is the most urgent
        std::uint64_t sequence = 0;

        friend auto operator<=>(const Rank&, const Rank&) = default;
    };

    void insert(JobId job, std::int32_t priority) TERRANE_REQUIRES(mutex_);
    void raise_locked(JobId job, std::int32_t priority) TERRANE_REQUIRES(mutex_);

    const std::size_t jobs_max_;
    mutable Mutex mutex_;
    std::condition_variable_any changed_;
    std::map<Rank, JobId> jobs_ TERRANE_GUARDED_BY(mutex_);
    std::unordered_map<JobId, Rank> ranks_ TERRANE_GUARDED_BY(mutex_);
    std::uint64_t next_sequence_ TERRANE_GUARDED_BY(mutex_) = 0;
    bool closed_ TERRANE_GUARDED_BY(mutex_) = false;
};

}  // namespace terrane
