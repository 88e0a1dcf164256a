#include "server/chunks/work_queue.h"

#include <gtest/gtest.h>

#include <limits>
#include <thread>

namespace terrane {
namespace {

TEST(WorkQueue, GivesTheHighestPriorityFirstAndEqualsInTheirOrder) {
    WorkQueue queue(8);
    EXPECT_TRUE(queue.push(1, 0));
    EXPECT_TRUE(queue.push(2, 5));
    EXPECT_TRUE(queue.push(3, 0));
    EXPECT_TRUE(queue.push(4, 5));
    EXPECT_TRUE(queue.push(5, -3));
    for (const JobId expected : {2U, 4U, 1U, 3U, 5U}) {
        EXPECT_EQ(queue.pop(), expected);
    }
    EXPECT_EQ(queue.size(), 0U);
}

TEST(WorkQueue, OrdersTheExtremesOfPriority) {
    WorkQueue queue(8);
    EXPECT_TRUE(queue.push(1, std::numeric_limits<std::int32_t>::min()));
    EXPECT_TRUE(queue.push(2, std::numeric_limits<std::int32_t>::max()));
    EXPECT_EQ(queue.pop(), 2U);
    EXPECT_EQ(queue.pop(), 1U);
}

TEST(WorkQueue, RefusesAtItsBoundUntilThereIsRoom) {
    WorkQueue queue(2);
    EXPECT_TRUE(queue.push(1, 0));
    EXPECT_TRUE(queue.push(2, 0));
    EXPECT_FALSE(queue.push(3, 9));
    EXPECT_EQ(queue.size(), 2U);
    EXPECT_EQ(queue.pop(), 1U);
    EXPECT_TRUE(queue.push(3, 9));
    EXPECT_EQ(queue.pop(), 3U);
}

TEST(WorkQueue, TakesAnUnfinishedJobBackAtItsBound) {
    WorkQueue queue(1);
    EXPECT_TRUE(queue.push(1, 0));
    EXPECT_EQ(queue.pop(), 1U);
    EXPECT_TRUE(queue.push(2, 0));
    queue.put_back(1, 0);
    EXPECT_EQ(queue.pop(), 2U);
    EXPECT_EQ(queue.pop(), 1U);
}

TEST(WorkQueue, RaisesAJobButNeverLowersIt) {
    WorkQueue queue(8);
    EXPECT_TRUE(queue.push(1, 3));
    EXPECT_TRUE(queue.push(2, 2));
    EXPECT_TRUE(queue.push(3, 1));
    queue.raise(3, 4);
    queue.raise(1, 0);
    queue.raise(99, 7);
    EXPECT_TRUE(queue.push(2, 3));
    for (const JobId expected : {3U, 1U, 2U}) {
        EXPECT_EQ(queue.pop(), expected);
    }
}

TEST(WorkQueue, ForgetsARemovedJob) {
    WorkQueue queue(8);
    EXPECT_TRUE(queue.push(1, 0));
    EXPECT_TRUE(queue.push(2, 0));
    queue.remove(1);
    queue.remove(7);
    EXPECT_EQ(queue.size(), 1U);
    EXPECT_EQ(queue.pop(), 2U);
}

TEST(WorkQueue, ClosingWakesWhoWaitsAndRefusesWhoComes) {
    WorkQueue queue(8);
    std::optional<JobId> popped = 1;
    {
        const std::jthread waiting([&] { popped = queue.pop(); });
        queue.close();
    }
    EXPECT_FALSE(popped);
    EXPECT_FALSE(queue.push(1, 0));
    EXPECT_FALSE(queue.pop());
}

}  // namespace
}  // namespace terrane
