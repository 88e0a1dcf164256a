// Tokens: the file, and who is let in.
#include "server/net/tokens.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <set>

namespace terrane {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

const std::chrono::sys_seconds kNow{std::chrono::sys_days(std::chrono::year(2027) / 1 / 1)};
constexpr Hash128 kWorld{.high = 1, .low = 2};

TokenEntry entry(std::string name, std::string_view token) {
    TokenEntry out;
    out.name = std::move(name);
    out.hash = sha256_of(token);
    return out;
}

std::string refusal(const TokenGate& gate, std::string_view token) {
    const auto caps = gate.admit(token, kNow);
    EXPECT_FALSE(caps) << token;
    EXPECT_TRUE(caps || caps.error().code == ErrorCode::unauthorized);
    return caps ? "" : caps.error().message;
}

TEST(TokenGate, LetsInWhoIsKnownAndNobodyElse) {
    TokenEntry late = entry("late", "late-token");
    late.expires = kNow;
    TokenEntry early = entry("early", "early-token");
    early.expires = kNow + 1s;
    early.caps.view_radius_max = 4;
    TokenEntry foreign = entry("foreign", "foreign-token");
    foreign.world = Hash128{.high = 1, .low = 3};
    TokenEntry local = entry("local", "local-token");
    local.world = kWorld;
    const TokenGate gate({.anonymous = false, .world = kWorld},
                         {entry("plain", "plain-token"), late, early, foreign, local});
    EXPECT_TRUE(gate.admit("plain-token", kNow));
    EXPECT_TRUE(gate.admit("local-token", kNow));
    ASSERT_TRUE(gate.admit("early-token", kNow));
    EXPECT_EQ(gate.admit("early-token", kNow)->view_radius_max, 4U);
    EXPECT_THAT(refusal(gate, ""), HasSubstr("needed"));
    for (const char* token : {"plain-toke", "plain-tokenn", "x", "plain"}) {
        EXPECT_THAT(refusal(gate, token), HasSubstr("not known"));
    }
    EXPECT_THAT(refusal(gate, "late-token"), HasSubstr("2027-01-01T00:00:00Z"));
    EXPECT_THAT(refusal(gate, "foreign-token"), HasSubstr("another world"));
}

TEST(TokenGate, LetsAnonymousInIfItMayButNotWrongTokens) {
    TokenGate gate({.anonymous = true, .world = kWorld}, {entry("a", "right")});
    EXPECT_TRUE(gate.admit("", kNow));
    EXPECT_TRUE(gate.admit("right", kNow));
    refusal(gate, "wrong");
    gate.replace({entry("b", "other")});
    refusal(gate, "right");
    EXPECT_TRUE(gate.admit("other", kNow));
}

TEST(Tokens, ComeInRequestsInTwoWays) {
    EXPECT_EQ(token_of("Bearer abc", "token=def"), "abc");
    EXPECT_EQ(token_of("", "a=1&token=def"), "def");
    EXPECT_EQ(token_of("Basic abc", ""), "");
    EXPECT_EQ(token_of("Bearer ", ""), "");
}

TEST(Tokens, AreRandomAndLong) {
    std::set<std::string> tokens;
    for (int i = 0; i < 100; ++i) {
        const auto token = new_token();
        ASSERT_TRUE(token);
        EXPECT_EQ(token->size(), 43U);
        EXPECT_TRUE(tokens.insert(*token).second);
    }
}

TEST(TokenFile, ReadsBackWhatWasAdded) {
    std::string folder =
        (std::filesystem::temp_directory_path() / "terrane-tokens-XXXXXX").string();
    ASSERT_NE(::mkdtemp(folder.data()), nullptr);
    const std::filesystem::path path = std::filesystem::path(folder) / "tokens.toml";
    TokenEntry first = entry("with \"quotes\" and \\", "one");
    first.expires = kNow;
    first.world = kWorld;
    first.caps = {.view_radius_max = 1,
                  .bytes_per_second_max = 2,
                  .requests_per_second_max = 3,
                  .credit_window_bytes = 4};
    ASSERT_TRUE(add_token(path, first));
    ASSERT_TRUE(add_token(path, entry("second", "two")));
    const auto twice = add_token(path, entry("second", "three"));
    ASSERT_FALSE(twice);
    EXPECT_THAT(twice.error().message, HasSubstr("two tokens have this name"));
    const auto read = read_tokens(path);
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read->size(), 2U);
    EXPECT_EQ((*read)[0].name, first.name);
    EXPECT_EQ((*read)[0].hash, first.hash);
    EXPECT_EQ((*read)[0].expires, first.expires);
    EXPECT_EQ((*read)[0].world, first.world);
    EXPECT_EQ((*read)[0].caps, first.caps);
    EXPECT_EQ((*read)[1].hash, sha256_of("two"));
    EXPECT_EQ(std::filesystem::status(path).permissions() & std::filesystem::perms::others_read,
              std::filesystem::perms::none);
    std::filesystem::remove_all(folder);
}

TEST(TokenFile, NamesEveryFaultAndItsPlace) {
    const auto read = parse_tokens(
        "[[token]]\nnmae = \"a\"\nsha256 = \"12\"\nexpires = 2027-01-01\n[[token]]\nname = 3\n",
        "t.toml");
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error().code, ErrorCode::invalid_argument);
    for (const char* fault :
         {"t.toml:2:1: token.nmae: is not a known key; the nearest known one is \"name\"",
          "t.toml:3:10: token.sha256: the token's SHA-256 is needed", "t.toml:4:11: token.expires",
          "t.toml:6:8: token.name: it must be a text"}) {
        EXPECT_THAT(read.error().message, HasSubstr(fault));
    }
    EXPECT_TRUE(parse_tokens("", "t.toml"));
    EXPECT_FALSE(parse_tokens("[[token]\n", "t.toml"));
    EXPECT_FALSE(parse_tokens("token = 3\n", "t.toml"));
}

}  // namespace
}  // namespace terrane
