// Holds the bytes on the wire to the examples in WIRE_FORMAT.md, and the examples to the bytes.
#include "protocol/base/bytes.h"
#include "protocol/wire/messages.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>

namespace terrane {
namespace {

/// The bytes of the block that starts with "```frame NAME": on each line, what stands before two
/// spaces.
Bytes documented_frame(const std::string& name) {
    std::ifstream file(TERRANE_SOURCE_DIR "/protocol/wire/WIRE_FORMAT.md");
    std::string line;
    while (std::getline(file, line) && line != "```frame " + name) {
    }
    Bytes bytes;
    while (std::getline(file, line) && line != "```") {
        std::istringstream digits(line.substr(0, line.find("  ")));
        unsigned value = 0;
        while (digits >> std::hex >> value) {
            bytes.push_back(static_cast<std::byte>(value));
        }
    }
    return bytes;
}

constexpr ChunkPos kKey{.lod = 0, .x = -1, .y = 2, .z = 3};

TEST(WireFormat, AChunkRequestHasTheDocumentedBytes) {
    const ChunkRequest request{.request_id = 7,
                               .format = ChunkFormat::columns,
                               .keys = {kKey},
                               .known_etags = {},
                               .priority = 0,
                               .without_flow = false};
    EXPECT_EQ(encode_message(request), documented_frame("ChunkRequest"));
}

TEST(WireFormat, AChunkHasTheDocumentedBytes) {
    const ChunkAnswer answer{
        .request_id = 7,
        .key = kKey,
        .format = ChunkFormat::columns,
        .status = ChunkStatus::full,
        .source = ChunkSource::store,
        .etag = {.high = 0x0102030405060708, .low = 0x090a0b0c0d0e0f10},
        .timings = {.queue_us = 0, .generate_us = 1, .mesh_us = 2, .encode_us = 3},
        .payload_bytes = 4,
        .uniform = {}};
    Bytes bytes = encode_message(answer);
    ByteWriter(bytes).raw(bytes_of(std::string_view("\0abc", 4)));
    EXPECT_EQ(bytes, documented_frame("Chunk"));
}

TEST(WireFormat, AViewUpdateHasTheDocumentedBytes) {
    const ViewUpdate view{.x = -10.5,
                          .y = 70,
                          .z = 4,
                          .direction = {.x = 1, .y = 0, .z = 0},
                          .field_of_view = 1.5F,
                          .velocity = {.x = 50, .y = 0, .z = 0},
                          .radius_chunks = {16, 16},
                          .format = ChunkFormat::draco,
                          .without_flow = false,
                          .bytes_per_second_max = 0};
    EXPECT_EQ(encode_message(view), documented_frame("ViewUpdate"));
}

TEST(WireFormat, AForgetAndACreditHaveTheDocumentedBytes) {
    EXPECT_EQ(encode_message(ChunkForget{.keys = {kKey}}), documented_frame("ChunkForget"));
    EXPECT_EQ(encode_message(Credit{.bytes = 65536}), documented_frame("Credit"));
}

TEST(WireFormat, TheDocumentedFramesDecode) {
    for (const char* name : {"ChunkRequest", "Chunk", "ViewUpdate", "ChunkForget", "Credit"}) {
        FrameReader reader(kOutboundFrameLimits);
        reader.feed(documented_frame(name));
        const auto frame = reader.next();
        ASSERT_TRUE(frame && *frame) << name;
        const auto message = decode_message(**frame);
        ASSERT_TRUE(message) << message.error().message;
        EXPECT_EQ(name_of(*message), name);
    }
}

TEST(WireFormat, APingHasTheseBytes) {
    constexpr unsigned char kGolden[] = {
        0x38, 0,    0, 0,    0x34, 0,    0,    0,    0x14, 0,    0,    0,    0x54, 0x52, 0x4e,
        0x45, 0,    0, 0,    0,    0x08, 0,    0x0e, 0,    0x07, 0,    0x08, 0,    0x08, 0,
        0,    0,    0, 0,    0,    0x0b, 0x0c, 0,    0,    0,    0,    0,    0x06, 0,    0x0c,
        0,    0x04, 0, 0x06, 0,    0,    0,    0xef, 0xcd, 0xab, 0x89, 0x67, 0x45, 0x23, 0x01};
    const auto golden = std::as_bytes(std::span(kGolden));
    EXPECT_EQ(encode_message(Ping{.nonce = 0x0123456789abcdef}),
              Bytes(golden.begin(), golden.end()));
}

}  // namespace
}  // namespace terrane
