#include "server/chunks/in_flight.h"

#include "protocol/base/coords.h"
#include "protocol/base/mutex.h"
#include "server/chunks/chunk_key.h"
#include "server/chunks/work_queue.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <stop_token>
#include <utility>
#include <vector>

namespace terrane {

InFlight::Admission InFlight::admit(const WorkKey& key, StackPos stack, std::int32_t priority,
                                    Waiter waiter) {
    const auto now = std::chrono::steady_clock::now();
    const FlowId flow = waiter.flow;
    const MutexLock lock(mutex_);
    if (waiters_ >= bounds_.waiters_max) {
        return {};
    }
    const auto known = entries_.find(key);
    if (known == entries_.end() && entries_.size() >= bounds_.keys_max) {
        return {};
    }
    auto outcome = Admitted::joined_key;
    JobId id = 0;
    if (known != entries_.end()) {
        known->second.waiters.push_back(std::move(waiter));
        id = known->second.job;
    } else {
        const auto [place, is_new] = job_of_stack_.try_emplace(stack, next_id_);
        id = place->second;
        if (is_new) {
            ++next_id_;
            jobs_.emplace(id, Job{.stack = stack, .flows = {}, .taken = false, .pending = {}});
        }
        outcome = is_new ? Admitted::new_job : Admitted::joined_job;
        const TaskId task = next_id_++;
        Entry& entry = entries_[key];
        entry.task = task;
        entry.job = id;
        entry.asked = now;
        entry.waiters.push_back(std::move(waiter));
        jobs_.at(id).pending.emplace(task, key);
    }
    ++waiters_;
    // A key that runs while its job has been forgotten cannot be: a job lives as long as its keys
    // run.
    Job& job = jobs_.at(id);
    auto wants = std::ranges::find(job.flows, flow, [](const Wants& w) { return w.claim.flow; });
    if (wants == job.flows.end()) {
        wants = job.flows.insert(
            wants, Wants{.claim = {.flow = flow, .priority = priority}, .waiters = 0});
    }
    ++wants->waiters;
    wants->claim.priority = std::max(wants->claim.priority, priority);
    return {.outcome = outcome, .job = id, .claim = wants->claim};
}

std::optional<Task> InFlight::next(JobId id) {
    const MutexLock lock(mutex_);
    const auto found = jobs_.find(id);
    if (found == jobs_.end()) {
        return std::nullopt;
    }
    Job& job = found->second;
    job.taken = true;
    if (job.pending.empty()) {
        job_of_stack_.erase(job.stack);
        jobs_.erase(found);
        return std::nullopt;
    }
    const auto first = job.pending.begin();
    const Entry& entry = entries_.at(first->second);
    Task task{.id = first->first,
              .job = id,
              .key = first->second,
              .stop = entry.stop.get_token(),
              .asked = entry.asked};
    job.pending.erase(first);
    return task;
}

std::vector<JobClaim> InFlight::claims_of(JobId id) const {
    std::vector<JobClaim> claims;
    const MutexLock lock(mutex_);
    if (const auto found = jobs_.find(id); found != jobs_.end()) {
        for (const Wants& wants : found->second.flows) {
            claims.push_back(wants.claim);
        }
    }
    return claims;
}

std::optional<InFlight::Claimed> InFlight::change(const WorkKey& key, WaiterId waiter,
                                                  std::int32_t priority) {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(key);
    if (found == entries_.end()) {
        return std::nullopt;
    }
    const auto& waiters = found->second.waiters;
    const auto place = std::ranges::find(waiters, waiter, &Waiter::id);
    if (place == waiters.end()) {
        return std::nullopt;
    }
    const auto job = jobs_.find(found->second.job);
    const auto wants = std::ranges::find(job->second.flows, place->flow,
                                         [](const Wants& w) { return w.claim.flow; });
    wants->claim.priority = priority;
    return Claimed{.job = job->first, .claim = wants->claim};
}

std::vector<Waiter> InFlight::finish(const Task& task) {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(task.key);
    if (found == entries_.end() || found->second.task != task.id) {
        return {};
    }
    return take_entry(task.key);
}

InFlight::Left InFlight::leave(const WorkKey& key, WaiterId waiter) {
    std::vector<Waiter> gone;  // destroyed after the lock: callbacks may hold anything
    std::stop_source stop{std::nostopstate};
    Left left;
    {
        const MutexLock lock(mutex_);
        const auto found = entries_.find(key);
        if (found == entries_.end()) {
            return left;
        }
        auto& waiters = found->second.waiters;
        const auto place = std::find_if(waiters.begin(), waiters.end(),
                                        [&](const Waiter& w) { return w.id == waiter; });
        if (place == waiters.end()) {
            return left;
        }
        left.found = true;
        const JobId id = found->second.job;
        const FlowId flow = place->flow;
        if (waiters.size() > 1) {
            gone.push_back(std::move(*place));
            waiters.erase(place);
            --waiters_;
            if (drop_claim(id, flow)) {
                left.withdrawn = {.job = id, .claim = {.flow = flow, .priority = 0}};
            }
            return left;
        }
        left.stopped = true;
        stop = found->second.stop;
        const TaskId task = found->second.task;
        gone = take_entry(key);
        const auto job = jobs_.find(id);
        job->second.pending.erase(task);
        if (!job->second.taken && job->second.pending.empty()) {
            left.idle_job = id;
            job_of_stack_.erase(job->second.stack);
            jobs_.erase(job);
        } else if (std::ranges::find(job->second.flows, flow, [](const Wants& w) {
                       return w.claim.flow;
                   }) == job->second.flows.end()) {
            left.withdrawn = {.job = id, .claim = {.flow = flow, .priority = 0}};
        }
    }
    stop.request_stop();  // NOLINT(clang-analyzer-cplusplus.Move): swapped with a copy, not moved
                          // from
    return left;
}

std::vector<Waiter> InFlight::abandon(JobId id) {
    const MutexLock lock(mutex_);
    std::vector<Waiter> waiters;
    const auto found = jobs_.find(id);
    if (found == jobs_.end()) {
        return waiters;
    }
    for (const auto& [task, key] : found->second.pending) {
        auto taken = take_entry(key);
        std::move(taken.begin(), taken.end(), std::back_inserter(waiters));
    }
    job_of_stack_.erase(found->second.stack);
    jobs_.erase(found);
    return waiters;
}

std::vector<Waiter> InFlight::abandon_all() {
    const MutexLock lock(mutex_);
    std::vector<Waiter> waiters;
    for (auto& [key, entry] : entries_) {
        entry.stop.request_stop();
        std::move(entry.waiters.begin(), entry.waiters.end(), std::back_inserter(waiters));
    }
    entries_.clear();
    job_of_stack_.clear();
    jobs_.clear();
    waiters_ = 0;
    return waiters;
}

std::size_t InFlight::size() const {
    const MutexLock lock(mutex_);
    return entries_.size();
}

std::chrono::steady_clock::duration InFlight::oldest() const {
    const auto now = std::chrono::steady_clock::now();
    auto oldest = now;
    const MutexLock lock(mutex_);
    for (const auto& [key, entry] : entries_) {
        oldest = std::min(oldest, entry.asked);
    }
    return now - oldest;
}

std::vector<Waiter> InFlight::take_entry(const WorkKey& key) {
    const auto found = entries_.find(key);
    std::vector<Waiter> waiters = std::move(found->second.waiters);
    for (const Waiter& waiter : waiters) {
        drop_claim(found->second.job, waiter.flow);
    }
    entries_.erase(found);
    waiters_ -= waiters.size();
    return waiters;
}

bool InFlight::drop_claim(JobId id, FlowId flow) {
    auto& flows = jobs_.at(id).flows;
    const auto wants = std::ranges::find(flows, flow, [](const Wants& w) { return w.claim.flow; });
    if (--wants->waiters > 0) {
        return false;
    }
    flows.erase(wants);
    return true;
}

}  // namespace terrane
