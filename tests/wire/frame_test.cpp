#include "protocol/wire/frame.h"

#include "protocol/wire/messages.h"
#include "tests/wire/sample_messages.h"

#include <gtest/gtest.h>

#include <cstring>
#include <span>
#include <string>
#include <string_view>

namespace terrane {
namespace {

Bytes full_chunk() {
    Bytes bytes = encode_message(ChunkAnswer{.request_id = 3,
                                             .key = {.lod = 0, .x = 1, .y = -2, .z = 3},
                                             .format = ChunkFormat::draco,
                                             .status = ChunkStatus::full,
                                             .source = ChunkSource::generated,
                                             .etag = {.high = 1, .low = 2},
                                             .timings = {},
                                             .payload_bytes = 5,
                                             .uniform = {}});
    for (int i = 0; i < 5; ++i) {
        bytes.push_back(static_cast<std::byte>(i));
    }
    return bytes;
}

void set_u32(Bytes& bytes, std::size_t at, std::uint32_t value) {
    std::memcpy(bytes.data() + at, &value, sizeof(value));
}

/// Feeds everything and reads all frames; the error, if there is one.
std::optional<Error> drain(FrameReader& reader, std::span<const std::byte> bytes) {
    reader.feed(bytes);
    for (;;) {
        const auto frame = reader.next();
        if (!frame) {
            return frame.error();
        }
        if (!*frame) {
            return std::nullopt;
        }
        (void)decode_message(**frame);  // whatever passed the Verifier must be safe to read
    }
}

TEST(Frame, IsFoundInPiecesOfAnySize) {
    Bytes stream;
    std::vector<AnyMessage> sent;
    for (const AnyMessage& message : sample_messages()) {
        const Bytes bytes = encode_message(message);
        stream.insert(stream.end(), bytes.begin(), bytes.end());
        sent.push_back(message);
    }
    for (const std::size_t piece :
         {std::size_t{1}, std::size_t{3}, std::size_t{64}, stream.size()}) {
        FrameReader reader(kOutboundFrameLimits);
        std::vector<AnyMessage> received;
        for (std::size_t at = 0; at < stream.size(); at += piece) {
            reader.feed(std::span(stream).subspan(at, std::min(piece, stream.size() - at)));
            for (;;) {
                const auto frame = reader.next();
                ASSERT_TRUE(frame) << frame.error().message;
                if (!*frame) {
                    break;
                }
                received.push_back(decode_message(**frame).value());
            }
        }
        EXPECT_EQ(received, sent) << "pieces of " << piece;
        EXPECT_EQ(reader.buffered_bytes(), 0U);
    }
}

TEST(Frame, SplitAtEveryByteGivesTheSamePayload) {
    const Bytes bytes = full_chunk();
    for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
        FrameReader reader(kOutboundFrameLimits);
        reader.feed(std::span(bytes).first(cut));
        if (cut < bytes.size()) {
            const auto early = reader.next();
            ASSERT_TRUE(early) << early.error().message;
            EXPECT_FALSE(*early);
            EXPECT_EQ(reader.buffered_bytes(), cut);
        }
        reader.feed(std::span(bytes).subspan(cut));
        const auto frame = reader.next();
        ASSERT_TRUE(frame && *frame);
        EXPECT_TRUE(std::ranges::equal((*frame)->payload, std::span(bytes).last(5)));
    }
}

TEST(Frame, EveryTruncatedPrefixWithACorrectedLengthIsSafe) {
    for (const AnyMessage& message : sample_messages()) {
        const Bytes whole = encode_message(message);
        for (std::size_t size = 4; size < whole.size(); ++size) {
            Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
            set_u32(cut, 0, static_cast<std::uint32_t>(size - 4));
            FrameReader reader(kOutboundFrameLimits);
            EXPECT_TRUE(drain(reader, cut)) << name_of(message) << " cut to " << size;
            if (size >= 8) {  // and with the head's own length corrected as well
                set_u32(cut, 4, static_cast<std::uint32_t>(size - 8));
                FrameReader second(kOutboundFrameLimits);
                drain(second, cut);
            }
        }
    }
}

TEST(Frame, EveryFlippedByteIsRefusedOrReadSafely) {
    for (const AnyMessage& message : sample_messages()) {
        const Bytes whole = encode_message(message);
        for (std::size_t at = 0; at < whole.size(); ++at) {
            for (const unsigned mask : {0xFFU, 0x80U, 0x01U, 0x10U}) {
                Bytes flipped = whole;
                flipped[at] ^= static_cast<std::byte>(mask);
                FrameReader reader(kOutboundFrameLimits);
                drain(reader, flipped);
                EXPECT_LE(reader.buffered_bytes(), whole.size());
            }
        }
    }
}

TEST(Frame, LengthsBeyondTheLimitAreRefusedFromTheirFourBytesAlone) {
    for (const std::uint32_t length :
         {static_cast<std::uint32_t>(kInboundFrameBytesMax) + 1, 0x8000'0000U, 0xFFFF'FFFFU}) {
        Bytes bytes(4);
        set_u32(bytes, 0, length);
        FrameReader reader(kInboundFrameLimits);
        const auto error = drain(reader, bytes);
        ASSERT_TRUE(error) << length;
        EXPECT_EQ(error->code, ErrorCode::too_large);
        EXPECT_NE(error->message.find(std::to_string(length)), std::string::npos);
    }
}

TEST(Frame, AnAnswerOfHttpIsToldFromALongFrame) {
    const std::string_view answer = "HTTP/1.1 400 Bad Request";
    FrameReader reader(kOutboundFrameLimits);
    const auto error = drain(reader, std::as_bytes(std::span(answer)));
    ASSERT_TRUE(error);
    EXPECT_EQ(error->code, ErrorCode::malformed);
    EXPECT_NE(error->message.find("speaks HTTP"), std::string::npos);
}

TEST(Frame, TheGreatestLengthIsWaitedFor) {
    Bytes bytes(4);
    set_u32(bytes, 0, static_cast<std::uint32_t>(kInboundFrameBytesMax));
    FrameReader reader(kInboundFrameLimits);
    EXPECT_FALSE(drain(reader, bytes));
    // Filled with zeros it is a whole frame, and no head.
    const auto error = drain(reader, Bytes(kInboundFrameBytesMax));
    ASSERT_TRUE(error);
    EXPECT_EQ(error->code, ErrorCode::malformed);
}

TEST(Frame, LengthsTooSmallForAHeadAreMalformed) {
    for (std::uint32_t length = 0; length < 12; ++length) {
        Bytes bytes(4);
        set_u32(bytes, 0, length);
        FrameReader reader(kInboundFrameLimits);
        const auto error = drain(reader, bytes);
        ASSERT_TRUE(error) << length;
        EXPECT_EQ(error->code, ErrorCode::malformed);
    }
}

TEST(Frame, AHeadLongerThanItsFrameIsMalformed) {
    for (const std::uint32_t length : {0U, 7U, 60'000U}) {
        Bytes bytes = encode_message(Ping{.nonce = 1});
        set_u32(bytes, 4, length);
        FrameReader reader(kInboundFrameLimits);
        const auto error = drain(reader, bytes);
        ASSERT_TRUE(error) << length;
        EXPECT_EQ(error->code, ErrorCode::malformed);
    }
}

TEST(Frame, AHeadBeyondItsLimitIsTooLarge) {
    for (const std::uint32_t length :
         {static_cast<std::uint32_t>(kInboundFrameBytesMax) - 3, 0x8000'0000U, 0xFFFF'FFFFU}) {
        Bytes bytes = encode_message(Ping{.nonce = 1});
        set_u32(bytes, 4, length);
        FrameReader reader(kInboundFrameLimits);
        const auto error = drain(reader, bytes);
        ASSERT_TRUE(error) << length;
        EXPECT_EQ(error->code, ErrorCode::too_large);
    }
}

TEST(Frame, AnotherFileIdentifierIsMalformed) {
    Bytes bytes = encode_message(Ping{.nonce = 1});
    ASSERT_EQ(static_cast<char>(bytes[12]), 'T');
    bytes[12] = static_cast<std::byte>('X');
    FrameReader reader(kInboundFrameLimits);
    const auto error = drain(reader, bytes);
    ASSERT_TRUE(error);
    EXPECT_EQ(error->code, ErrorCode::malformed);
    EXPECT_NE(error->message.find("TRNE"), std::string::npos);
}

TEST(Frame, MoreTablesThanTheLimitAreMalformed) {
    const auto many = std::get<ServerHello>(sample_messages()[1]);
    auto hello = many;
    hello.materials.resize(kInboundTablesMax, many.materials[0]);
    FrameReader client_side(kOutboundFrameLimits);
    EXPECT_FALSE(drain(client_side, encode_message(hello)));
    FrameReader server_side(kInboundFrameLimits);
    const auto error = drain(server_side, encode_message(hello));
    ASSERT_TRUE(error);
    EXPECT_EQ(error->code, ErrorCode::malformed);
}

TEST(Frame, AnErrorIsKept) {
    FrameReader reader(kInboundFrameLimits);
    const auto first = drain(reader, Bytes(4));
    ASSERT_TRUE(first);
    EXPECT_EQ(drain(reader, encode_message(Ping{.nonce = 1})), first);
    EXPECT_EQ(reader.buffered_bytes(), 0U);
}

}  // namespace
}  // namespace terrane
