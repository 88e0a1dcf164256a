// WebSocket frames, byte by byte.
#include "server/net/websocket_frames.h"

#include <gtest/gtest.h>

namespace terrane {
namespace {

Bytes bytes(std::initializer_list<int> values) {
    Bytes out;
    for (const int value : values) {
        out.push_back(static_cast<std::byte>(value));
    }
    return out;
}

struct Read {
    Bytes data;
    std::vector<WebSocketControl> control;
    Result<void> outcome;
};

/// Feeds pieces of `step` bytes.
Read read(const Bytes& input, std::size_t step) {
    WebSocketReader reader;
    Read out;
    for (std::size_t at = 0; at < input.size() && out.outcome; at += step) {
        out.outcome = reader.feed(out.data, out.control,
                                  std::span(input).subspan(at, std::min(step, input.size() - at)));
    }
    return out;
}

TEST(WebSocketFrames, AcceptsTheHandshakeOfTheStandard) {
    EXPECT_EQ(websocket_accept("dGhlIHNhbXBsZSBub25jZQ=="), "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
    EXPECT_TRUE(is_websocket_key("dGhlIHNhbXBsZSBub25jZQ=="));
    for (const char* key : {"", "abc", "dGhlIHNhbXBsZSBub25jZQ=", "dGhlIHNhbXBsZSBub25jZ\r=="}) {
        EXPECT_FALSE(is_websocket_key(key)) << key;
    }
}

TEST(WebSocketFrames, WritesTheShortestLength) {
    std::array<std::byte, kServerFrameHeadMax> head{};
    const auto written = [&](std::uint64_t size) {
        const std::size_t count = write_frame_head(head, WebSocketOpcode::binary, size);
        return Bytes(head.begin(), head.begin() + static_cast<std::ptrdiff_t>(count));
    };
    EXPECT_EQ(written(125), bytes({0x82, 125}));
    EXPECT_EQ(written(126), bytes({0x82, 126, 0, 126}));
    EXPECT_EQ(written(65535), bytes({0x82, 126, 0xFF, 0xFF}));
    EXPECT_EQ(written(65536), bytes({0x82, 127, 0, 0, 0, 0, 0, 1, 0, 0}));
}

TEST(WebSocketFrames, ReadsFragmentsWithControlBetweenHoweverTheyAreCut) {
    // "Hel" + ping "!" + "lo", the masking key of RFC 6455, 5.7.
    const Bytes input = bytes({0x02, 0x83, 0x37, 0xfa, 0x21, 0x3d, 0x7f, 0x9f, 0x4d,  //
                               0x89, 0x81, 0,    0,    0,    0,    '!',               //
                               0x80, 0x82, 0,    0,    0,    0,    'l',  'o',         //
                               0x82, 0x80, 1,    2,    3,    4});
    for (std::size_t step = 1; step <= input.size(); ++step) {
        const Read out = read(input, step);
        ASSERT_TRUE(out.outcome) << step;
        EXPECT_EQ(text_of(out.data), "Hello");
        ASSERT_EQ(out.control.size(), 1U);
        EXPECT_EQ(out.control[0].opcode, WebSocketOpcode::ping);
        EXPECT_EQ(out.control[0].size_bytes, 1U);
        EXPECT_EQ(out.control[0].payload[0], std::byte{'!'});
    }
}

TEST(WebSocketFrames, RefusesWhatTheStandardForbids) {
    const std::vector<Bytes> bad = {
        bytes({0x82, 0x01, 'a'}),                                       // not masked
        bytes({0xC2, 0x81, 0, 0, 0, 0, 'a'}),                           // a reserved bit
        bytes({0x83, 0x81, 0, 0, 0, 0, 'a'}),                           // an unknown opcode
        bytes({0x80, 0x81, 0, 0, 0, 0, 'a'}),                           // goes on, never began
        bytes({0x02, 0x80, 0, 0, 0, 0, 0x02, 0x80, 0, 0, 0, 0}),        // begins inside another
        bytes({0x09, 0x80, 0, 0, 0, 0}),                                // a ping that is cut up
        bytes({0x89, 0xFE, 0, 126, 0, 0, 0, 0}),                        // a ping that is too long
        bytes({0x82, 0xFE, 0, 125, 0, 0, 0, 0}),                        // a length too long
        bytes({0x82, 0xFF, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0, 0, 0, 0}),  // likewise
        bytes({0x82, 0xFF, 0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}),     // 2^63
        bytes({0x81, 0x81, 0, 0, 0, 0, 'a'}),                           // text
    };
    for (std::size_t i = 0; i < bad.size(); ++i) {
        EXPECT_FALSE(read(bad[i], 1).outcome) << i;
        EXPECT_FALSE(read(bad[i], bad[i].size()).outcome) << i;
    }
}

}  // namespace
}  // namespace terrane
