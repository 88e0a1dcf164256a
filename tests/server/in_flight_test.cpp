#include "server/chunks/in_flight.h"

#include <gtest/gtest.h>

namespace terrane {
namespace {

using Admitted = InFlight::Admitted;

WorkKey chunk(std::int32_t x, std::int32_t y) {
    return ChunkKey{.position = {.lod = 0, .x = x, .y = y, .z = 0}};
}

InFlight::Admission admit(InFlight& table, const WorkKey& key, WaiterId waiter,
                          std::int32_t priority = 0, FlowId flow = 0) {
    return table.admit(key, stack_of(key, 32), priority,
                       {.id = waiter, .answer = {}, .flow = flow});
}

constexpr InFlight::Bounds kRoomy{.keys_max = 100, .waiters_max = 100};

TEST(InFlight, OneKeyIsOneTaskHoweverManyWait) {
    InFlight table(kRoomy);
    const auto first = admit(table, chunk(0, 0), 1);
    EXPECT_EQ(first.outcome, Admitted::new_job);
    EXPECT_EQ(admit(table, chunk(0, 0), 2).outcome, Admitted::joined_key);
    const auto task = table.next(first.job);
    ASSERT_TRUE(task);
    EXPECT_EQ(admit(table, chunk(0, 0), 3).outcome, Admitted::joined_key);
    EXPECT_EQ(table.finish(*task).size(), 3U);
    EXPECT_FALSE(table.next(first.job));
    EXPECT_EQ(table.size(), 0U);
}

TEST(InFlight, TheOldestIsAsOldAsItsFirstAsking) {
    InFlight table(kRoomy);
    EXPECT_EQ(table.oldest().count(), 0);
    const auto before = std::chrono::steady_clock::now();
    const auto first = admit(table, chunk(0, 0), 1);
    const auto between = std::chrono::steady_clock::now();
    admit(table, chunk(1, 0), 2);
    const auto oldest = table.oldest();
    EXPECT_GE(oldest, std::chrono::steady_clock::duration::zero());
    EXPECT_LE(oldest, std::chrono::steady_clock::now() - before);
    const auto task = table.next(first.job);
    ASSERT_TRUE(task);
    table.finish(*task);
    // Before the clock is read again, whatever the order of arguments.
    const auto second = table.oldest();
    EXPECT_LE(second, std::chrono::steady_clock::now() - between) << "the second's";
}

TEST(InFlight, OneStackIsOneJobInTheOrderOfAsking) {
    InFlight table(kRoomy);
    const auto first = admit(table, chunk(0, 3), 1);
    const auto second = admit(table, chunk(0, 1), 2);
    const auto column = admit(table, ColumnPos{.x = 31, .z = 0}, 3);
    EXPECT_EQ(second.outcome, Admitted::joined_job);
    EXPECT_EQ(column.outcome, Admitted::joined_job);
    EXPECT_EQ(second.job, first.job);
    EXPECT_EQ(admit(table, chunk(1, 0), 4).outcome, Admitted::new_job);
    EXPECT_EQ(table.next(first.job)->key, chunk(0, 3));
    EXPECT_EQ(table.next(first.job)->key, chunk(0, 1));
    EXPECT_EQ(table.next(first.job)->key, WorkKey(ColumnPos{.x = 31, .z = 0}));
}

TEST(InFlight, AKeyThatComesWhileItsStackRunsStaysInTheJob) {
    InFlight table(kRoomy);
    const auto job = admit(table, chunk(0, 0), 1).job;
    const auto task = table.next(job);
    EXPECT_EQ(admit(table, chunk(0, 1), 2).outcome, Admitted::joined_job);
    table.finish(*task);
    EXPECT_EQ(table.next(job)->key, chunk(0, 1));
}

TEST(InFlight, AJobThatEndedIsFollowedByANewOne) {
    InFlight table(kRoomy);
    const auto job = admit(table, chunk(0, 0), 1).job;
    table.finish(*table.next(job));
    EXPECT_FALSE(table.next(job));
    const auto again = admit(table, chunk(0, 0), 2);
    EXPECT_EQ(again.outcome, Admitted::new_job);
    EXPECT_NE(again.job, job);
}

TEST(InFlight, TheLastWaiterToLeaveStopsTheWork) {
    InFlight table(kRoomy);
    const auto job = admit(table, chunk(0, 0), 1).job;
    admit(table, chunk(0, 0), 2);
    const auto task = table.next(job);
    EXPECT_FALSE(table.leave(chunk(0, 0), 1).stopped);
    EXPECT_FALSE(task->stop.stop_requested());
    EXPECT_TRUE(table.leave(chunk(0, 0), 2).stopped);
    EXPECT_TRUE(task->stop.stop_requested());
    EXPECT_TRUE(table.finish(*task).empty());
}

TEST(InFlight, AJobNobodyTookIsIdleWhenItsLastKeyGoes) {
    InFlight table(kRoomy);
    const auto job = admit(table, chunk(0, 0), 1).job;
    admit(table, chunk(0, 1), 2);
    EXPECT_FALSE(table.leave(chunk(0, 0), 1).idle_job);
    EXPECT_EQ(table.leave(chunk(0, 1), 2).idle_job, job);
    EXPECT_FALSE(table.next(job));
}

TEST(InFlight, ALateResultDoesNotAnswerItsSuccessor) {
    InFlight table(kRoomy);
    const auto job = admit(table, chunk(0, 0), 1).job;
    const auto stopped = table.next(job);
    table.leave(chunk(0, 0), 1);
    const auto again = admit(table, chunk(0, 0), 2);
    EXPECT_EQ(again.outcome, Admitted::joined_job);  // the worker still holds the stack's job
    EXPECT_TRUE(table.finish(*stopped).empty());
    const auto task = table.next(job);
    ASSERT_TRUE(task);
    EXPECT_FALSE(task->stop.stop_requested());
    const auto waiters = table.finish(*task);
    ASSERT_EQ(waiters.size(), 1U);
    EXPECT_EQ(waiters[0].id, 2U);
}

TEST(InFlight, RefusesAtItsBounds) {
    InFlight keys({.keys_max = 1, .waiters_max = 100});
    admit(keys, chunk(0, 0), 1);
    EXPECT_EQ(admit(keys, chunk(0, 1), 2).outcome, Admitted::refused);
    EXPECT_EQ(admit(keys, chunk(0, 0), 3).outcome, Admitted::joined_key);
    InFlight waiters({.keys_max = 100, .waiters_max = 2});
    admit(waiters, chunk(0, 0), 1);
    admit(waiters, chunk(0, 0), 2);
    EXPECT_EQ(admit(waiters, chunk(0, 0), 3).outcome, Admitted::refused);
    EXPECT_TRUE(waiters.leave(chunk(0, 0), 2).found);
    EXPECT_EQ(admit(waiters, chunk(0, 0), 3).outcome, Admitted::joined_key);
}

TEST(InFlight, AJobIsAsUrgentToAFlowAsItsMostUrgentKey) {
    InFlight table(kRoomy);
    EXPECT_EQ(admit(table, chunk(0, 0), 1, -5).claim.priority, -5);
    EXPECT_EQ(admit(table, chunk(0, 1), 2, 7).claim.priority, 7);
    const auto last = admit(table, chunk(0, 0), 3, 2);
    EXPECT_EQ(last.claim.priority, 7);
    const auto other = admit(table, chunk(0, 0), 4, 1, 9);
    EXPECT_EQ(other.claim, (JobClaim{.flow = 9, .priority = 1}));
    EXPECT_EQ(table.claims_of(last.job),
              (std::vector<JobClaim>{{.flow = 0, .priority = 7}, {.flow = 9, .priority = 1}}));
}

TEST(InFlight, AFlowsInterestChangesAndEndsWithItsLastWaiter) {
    InFlight table(kRoomy);
    const auto job = admit(table, chunk(0, 0), 1, 5, 3).job;
    admit(table, chunk(0, 1), 2, 5, 3);
    admit(table, chunk(0, 0), 3, 0, 4);
    const auto changed = table.change(chunk(0, 0), 1, -2);
    ASSERT_TRUE(changed);
    EXPECT_EQ(changed->job, job);
    EXPECT_EQ(changed->claim, (JobClaim{.flow = 3, .priority = -2}));
    EXPECT_FALSE(table.change(chunk(0, 0), 2, 1)) << "it waits for another key";
    EXPECT_FALSE(table.change(chunk(7, 0), 1, 1));
    EXPECT_FALSE(table.leave(chunk(0, 0), 1).withdrawn);
    const auto left = table.leave(chunk(0, 1), 2);
    ASSERT_TRUE(left.withdrawn);
    EXPECT_EQ(left.withdrawn->claim.flow, 3U);
    EXPECT_EQ(table.claims_of(job), (std::vector<JobClaim>{{.flow = 4, .priority = 0}}));
    table.finish(*table.next(job));
    EXPECT_TRUE(table.claims_of(job).empty());
}

TEST(InFlight, AbandoningAJobGivesAllItsWaiters) {
    InFlight table(kRoomy);
    const auto job = admit(table, chunk(0, 0), 1).job;
    admit(table, chunk(0, 1), 2);
    admit(table, chunk(0, 1), 3);
    admit(table, chunk(5, 0), 4);
    EXPECT_EQ(table.abandon(job).size(), 3U);
    EXPECT_EQ(table.size(), 1U);
    EXPECT_EQ(table.abandon_all().size(), 1U);
    EXPECT_EQ(table.size(), 0U);
}

}  // namespace
}  // namespace terrane
