#include "server/chunks/work_queue.h"

#include "tests/support/random_seed.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <set>
#include <thread>
#include <vector>

namespace terrane {
namespace {

TEST(WorkQueue, GivesTheHighestPriorityFirstAndEqualsInTheirOrder) {
    WorkQueue queue(8);
    EXPECT_TRUE(queue.push(1, {.priority = 0}));
    EXPECT_TRUE(queue.push(2, {.priority = 5}));
    EXPECT_TRUE(queue.push(3, {.priority = 0}));
    EXPECT_TRUE(queue.push(4, {.priority = 5}));
    EXPECT_TRUE(queue.push(5, {.priority = -3}));
    for (const JobId expected : {2U, 4U, 1U, 3U, 5U}) {
        EXPECT_EQ(queue.pop()->job, expected);
    }
    EXPECT_EQ(queue.size(), 0U);
}

TEST(WorkQueue, OrdersTheExtremesOfPriority) {
    WorkQueue queue(8);
    EXPECT_TRUE(queue.push(1, {.priority = std::numeric_limits<std::int32_t>::min()}));
    EXPECT_TRUE(queue.push(2, {.priority = std::numeric_limits<std::int32_t>::max()}));
    EXPECT_EQ(queue.pop()->job, 2U);
    EXPECT_EQ(queue.pop()->job, 1U);
}

TEST(WorkQueue, RefusesAtItsBoundUntilThereIsRoom) {
    WorkQueue queue(2);
    EXPECT_TRUE(queue.push(1, {.priority = 0}));
    EXPECT_TRUE(queue.push(2, {.priority = 0}));
    EXPECT_FALSE(queue.push(3, {.priority = 9}));
    EXPECT_EQ(queue.size(), 2U);
    EXPECT_EQ(queue.pop()->job, 1U);
    EXPECT_TRUE(queue.push(3, {.priority = 9}));
    EXPECT_EQ(queue.pop()->job, 3U);
}

TEST(WorkQueue, TakesAnUnfinishedJobBackAtItsBound) {
    WorkQueue queue(1);
    EXPECT_TRUE(queue.push(1, {.priority = 0}));
    EXPECT_EQ(queue.pop()->job, 1U);
    EXPECT_TRUE(queue.push(2, {.priority = 0}));
    queue.put_back(1, {.priority = 0});
    EXPECT_EQ(queue.pop()->job, 2U);
    EXPECT_EQ(queue.pop()->job, 1U);
}

TEST(WorkQueue, RaisesAJobButNeverLowersIt) {
    WorkQueue queue(8);
    EXPECT_TRUE(queue.push(1, {.priority = 3}));
    EXPECT_TRUE(queue.push(2, {.priority = 2}));
    EXPECT_TRUE(queue.push(3, {.priority = 1}));
    queue.raise(3, {.priority = 4});
    queue.raise(1, {.priority = 0});
    queue.raise(99, {.priority = 7});
    EXPECT_TRUE(queue.push(2, {.priority = 3}));
    for (const JobId expected : {3U, 1U, 2U}) {
        EXPECT_EQ(queue.pop()->job, expected);
    }
}

TEST(WorkQueue, ForgetsARemovedJob) {
    WorkQueue queue(8);
    EXPECT_TRUE(queue.push(1, {.priority = 0}));
    EXPECT_TRUE(queue.push(2, {.priority = 0}));
    queue.remove(1);
    queue.remove(7);
    EXPECT_EQ(queue.size(), 1U);
    EXPECT_EQ(queue.pop()->job, 2U);
}

constexpr std::int32_t kNear = kNearPriority;

std::vector<JobId> popped_jobs(WorkQueue& queue, std::size_t count, std::uint64_t cost_us) {
    std::vector<JobId> jobs;
    while (jobs.size() < count) {
        const auto turn = queue.pop();
        jobs.push_back(turn->job);
        queue.charge(*turn, cost_us);
    }
    return jobs;
}

TEST(WorkQueue, JobsThatCostNothingAreSharedToo) {
    WorkQueue queue(8);
    for (const JobId job : {1U, 2U, 3U}) {
        ASSERT_TRUE(queue.push(job, {.flow = 1, .priority = 8}));
        ASSERT_TRUE(queue.push(10 + job, {.flow = 2, .priority = -8}));
    }
    EXPECT_EQ(popped_jobs(queue, 6, 0), (std::vector<JobId>{1, 11, 2, 12, 3, 13}));
}

TEST(WorkQueue, AHugeQueueDoesNotStarveASmallOne) {
    WorkQueue queue(2000);
    for (JobId job = 1; job <= 1000; ++job) {
        ASSERT_TRUE(queue.push(job, {.flow = 1, .priority = 8}));
    }
    EXPECT_EQ(popped_jobs(queue, 10, 1000).size(), 10U);
    ASSERT_TRUE(queue.push(2001, {.flow = 2, .priority = -8}));
    ASSERT_TRUE(queue.push(2002, {.flow = 2, .priority = -8}));
    const auto next = popped_jobs(queue, 4, 1000);
    EXPECT_EQ(std::ranges::count_if(next, [](JobId job) { return job > 2000; }), 2)
        << "priorities count within a flow";
}

TEST(WorkQueue, TurnsAreFairByCostNotByCount) {
    WorkQueue queue(2000);
    for (JobId job = 1; job <= 500; ++job) {
        ASSERT_TRUE(queue.push(job, {.flow = 1}));         // its jobs cost 100 us
        ASSERT_TRUE(queue.push(1000 + job, {.flow = 2}));  // 400 us
    }
    std::uint64_t cost_us[3] = {};
    for (int i = 0; i < 400; ++i) {
        const auto turn = queue.pop();
        ASSERT_TRUE(turn);
        const std::uint64_t cost = turn->flow == 1 ? 100 : 400;
        cost_us[turn->flow] += cost;
        queue.charge(*turn, cost);
    }
    EXPECT_NEAR(static_cast<double>(cost_us[1]), static_cast<double>(cost_us[2]), 2000);
}

TEST(WorkQueue, WhoWasAwaySavedNothingUp) {
    WorkQueue queue(2000);
    for (JobId job = 1; job <= 100; ++job) {
        ASSERT_TRUE(queue.push(job, {.flow = 1}));
    }
    popped_jobs(queue, 50, 1000);
    for (JobId job = 101; job <= 200; ++job) {
        ASSERT_TRUE(queue.push(job, {.flow = 2}));
    }
    const auto next = popped_jobs(queue, 40, 1000);
    const auto of_first = std::ranges::count_if(next, [](JobId job) { return job <= 100; });
    EXPECT_NEAR(static_cast<double>(of_first), 20, 2);
}

TEST(WorkQueue, WhatIsNearToOneComesBeforeWhatIsFarToAll) {
    WorkQueue queue(64);
    ASSERT_TRUE(queue.push(1, {.flow = 1, .priority = 0}));
    ASSERT_TRUE(queue.push(2, {.flow = 2, .priority = -5}));
    ASSERT_TRUE(queue.push(3, {.flow = 2, .priority = kNear}));
    ASSERT_TRUE(queue.push(4, {.flow = 2, .priority = kNear + 1}));
    ASSERT_TRUE(queue.push(5, {.flow = 3, .priority = kNear}));
    const auto jobs = popped_jobs(queue, 5, 1000);
    EXPECT_EQ(jobs[0], 4U);
    EXPECT_EQ(jobs[1], 5U) << "near ones take turns, too";
    EXPECT_EQ(jobs[2], 3U);
}

TEST(WorkQueue, AJobThatSeveralWantIsGivenOutOnce) {
    WorkQueue queue(64);
    ASSERT_TRUE(queue.push(1, {.flow = 1, .priority = -4}));
    ASSERT_TRUE(queue.push(2, {.flow = 1, .priority = 0}));
    queue.raise(1, {.flow = 2, .priority = 3});
    queue.raise(1, {.flow = 3, .priority = 3});
    EXPECT_EQ(queue.size(), 2U);
    EXPECT_EQ(popped_jobs(queue, 2, 1000), (std::vector<JobId>{2, 1}));
    EXPECT_EQ(queue.size(), 0U);
}

TEST(WorkQueue, ChangesAPriorityBothWays) {
    WorkQueue queue(64);
    for (JobId job = 1; job <= 3; ++job) {
        ASSERT_TRUE(queue.push(job, {.flow = 7, .priority = 0}));
    }
    queue.change(1, {.flow = 7, .priority = -3});
    queue.change(3, {.flow = 7, .priority = kNear});
    queue.change(2, {.flow = 8, .priority = kNear});  // has no claim
    queue.change(9, {.flow = 7, .priority = kNear});
    EXPECT_EQ(popped_jobs(queue, 3, 1000), (std::vector<JobId>{3, 2, 1}));
}

TEST(WorkQueue, AJobKeepsAPlaceWhenItsLastClaimGoes) {
    WorkQueue queue(64);
    ASSERT_TRUE(queue.push(1, {.flow = 1, .priority = 9}));
    ASSERT_TRUE(queue.push(2, {.flow = 1, .priority = 0}));
    queue.raise(1, {.flow = 2, .priority = 1});
    EXPECT_FALSE(queue.withdraw(1, 2));
    EXPECT_FALSE(queue.withdraw(1, 2));
    EXPECT_TRUE(queue.withdraw(1, 1));
    EXPECT_EQ(popped_jobs(queue, 2, 1000), (std::vector<JobId>{2, 1}));
}

// Random steps against a plain model: nothing is lost, nothing given out twice.
TEST(WorkQueue, LosesNothingWhateverHappens) {
    std::mt19937_64 random(test_seed());
    WorkQueue queue(256);
    std::set<JobId> queued;
    JobId last = 0;
    for (int step = 0; step < 20'000; ++step) {
        const FlowId flow = random() % 6;
        const auto priority =
            static_cast<std::int32_t>(random() % 8) + (random() % 4 == 0 ? kNear : 0);
        const JobId some = last == 0 ? 1 : last - random() % std::min<JobId>(last, 300);
        switch (random() % 7) {
            case 0:
            case 1:
                if (queue.push(++last, {.flow = flow, .priority = priority})) {
                    queued.insert(last);
                } else {
                    EXPECT_EQ(queued.size(), 256U);
                }
                break;
            case 2:
                queue.raise(some, {.flow = flow, .priority = priority});
                break;
            case 3:
                queue.change(some, {.flow = flow, .priority = priority});
                break;
            case 4:
                queue.withdraw(some, flow);
                break;
            case 5:
                queue.remove(some);
                queued.erase(some);
                break;
            default:
                if (!queued.empty()) {
                    const auto turn = queue.pop();
                    ASSERT_EQ(queued.erase(turn->job), 1U);
                    queue.charge(*turn, random() % 5000);
                }
        }
        ASSERT_EQ(queue.size(), queued.size());
    }
}

TEST(WorkQueue, ClosingWakesWhoWaitsAndRefusesWhoComes) {
    WorkQueue queue(8);
    std::optional<JobTurn> popped = JobTurn{};
    {
        const std::jthread waiting([&] { popped = queue.pop(); });
        queue.close();
    }
    EXPECT_FALSE(popped);
    EXPECT_FALSE(queue.push(1, {.priority = 0}));
    EXPECT_FALSE(queue.pop());
}

}  // namespace
}  // namespace terrane
