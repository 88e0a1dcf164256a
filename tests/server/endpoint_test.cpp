#include "server/net/endpoint.h"

#include <gtest/gtest.h>

namespace terrane {
namespace {

TEST(Endpoint, ReadsAddressesAndPorts) {
    EXPECT_EQ(*parse_endpoint("127.0.0.1:7777"), (Endpoint{.address = "127.0.0.1", .port = 7777}));
    EXPECT_EQ(*parse_endpoint("0.0.0.0:0"), (Endpoint{.address = "0.0.0.0", .port = 0}));
    EXPECT_EQ(*parse_endpoint("[::1]:65535"), (Endpoint{.address = "::1", .port = 65535}));
    EXPECT_EQ(*parse_endpoint("localhost:1"), (Endpoint{.address = "127.0.0.1", .port = 1}));
}

TEST(Endpoint, IsWrittenAsItIsRead) {
    for (const char* text : {"127.0.0.1:7777", "[::1]:80", "0.0.0.0:0"}) {
        EXPECT_EQ(to_string(*parse_endpoint(text)), text);
    }
}

TEST(Endpoint, RefusesEverythingElse) {
    for (const char* text : {"", ":", "7777", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536",
                             "127.0.0.1:-1", "127.0.0.1:7a", "127.0.0.1: 7", "::1:80", "[::1]",
                             "[]:80", "[127.0.0.1]:80", ":80", "host.example:80", "256.0.0.1:80"}) {
        const auto endpoint = parse_endpoint(text);
        ASSERT_FALSE(endpoint) << text;
        EXPECT_EQ(endpoint.error().code, ErrorCode::invalid_argument);
        EXPECT_NE(endpoint.error().message.find(text), std::string::npos);
    }
}

TEST(Endpoint, KnowsWhatOnlyThisMachineReaches) {
    EXPECT_TRUE(is_loopback({.address = "127.0.0.1", .port = 1}));
    EXPECT_TRUE(is_loopback({.address = "127.9.9.9", .port = 1}));
    EXPECT_TRUE(is_loopback({.address = "::1", .port = 1}));
    EXPECT_FALSE(is_loopback({.address = "0.0.0.0", .port = 1}));
    EXPECT_FALSE(is_loopback({.address = "192.168.0.1", .port = 1}));
}

}  // namespace
}  // namespace terrane
