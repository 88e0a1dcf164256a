#include "server/chunks/work_queue.h"

namespace terrane {

bool WorkQueue::push(JobId job, std::int32_t priority) {
    {
        const MutexLock lock(mutex_);
        if (ranks_.contains(job)) {
            raise_locked(job, priority);
            return true;
        }
        if (closed_ || ranks_.size() >= jobs_max_) {
            return false;
        }
        insert(job, priority);
    }
    changed_.notify_one();
    return true;
}

void WorkQueue::put_back(JobId job, std::int32_t priority) {
    {
        const MutexLock lock(mutex_);
        if (closed_ || ranks_.contains(job)) {
            return;
        }
        insert(job, priority);
    }
    changed_.notify_one();
}

void WorkQueue::raise(JobId job, std::int32_t priority) {
    const MutexLock lock(mutex_);
    raise_locked(job, priority);
}

void WorkQueue::remove(JobId job) {
    const MutexLock lock(mutex_);
    if (const auto found = ranks_.find(job); found != ranks_.end()) {
        jobs_.erase(found->second);
        ranks_.erase(found);
    }
}

std::optional<JobId> WorkQueue::pop() {
    MutexLock lock(mutex_);
    while (jobs_.empty() && !closed_) {
        lock.wait(changed_);
    }
    if (closed_) {
        return std::nullopt;
    }
    const JobId job = jobs_.begin()->second;
    jobs_.erase(jobs_.begin());
    ranks_.erase(job);
    return job;
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
    return ranks_.size();
}

void WorkQueue::insert(JobId job, std::int32_t priority) {
    const Rank rank{.urgency = -static_cast<std::int64_t>(priority), .sequence = next_sequence_++};
    jobs_.emplace(rank, job);
    ranks_.emplace(job, rank);
}

void WorkQueue::raise_locked(JobId job, std::int32_t priority) {
    const auto found = ranks_.find(job);
    if (found == ranks_.end() || -found->second.urgency >= priority) {
        return;
    }
    jobs_.erase(found->second);
    ranks_.erase(found);
    insert(job, priority);
}

}  // namespace terrane
