#include "server/cli/progress.h"

#include <gtest/gtest.h>

#include <limits>
#include <memory>

namespace terrane {
namespace {

using namespace std::chrono_literals;

TEST(Progress, WritesDurationsAsPeopleDo) {
    EXPECT_EQ(format_duration(0.0), "0:00");
    EXPECT_EQ(format_duration(7.9), "0:07");
    EXPECT_EQ(format_duration(754.0), "12:34");
    EXPECT_EQ(format_duration(11045.0), "3:04:05");
    EXPECT_EQ(format_duration(std::nullopt), "-");
    EXPECT_EQ(format_duration(1e300), "-");
    EXPECT_EQ(format_duration(-1.0), "-");
    EXPECT_EQ(format_duration(std::numeric_limits<double>::quiet_NaN()), "-");
}

TEST(Progress, DrawsABarWithRateAndEta) {
    EXPECT_EQ(progress_bar({.done = 1234, .total = 4096, .unit = "stacks", .per_second = 56.7}),
              "[######--------------]  30 %  1234/4096 stacks  56.7/s  ETA 0:50");
    EXPECT_EQ(progress_bar({.done = 0, .total = 64, .unit = "stacks", .per_second = std::nullopt}),
              "[--------------------]   0 %  0/64 stacks  -/s  ETA -");
    EXPECT_EQ(progress_bar({.done = 64, .total = 64, .unit = "stacks", .per_second = 10.0}),
              "[####################] 100 %  64/64 stacks  10.0/s  ETA 0:00");
}

TEST(Progress, WritesALineWithRateAndEta) {
    EXPECT_EQ(progress_line({.done = 1234, .total = 4096, .unit = "stacks", .per_second = 56.7}),
              "1234 of 4096 stacks (30 %), 56.7/s, ETA 0:50");
}

std::string shown(bool is_terminal) {
    char* text = nullptr;
    std::size_t size = 0;
    std::FILE* out = open_memstream(&text, &size);
    const auto begin = Progress::Clock::now();
    Progress progress(1000, "stacks", out, is_terminal);
    for (int second = 0; second <= 25; ++second) {
        progress.show(static_cast<std::uint64_t>(second) * 10, begin + second * 1s);
    }
    progress.finish();
    std::fclose(out);
    const std::unique_ptr<char, void (*)(void*)> owned(text, &std::free);
    return {text, size};
}

TEST(Progress, ShowsALineEveryTenSecondsWhereThereIsNoTerminal) {
    EXPECT_EQ(shown(false),
              "110 of 1000 stacks (11 %), 10.0/s, ETA 1:29\n"
              "210 of 1000 stacks (21 %), 10.0/s, ETA 1:19\n");
}

TEST(Progress, RedrawsOneLineOnATerminalAndClearsIt) {
    const std::string text = shown(true);
    EXPECT_EQ(text.find('\n'), std::string::npos);
    EXPECT_NE(text.find("\r[#####---------------]  25 %  250/1000 stacks  10.0/s  ETA 1:15"),
              std::string::npos);
    EXPECT_TRUE(text.ends_with("\r\x1b[K"));
}

}  // namespace
}  // namespace terrane
