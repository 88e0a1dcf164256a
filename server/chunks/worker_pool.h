// N threads that each do one job at a time, with scratch buffers of their own.
#pragma once

#include "server/chunks/work_queue.h"

#include <cstddef>
#include <functional>
#include <thread>
#include <vector>

namespace terrane {

inline constexpr std::size_t kWorkersMax = 256;

/// Started by the constructor. The owner closes the queue before destroying the pool, which waits
/// for the jobs under way.
class WorkerPool {
  public:
    /// Does one job. Belongs to one thread, called there only; must not throw.
    using RunJob = std::function<void(const JobTurn&)>;

    /// `make_run_job` is called once on each worker's own thread. `workers` is 1..kWorkersMax.
    /// Returns when all are ready. If a thread can't be started or `make_run_job` throws, closes
    /// the queue and throws that.
    WorkerPool(std::size_t workers, WorkQueue& queue, const std::function<RunJob()>& make_run_job);

  private:
    std::vector<std::jthread> threads_;
};

}  // namespace terrane
