#include "protocol/wire/column_payload.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace terrane {
namespace {

Bytes repetitive_bytes() {
    Bytes bytes;
    for (int i = 0; i < 4000; ++i) {
        bytes.push_back(static_cast<std::byte>(i % 7));
    }
    return bytes;
}

TEST(ColumnPayload, RoundTripsAndShrinksWhatRepeats) {
    const Bytes chunk = repetitive_bytes();
    const Bytes payload = encode_column_payload(chunk);
    EXPECT_EQ(payload[0], static_cast<std::byte>(PayloadTag::zstd));
    EXPECT_LT(payload.size(), 100U);
    EXPECT_EQ(decode_column_payload(payload, chunk.size()).value(), chunk);
}

TEST(ColumnPayload, WhatDoesNotShrinkStaysPlain) {
    const Bytes chunk = {std::byte{1}, std::byte{2}, std::byte{3}};
    const Bytes payload = encode_column_payload(chunk);
    EXPECT_EQ(payload, (Bytes{std::byte{0}, std::byte{1}, std::byte{2}, std::byte{3}}));
    EXPECT_EQ(decode_column_payload(payload, 3).value(), chunk);
}

TEST(ColumnPayload, TheUnpackedSizeIsLimited) {
    const Bytes chunk = repetitive_bytes();
    EXPECT_EQ(decode_column_payload(encode_column_payload(chunk), chunk.size() - 1).error().code,
              ErrorCode::too_large);
    EXPECT_EQ(decode_column_payload(Bytes(5), 3).error().code, ErrorCode::too_large);
}

TEST(ColumnPayload, EveryTruncatedPrefixIsMalformed) {
    const Bytes payload = encode_column_payload(repetitive_bytes());
    for (std::size_t size = 0; size < payload.size(); ++size) {
        const auto decoded = decode_column_payload(std::span(payload).first(size), 1U << 20U);
        ASSERT_FALSE(decoded) << size;
        EXPECT_EQ(decoded.error().code, ErrorCode::malformed);
    }
}

TEST(ColumnPayload, EveryFlippedByteIsRefusedOrReadSafely) {
    const Bytes payload = encode_column_payload(repetitive_bytes());
    for (std::size_t at = 0; at < payload.size(); ++at) {
        for (unsigned bit = 0; bit < 8; ++bit) {
            Bytes flipped = payload;
            flipped[at] ^= static_cast<std::byte>(1U << bit);
            const auto decoded = decode_column_payload(flipped, 1U << 16U);
            EXPECT_TRUE(!decoded || decoded->size() <= (1U << 16U));
        }
    }
}

}  // namespace
}  // namespace terrane
