#include "server/cli/rectangle_work.h"

#include "protocol/base/mutex.h"

#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>

namespace terrane {
namespace {

constexpr StackRectangle kRagged = {.x_first = -11, .z_first = -3, .x_end = 10, .z_end = 16};

std::vector<StackPos> all_in_order(const StackBatches& batches) {
    std::vector<StackPos> all;
    std::vector<StackPos> some;
    for (std::size_t i = 0; i < batches.size(); ++i) {
        batches.fill(some, i);
        EXPECT_FALSE(some.empty());
        EXPECT_LE(some.size(), kBatchStacksMax);
        all.insert(all.end(), some.begin(), some.end());
    }
    return all;
}

TEST(StackBatches, HoldEveryStackOfTheRectangleOnce) {
    for (const auto seed : {std::optional<std::uint64_t>(), std::optional<std::uint64_t>(5)}) {
        const auto batches = StackBatches::cut(kRagged, seed);
        ASSERT_TRUE(batches);
        const auto all = all_in_order(*batches);
        EXPECT_EQ(all.size(), 21U * 19U);
        EXPECT_EQ(all.size(), batches->stacks());
        const std::set<StackPos> different(all.begin(), all.end());
        EXPECT_EQ(different.size(), all.size());
        for (const StackPos& stack : all) {
            EXPECT_EQ(stack.lod, 0);
            EXPECT_TRUE(stack.x >= -11 && stack.x < 10 && stack.z >= -3 && stack.z < 16);
        }
    }
}

TEST(StackBatches, ShuffleBySeed) {
    const auto order = [](std::optional<std::uint64_t> seed) {
        return all_in_order(*StackBatches::cut(kRagged, seed));
    };
    EXPECT_EQ(order(1), order(1));
    EXPECT_NE(order(1), order(2));
    EXPECT_NE(order(1), order(std::nullopt));
}

TEST(StackBatches, ReachTheEndsOfTheCoordinates) {
    constexpr std::int64_t kLeast = std::numeric_limits<std::int32_t>::min();
    constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
    const auto batches = StackBatches::cut(
        {.x_first = kMost, .z_first = kLeast, .x_end = kMost + 1, .z_end = kLeast + 1});
    ASSERT_TRUE(batches);
    const auto all = all_in_order(*batches);
    ASSERT_EQ(all.size(), 1U);
    EXPECT_EQ(all[0].x, kMost);
    EXPECT_EQ(all[0].z, kLeast);
}

TEST(StackBatches, RefuseMoreThanTheLimit) {
    constexpr std::int64_t kLeast = std::numeric_limits<std::int32_t>::min();
    constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
    EXPECT_TRUE(StackBatches::cut({.x_first = 0, .z_first = 0, .x_end = 4096, .z_end = 4096}));
    for (const StackRectangle& large :
         {StackRectangle{.x_first = 0, .z_first = 0, .x_end = 4096, .z_end = 4097},
          StackRectangle{.x_first = kLeast, .z_first = 0, .x_end = kMost + 1, .z_end = 1},
          StackRectangle{
              .x_first = kLeast, .z_first = kLeast, .x_end = kMost + 1, .z_end = kMost + 1}}) {
        const auto batches = StackBatches::cut(large);
        ASSERT_FALSE(batches);
        EXPECT_EQ(batches.error().code, ErrorCode::too_large);
    }
}

TEST(ForEachBatch, GivesEveryStackToOneWorker) {
    const auto batches = StackBatches::cut(kRagged);
    ASSERT_TRUE(batches);
    for (const std::size_t workers : {1U, 2U, 4U, 32U}) {
        Mutex mutex;
        std::multiset<StackPos> seen;
        std::atomic<std::size_t> steps_made = 0;
        std::uint64_t last_tick = 0;
        const auto done = for_each_batch(
            *batches, {.count = workers,
                       .make_step = [&]() -> BatchStep {
                           ++steps_made;
                           return [&](std::span<const StackPos> stacks) -> Result<void> {
                               const MutexLock lock(mutex);
                               seen.insert(stacks.begin(), stacks.end());
                               return {};
                           };
                       },
                       .tick =
                           [&](std::uint64_t stacks) {
                               last_tick = stacks;
                               return true;
                           }});
        ASSERT_TRUE(done);
        EXPECT_EQ(*done, batches->stacks());
        EXPECT_EQ(last_tick, batches->stacks());
        EXPECT_EQ(steps_made, workers);
        EXPECT_EQ(seen.size(), batches->stacks());
        EXPECT_EQ(std::set<StackPos>(seen.begin(), seen.end()).size(), seen.size());
    }
}

BatchWorkers workers_with(BatchStep step) {
    return {.count = 2, .make_step = [step] { return step; }, .tick = {}};
}

TEST(ForEachBatch, EndsWithTheFirstFailure) {
    const auto batches = StackBatches::cut(kRagged);
    ASSERT_TRUE(batches);
    const auto done =
        for_each_batch(*batches, workers_with([](std::span<const StackPos>) -> Result<void> {
            return fail(ErrorCode::io_error, "the disk is full");
        }));
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error(), (Error{.code = ErrorCode::io_error, .message = "the disk is full"}));
}

TEST(ForEachBatch, TurnsAnExceptionIntoAFailure) {
    const auto batches = StackBatches::cut(kRagged);
    ASSERT_TRUE(batches);
    const auto done =
        for_each_batch(*batches, workers_with([](std::span<const StackPos>) -> Result<void> {
            throw std::runtime_error("a library threw");
        }));
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, ErrorCode::internal);
    EXPECT_EQ(done.error().message, "a library threw");
}

TEST(ForEachBatch, StopsWhenTheTickSaysSo) {
    const auto batches =
        StackBatches::cut({.x_first = 0, .z_first = 0, .x_end = 1024, .z_end = 1024});
    ASSERT_TRUE(batches);
    std::atomic<bool> released = false;
    int ticks = 0;
    // The steps wait until the stop has been taken in, so it always comes before the end.
    const auto done =
        for_each_batch(*batches, {.count = 2,
                                  .make_step = [&]() -> BatchStep {
                                      return [&](std::span<const StackPos>) -> Result<void> {
                                          released.wait(false);
                                          return {};
                                      };
                                  },
                                  .tick =
                                      [&](std::uint64_t) {
                                          if (++ticks == 2) {
                                              released = true;
                                              released.notify_all();
                                          }
                                          return false;
                                      }});
    ASSERT_TRUE(done);
    EXPECT_LE(*done, 2 * kBatchStacksMax) << "the batches under way, no others";
}

TEST(ForEachBatch, EndsWhenAWorkerCannotBeMade) {
    const auto batches = StackBatches::cut(kRagged);
    ASSERT_TRUE(batches);
    std::atomic<int> made = 0;
    const auto done = for_each_batch(
        *batches, {.count = 3,
                   .make_step = [&]() -> BatchStep {
                       if (made++ == 1) {
                           throw std::runtime_error("no room for a step");
                       }
                       return [](std::span<const StackPos>) -> Result<void> { return {}; };
                   },
                   .tick = {}});
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().message, "no room for a step");
}

TEST(ForEachBatch, EndsWhenItsTickThrows) {
    const auto batches = StackBatches::cut(kRagged);
    ASSERT_TRUE(batches);
    const auto done = for_each_batch(
        *batches, {.count = 2,
                   .make_step = []() -> BatchStep {
                       return [](std::span<const StackPos>) -> Result<void> { return {}; };
                   },
                   .tick = [](std::uint64_t) -> bool { throw std::runtime_error("no tick"); }});
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().message, "no tick");
}

}  // namespace
}  // namespace terrane
