#include "server/log.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace terrane {
namespace {

TEST(Log, TextIsOneLineWhateverIsInIt) {
    EXPECT_EQ(text_line("session ended", {{"client", std::string("a\nb\x1b[31m")},
                                          {"count", std::int64_t{-3}},
                                          {"share", 0.5}}),
              "session ended client=a?b?[31m count=-3 share=0.5");
}

TEST(Log, JsonIsOneObjectALineWhateverIsInIt) {
    const std::string line = json_line("2013-01-02T03:04:05.678Z", "info", "quote \" and\nline",
                                       {{"bytes", std::uint64_t{18446744073709551615U}},
                                        {"name", std::string("\xff\xfe not UTF-8")}});
    EXPECT_EQ(line.find('\n'), std::string::npos);
    const auto json = nlohmann::json::parse(line);
    EXPECT_EQ(json["time"], "2013-01-02T03:04:05.678Z");
    EXPECT_EQ(json["level"], "info");
    EXPECT_EQ(json["message"], "quote \" and\nline");
    EXPECT_EQ(json["bytes"], 18446744073709551615U);
}

TEST(Log, KnowsItsFormatsAndLevels) {
    EXPECT_EQ(parse_log_format("json"), LogFormat::json);
    EXPECT_EQ(parse_log_level("warning"), LogLevel::warning);
    EXPECT_FALSE(parse_log_format("xml"));
    EXPECT_FALSE(parse_log_level("loud"));
}

}  // namespace
}  // namespace terrane
