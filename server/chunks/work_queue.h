// The jobs that wait for a worker, shared fairly between those who want them.
//
// A job is one chunk stack; what is wanted of it stands in the in-flight table. Each *flow* (a
// session, say) has a queue of its own: highest priority first, first come first among equals. A
// job that several flows want stands in the queue of each, and whoever's turn comes first takes it
// out of all of them.
//
// Whose turn it is: the flow that has been served least, in microseconds of workers' time. This is
// deficit round robin with the cost paid afterwards (start-time fair queueing: P. Goyal, H. Vin and
// H. Cheng, 1996): nobody knows what a job costs before it is done, and there are no rounds to go
// through for flows that wait. A flow that was away starts level with the least served one, so
// nobody saves up. Flows whose first job is near (priority kNearPriority or above) come before all
// others, so the ground under every viewer comes before anybody's horizon.
//
// The queue is bounded: at the limit `push` refuses and the caller answers `busy`.
#pragma once

#include "protocol/base/mutex.h"

#include <compare>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <unordered_map>
#include <vector>

namespace terrane {

/// Never 0, never used twice.
using JobId = std::uint64_t;
/// Whom work is done for; 0: all who have not said.
using FlowId = std::uint64_t;

/// From here on a job is near: before all that is not, whoever wants it.
inline constexpr std::int32_t kNearPriority = 1 << 20;
/// Flows that wait for nothing and have had more than their share: remembered up to so many.
inline constexpr std::size_t kIdleFlowsMax = 4096;

/// How urgent a job is to one flow.
struct JobClaim {
    FlowId flow = 0;
    std::int32_t priority = 0;

    friend bool operator==(const JobClaim&, const JobClaim&) = default;
};

/// A job as a worker gets it.
struct JobTurn {
    JobId job = 0;
    FlowId flow = 0;               ///< whose turn it was
    std::uint64_t charged_us = 0;  ///< in advance: a guess
};

/// Any thread. `pop`, `charge`, `withdraw` and `remove` take no memory, so they cannot fail.
class WorkQueue {
  public:
    explicit WorkQueue(std::size_t jobs_max) : jobs_max_(jobs_max) {}

    /// False if the queue is full or closed. To a job that is already queued the claim is added, as
    /// `raise` does.
    bool push(JobId job, JobClaim claim);
    /// Puts a job back that a worker has not finished: behind its equals, and never refused, for at
    /// most one job a worker comes back.
    void put_back(JobId job, JobClaim claim);
    /// Adds a flow's claim to a queued job, or raises it; does nothing if the job is not queued or
    /// the claim has that priority.
    void raise(JobId job, JobClaim claim);
    /// Gives a flow's claim another priority, higher or lower; does nothing if there is no such
    /// claim.
    void change(JobId job, JobClaim claim);
    /// Takes a flow's claim off. True if it was the last one: the job stays in that flow's queue,
    /// behind everything, until it is removed or claimed again.
    bool withdraw(JobId job, FlowId flow);
    /// Takes a job out, if it is there.
    void remove(JobId job);
    /// Waits for a job; nothing once the queue is closed.
    std::optional<JobTurn> pop();
    /// What the job did cost.
    void charge(const JobTurn& turn, std::uint64_t cost_us);
    /// Wakes everybody; nothing is given out any more.
    void close();
    std::size_t size() const;

  private:
    struct Rank {
        std::int64_t urgency = 0;  ///< the priority negated, so that the first is the most urgent
        std::uint64_t sequence = 0;

        friend auto operator<=>(const Rank&, const Rank&) = default;
    };

    struct Claim {
        FlowId flow = 0;
        Rank rank;
    };

    /// Where a flow stands among the others.
    struct Place {
        bool is_far = false;
        std::uint64_t used_us = 0;
        FlowId flow = 0;

        friend auto operator<=>(const Place&, const Place&) = default;
    };

    struct Flow {
        std::map<Rank, JobId> jobs;
        Place place;  ///< its entry in `turns_`, or in `idle_` if it has no jobs
    };

    Rank rank_of(std::int32_t priority) TERRANE_REQUIRES(mutex_) {
        return {.urgency = -static_cast<std::int64_t>(priority), .sequence = next_sequence_++};
    }

    void insert(JobId job, JobClaim claim) TERRANE_REQUIRES(mutex_);
    void raise_locked(JobId job, JobClaim claim) TERRANE_REQUIRES(mutex_);
    Flow& flow_of(FlowId id) TERRANE_REQUIRES(mutex_);
    void place_again(Flow& flow, std::uint64_t used_us) TERRANE_REQUIRES(mutex_);
    void take_from_flow(JobId job, const Claim& claim) TERRANE_REQUIRES(mutex_);
    void take_job(JobId job) TERRANE_REQUIRES(mutex_);
    void forget_idle() TERRANE_REQUIRES(mutex_);
    std::uint64_t least_used_us() const TERRANE_REQUIRES(mutex_);

    const std::size_t jobs_max_;
    mutable Mutex mutex_;
    std::condition_variable_any changed_;
    std::unordered_map<JobId, std::vector<Claim>> jobs_ TERRANE_GUARDED_BY(mutex_);
    std::unordered_map<FlowId, Flow> flows_ TERRANE_GUARDED_BY(mutex_);
    std::set<Place> turns_ TERRANE_GUARDED_BY(mutex_);  // flows with jobs, in order of their turns
    std::set<Place> idle_ TERRANE_GUARDED_BY(mutex_);   // flows without, that used more than others
    std::uint64_t fair_us_ TERRANE_GUARDED_BY(mutex_) = 0;      // what the least served had so far
    std::uint64_t guess_us_ TERRANE_GUARDED_BY(mutex_) = 1000;  // mean of the jobs so far
    std::uint64_t next_sequence_ TERRANE_GUARDED_BY(mutex_) = 0;
    bool closed_ TERRANE_GUARDED_BY(mutex_) = false;
};

}  // namespace terrane
