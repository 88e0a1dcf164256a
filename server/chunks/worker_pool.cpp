#include "server/chunks/worker_pool.h"

#include "protocol/base/check.h"
#include "server/chunks/work_queue.h"

#include <cstddef>
#include <exception>
#include <functional>
#include <future>
#include <utility>
#include <vector>

namespace terrane {

WorkerPool::WorkerPool(std::size_t workers, WorkQueue& queue,
                       const std::function<RunJob()>& make_run_job) {
    TERRANE_ASSERT(workers >= 1 && workers <= kWorkersMax);
    threads_.reserve(workers);
    std::vector<std::future<void>> ready;
    try {
        ready.reserve(workers);
        for (std::size_t i = 0; i < workers; ++i) {
            std::promise<void> promise;
            ready.push_back(promise.get_future());
            threads_.emplace_back([&queue, make_run_job, is_ready = std::move(promise)]() mutable {
                RunJob run_job;
                try {
                    run_job = make_run_job();
                } catch (...) {
                    is_ready.set_exception(std::current_exception());
                    return;
                }
                is_ready.set_value();
                while (const auto turn = queue.pop()) {
                    run_job(*turn);
                }
            });
        }
        for (std::future<void>& worker : ready) {
            worker.get();
        }
    } catch (...) {
        queue.close();  // or those that did start would wait for jobs, and we for them
        throw;
    }
}

}  // namespace terrane
