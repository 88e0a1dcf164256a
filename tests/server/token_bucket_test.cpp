#include "server/net/token_bucket.h"

#include <gtest/gtest.h>

namespace terrane {
namespace {

using namespace std::chrono_literals;

TEST(TokenBucket, WithoutARateThereIsAlwaysSome) {
    TokenBucket bucket(0, 0, {});
    bucket.take(1e18);
    EXPECT_TRUE(bucket.has());
    EXPECT_EQ(bucket.ready_at(), TokenBucket::Clock::time_point{});
}

TEST(TokenBucket, KeepsItsRateWhateverTheSteps) {
    TokenBucket::Clock::time_point now{};
    TokenBucket bucket(1000, 250, now);
    double spent = 0;
    for (int step = 0; step < 1000; ++step) {
        now += 10ms;
        bucket.refill(now);
        while (bucket.has()) {
            bucket.take(70);
            spent += 70;
        }
    }
    EXPECT_NEAR(spent, 10'000 + 250, 140);
}

TEST(TokenBucket, SaysWhenThereWillBeSome) {
    TokenBucket::Clock::time_point now{};
    TokenBucket bucket(8000, 2000, now);
    bucket.take(6000);
    EXPECT_FALSE(bucket.has());
    const auto ready = bucket.ready_at();
    EXPECT_NEAR(std::chrono::duration<double>(ready - now).count(), 0.5, 0.001);
    bucket.refill(ready - 1ms);
    EXPECT_FALSE(bucket.has());
    bucket.refill(ready);
    EXPECT_TRUE(bucket.has());
    EXPECT_FALSE(bucket.has(1)) << "and not more than that";
    bucket.refill(now);  // time that runs backwards changes nothing
    EXPECT_TRUE(bucket.has());
}

TEST(TokenBucket, ANewRateKeepsWhatWasOverdrawn) {
    TokenBucket bucket(1000, 250, {});
    bucket.take(1250);
    bucket.set(100, 25);
    EXPECT_NEAR(std::chrono::duration<double>(bucket.ready_at().time_since_epoch()).count(), 10,
                0.01);
    bucket.set(0, 0);
    EXPECT_TRUE(bucket.has());
}

}  // namespace
}  // namespace terrane
