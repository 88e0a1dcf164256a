#include "server/chunks/worker_pool.h"

#include "protocol/base/check.h"

namespace terrane {

WorkerPool::WorkerPool(std::size_t workers, WorkQueue& queue,
                       const std::function<RunJob()>& make_run_job) {
    TERRANE_ASSERT(workers >= 1 && workers <= kWorkersMax);
    threads_.reserve(workers);
    for (std::size_t i = 0; i < workers; ++i) {
        threads_.emplace_back([&queue, make_run_job] {
            const RunJob run_job = make_run_job();
            while (const auto job = queue.pop()) {
                run_job(*job);
            }
        });
    }
}

}  // namespace terrane
