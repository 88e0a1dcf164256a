#include "server/chunks/worker_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>

namespace terrane {
namespace {

TEST(WorkerPool, ThrowsWhatAWorkerThrewWhileItWasMade) {
    WorkQueue queue(4);
    std::atomic<int> made = 0;
    const auto make_run_job = [&]() -> WorkerPool::RunJob {
        if (made++ == 2) {
            throw std::runtime_error("no room for a worker");
        }
        return [](const JobTurn&) {};
    };
    EXPECT_THROW(WorkerPool(4, queue, make_run_job), std::runtime_error);
    EXPECT_FALSE(queue.push(1, {})) << "the queue is closed, or the other three would wait";
}

}  // namespace
}  // namespace terrane
