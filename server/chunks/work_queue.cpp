#include "server/chunks/work_queue.h"

#include "protocol/base/check.h"
#include "protocol/base/mutex.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

namespace terrane {

bool WorkQueue::push(JobId job, JobClaim claim) {
    {
        const MutexLock lock(mutex_);
        if (jobs_.contains(job)) {
            raise_locked(job, claim);
            return true;
        }
        if (closed_ || jobs_.size() >= jobs_max_) {
            return false;
        }
        insert(job, claim);
    }
    changed_.notify_one();
    return true;
}

void WorkQueue::put_back(JobId job, JobClaim claim) {
    {
        const MutexLock lock(mutex_);
        if (closed_) {
            return;
        }
        if (jobs_.contains(job)) {
            raise_locked(job, claim);
            return;
        }
        insert(job, claim);
    }
    changed_.notify_one();
}

void WorkQueue::raise(JobId job, JobClaim claim) {
    const MutexLock lock(mutex_);
    raise_locked(job, claim);
}

void WorkQueue::change(JobId job, JobClaim claim) {
    const MutexLock lock(mutex_);
    const auto found = jobs_.find(job);
    if (found == jobs_.end()) {
        return;
    }
    const auto known = std::ranges::find(found->second, claim.flow, &Claim::flow);
    if (known == found->second.end() || -known->rank.urgency == claim.priority) {
        return;
    }
    Flow& flow = flows_.at(claim.flow);
    auto node = flow.jobs.extract(known->rank);
    known->rank = rank_of(claim.priority);
    node.key() = known->rank;
    flow.jobs.insert(std::move(node));
    place_again(flow, flow.place.used_us);
}

bool WorkQueue::withdraw(JobId job, FlowId flow) {
    const MutexLock lock(mutex_);
    const auto found = jobs_.find(job);
    if (found == jobs_.end()) {
        return false;
    }
    auto& claims = found->second;
    const auto known = std::ranges::find(claims, flow, &Claim::flow);
    if (known == claims.end()) {
        return false;
    }
    if (claims.size() > 1) {
        take_from_flow(job, *known);
        claims.erase(known);
        return false;
    }
    // The last one: the place in the flow's queue is kept, at its end.
    Flow& last = flows_.at(flow);
    auto node = last.jobs.extract(known->rank);
    known->rank = rank_of(std::numeric_limits<std::int32_t>::min());
    node.key() = known->rank;
    last.jobs.insert(std::move(node));
    place_again(last, last.place.used_us);
    return true;
}

void WorkQueue::remove(JobId job) {
    const MutexLock lock(mutex_);
    if (jobs_.contains(job)) {
        take_job(job);
        forget_idle();
    }
}

std::optional<JobTurn> WorkQueue::pop() {
    MutexLock lock(mutex_);
    while (jobs_.empty() && !closed_) {
        lock.wait(changed_);
    }
    if (closed_) {
        return std::nullopt;
    }
    fair_us_ = std::max(fair_us_, least_used_us());
    const FlowId id = turns_.begin()->flow;
    Flow& flow = flows_.at(id);
    const JobTurn turn{.job = flow.jobs.begin()->second, .flow = id, .charged_us = guess_us_};
    place_again(flow, flow.place.used_us + guess_us_);
    take_job(turn.job);
    forget_idle();
    return turn;
}

void WorkQueue::charge(const JobTurn& turn, std::uint64_t cost_us) {
    const MutexLock lock(mutex_);
    guess_us_ = (guess_us_ * 7 + cost_us + 7) / 8;
    if (const auto found = flows_.find(turn.flow); found != flows_.end()) {
        Flow& flow = found->second;
        // A turn is never free: of two flows that have had as much, one would be served for ever.
        const std::uint64_t used_us = flow.place.used_us + std::max<std::uint64_t>(cost_us, 1);
        place_again(flow, used_us - std::min(used_us, turn.charged_us));
    }
}

void WorkQueue::close() {
    {
        const MutexLock lock(mutex_);
        closed_ = true;
    }
    changed_.notify_all();
}

std::size_t WorkQueue::size() const {
    const MutexLock lock(mutex_);
    return jobs_.size();
}

void WorkQueue::insert(JobId job, JobClaim claim) {
    auto& claims = jobs_[job];
    const Rank rank = rank_of(claim.priority);
    try {
        claims.push_back({.flow = claim.flow, .rank = rank});
        Flow& flow = flow_of(claim.flow);
        flow.jobs.emplace(rank, job);
        place_again(flow, flow.place.used_us);
    } catch (...) {  // no memory: as if nothing had been asked
        if (!claims.empty() && claims.back().flow == claim.flow) {
            claims.pop_back();
        }
        if (claims.empty()) {
            jobs_.erase(job);
        }
        throw;
    }
}

void WorkQueue::raise_locked(JobId job, JobClaim claim) {
    const auto found = jobs_.find(job);
    if (found == jobs_.end()) {
        return;
    }
    const auto known = std::ranges::find(found->second, claim.flow, &Claim::flow);
    if (known == found->second.end()) {
        insert(job, claim);
        return;
    }
    if (-known->rank.urgency >= claim.priority) {
        return;
    }
    Flow& flow = flows_.at(claim.flow);
    auto node = flow.jobs.extract(known->rank);
    known->rank = rank_of(claim.priority);
    node.key() = known->rank;
    flow.jobs.insert(std::move(node));
    place_again(flow, flow.place.used_us);
}

/// A new one stands in `idle_` until it is placed again with its first job.
WorkQueue::Flow& WorkQueue::flow_of(FlowId id) {
    const auto [found, is_new] = flows_.try_emplace(id);
    Flow& flow = found->second;
    if (is_new) {
        flow.place = {.is_far = false, .used_us = fair_us_, .flow = id};
        try {
            idle_.insert(flow.place);
        } catch (...) {
            flows_.erase(found);
            throw;
        }
    } else if (flow.jobs.empty()) {  // it was away
        place_again(flow, std::max(flow.place.used_us, fair_us_));
    }
    return flow;
}

/// Moves the flow's entry to where it belongs now.
void WorkQueue::place_again(Flow& flow, std::uint64_t used_us) {
    auto node = turns_.extract(flow.place);
    if (!node) {
        node = idle_.extract(flow.place);
    }
    TERRANE_ASSERT(node);
    flow.place.used_us = used_us;
    flow.place.is_far =
        !flow.jobs.empty() && flow.jobs.begin()->first.urgency > -std::int64_t{kNearPriority};
    node.value() = flow.place;
    (flow.jobs.empty() ? idle_ : turns_).insert(std::move(node));
}

void WorkQueue::take_from_flow(JobId job, const Claim& claim) {
    Flow& flow = flows_.at(claim.flow);
    const auto place = flow.jobs.find(claim.rank);
    TERRANE_ASSERT(place != flow.jobs.end() && place->second == job);
    flow.jobs.erase(place);
    place_again(flow, flow.place.used_us);
}

void WorkQueue::take_job(JobId job) {
    const auto found = jobs_.find(job);
    for (const Claim& claim : found->second) {
        take_from_flow(job, claim);
    }
    jobs_.erase(found);
}

/// Flows that wait for nothing are remembered only while they have had more than the others.
void WorkQueue::forget_idle() {
    while (!idle_.empty() &&
           (jobs_.empty() || idle_.size() > kIdleFlowsMax || idle_.begin()->used_us <= fair_us_)) {
        fair_us_ = jobs_.empty() ? std::max(fair_us_, idle_.begin()->used_us) : fair_us_;
        flows_.erase(idle_.begin()->flow);
        idle_.erase(idle_.begin());
    }
}

std::uint64_t WorkQueue::least_used_us() const {
    const auto first_far = turns_.lower_bound(Place{.is_far = true, .used_us = 0, .flow = 0});
    std::uint64_t least_us = turns_.begin()->used_us;
    if (first_far != turns_.end()) {
        least_us = std::min(least_us, first_far->used_us);
    }
    return least_us;
}

}  // namespace terrane
