#include "server/net/outbox.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

namespace terrane {
namespace {

Bytes bytes(std::string_view text) {
    const auto view = bytes_of(text);
    return {view.begin(), view.end()};
}

SharedBytes shared(std::string_view text) {
    return std::make_shared<const Bytes>(bytes(text));
}

std::string gathered(const Outbox& outbox) {
    Outbox::Gather parts;
    const std::size_t count = outbox.gather(parts);
    std::string text;
    for (std::size_t i = 0; i < count; ++i) {
        text += text_of(parts[i]);
    }
    return text;
}

TEST(Outbox, GivesHeadsAndPayloadsInOrder) {
    Outbox outbox;
    EXPECT_TRUE(outbox.empty());
    outbox.push(bytes("head1"), shared("payload1"));
    outbox.push(bytes("head2"), nullptr);
    EXPECT_EQ(outbox.bytes(), 18U);
    EXPECT_EQ(gathered(outbox), "head1payload1head2");
}

TEST(Outbox, SharesThePayloadInsteadOfCopyingIt) {
    Outbox outbox;
    const SharedBytes payload = shared("payload");
    outbox.push(bytes("h"), payload);
    Outbox::Gather parts;
    ASSERT_EQ(outbox.gather(parts), 2U);
    EXPECT_EQ(parts[1].data(), payload->data());
}

TEST(Outbox, GoesOnAfterEveryShortWrite) {
    for (std::size_t step = 1; step <= 18; ++step) {
        Outbox outbox;
        outbox.push(bytes("head1"), shared("payload1"));
        outbox.push(bytes("head2"), nullptr);
        std::string text;
        while (!outbox.empty()) {
            const std::string next = gathered(outbox);
            const std::size_t written = std::min(step, next.size());
            text += next.substr(0, written);
            outbox.consume(written);
            ASSERT_EQ(outbox.bytes(), 18 - text.size());
        }
        EXPECT_EQ(text, "head1payload1head2") << "in steps of " << step;
    }
}

TEST(Outbox, GathersABoundedNumberOfParts) {
    Outbox outbox;
    for (std::size_t i = 0; i < kGatherPartsMax * 2; ++i) {
        outbox.push(bytes("x"), nullptr);
    }
    EXPECT_EQ(gathered(outbox).size(), kGatherPartsMax);
}

TEST(Outbox, IsFullAtItsWindow) {
    Outbox outbox;
    outbox.push(bytes("h"), std::make_shared<const Bytes>(kOutboxBytesMax - 2));
    EXPECT_FALSE(outbox.full());
    outbox.push(bytes("h"), nullptr);
    EXPECT_TRUE(outbox.full());
    outbox.consume(1);
    EXPECT_FALSE(outbox.full());
}

std::string gathered_text(const Outbox& outbox) {
    Outbox::Gather parts;
    std::string text;
    const std::size_t count = outbox.gather(parts);
    for (std::size_t i = 0; i < count; ++i) {
        for (const std::byte byte : parts[i]) {
            text.push_back(static_cast<char>(byte));
        }
    }
    return text;
}

Bytes text_bytes(std::string_view text) {
    const auto bytes = std::as_bytes(std::span(text));
    return {bytes.begin(), bytes.end()};
}

void push_chunk(Outbox& outbox, std::string_view head, std::string_view payload, std::int32_t x) {
    outbox.push(text_bytes(head),
                payload.empty() ? nullptr : std::make_shared<const Bytes>(text_bytes(payload)),
                ChunkPos{.lod = 0, .x = x, .y = 0, .z = 0});
}

TEST(Outbox, WithdrawsWholeChunksOfTheViewAndNothingElse) {
    Outbox outbox;
    push_chunk(outbox, "a", "AA", 1);
    outbox.push(text_bytes("m"), nullptr);
    push_chunk(outbox, "b", "", 2);
    push_chunk(outbox, "c", "CCC", 3);
    outbox.push(text_bytes("n"), std::make_shared<const Bytes>(text_bytes("N")));
    const auto withdrawn = outbox.withdraw([](ChunkPos key) { return key.x != 2; });
    EXPECT_EQ(withdrawn.bytes, 7U);
    EXPECT_EQ(withdrawn.payload_bytes, 5U);
    EXPECT_EQ(outbox.bytes(), 4U);
    EXPECT_EQ(gathered_text(outbox), "mbnN");
}

TEST(Outbox, LeavesWhatAWriteHasInHand) {
    Outbox outbox;
    for (std::int32_t x = 0; x < 40; ++x) {
        push_chunk(outbox, "h", "pp", x);
    }
    gathered_text(outbox);  // 32 parts: 16 chunks
    EXPECT_EQ(outbox.withdraw([](ChunkPos) { return true; }).payload_bytes, 24U * 2);
    outbox.consume(1);  // the head of the first: its payload must follow
    EXPECT_EQ(outbox.withdraw([](ChunkPos) { return true; }).payload_bytes, 15U * 2);
    EXPECT_EQ(gathered_text(outbox), "pp");
    outbox.consume(1);
    EXPECT_EQ(outbox.withdraw([](ChunkPos) { return true; }).bytes, 0U);
    outbox.consume(1);
    EXPECT_TRUE(outbox.empty());
}

}  // namespace
}  // namespace terrane
