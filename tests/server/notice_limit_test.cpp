#include "server/notice_limit.h"

#include <gtest/gtest.h>

namespace terrane {
namespace {

TEST(NoticeLimit, AllowsTheFirstAndThenOneAnInterval) {
    using namespace std::chrono_literals;
    NoticeLimit limit(60s);
    const NoticeLimit::Clock::time_point begin(100s);
    EXPECT_TRUE(limit.allows(begin));
    EXPECT_FALSE(limit.allows(begin));
    EXPECT_FALSE(limit.allows(begin + 59s));
    EXPECT_TRUE(limit.allows(begin + 60s));
    EXPECT_FALSE(limit.allows(begin + 119s));
}

}  // namespace
}  // namespace terrane
