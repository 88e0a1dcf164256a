#include "server/chunks/chunk_record.h"

#include <gtest/gtest.h>

#include <array>

namespace terrane {
namespace {

constexpr std::size_t kMaterials = 5;

EncodedChunk full_chunk() {
    EncodedChunk chunk;
    chunk.status = ChunkStatus::full;
    const auto text = bytes_of("payload");
    chunk.payload = std::make_shared<const Bytes>(text.begin(), text.end());
    chunk.etag = etag_of(chunk);
    return chunk;
}

EncodedChunk uniform_chunk() {
    EncodedChunk chunk;
    chunk.status = ChunkStatus::uniform;
    chunk.uniform.add(4, 0.75);
    chunk.uniform.add(0, 0.25);
    chunk.etag = etag_of(chunk);
    return chunk;
}

TEST(ChunkRecord, ReadsBackWhatWasWritten) {
    EncodedChunk empty;
    empty.status = ChunkStatus::empty;
    empty.etag = etag_of(empty);
    for (const EncodedChunk& chunk : {full_chunk(), uniform_chunk(), empty}) {
        const auto read = decode_chunk_record(encode_chunk_record(chunk), kMaterials);
        ASSERT_TRUE(read) << read.error().message;
        EXPECT_EQ(read->status, chunk.status);
        EXPECT_EQ(read->uniform, chunk.uniform);
        EXPECT_EQ(read->etag, chunk.etag);
        ASSERT_EQ(read->payload == nullptr, chunk.payload == nullptr);
        if (chunk.payload) {
            EXPECT_EQ(*read->payload, *chunk.payload);
        }
    }
}

TEST(ChunkRecord, HasTheDocumentedBytes) {
    constexpr std::array<unsigned char, 2> kEmpty{1, 1};
    EncodedChunk empty;
    const Bytes record = encode_chunk_record(empty);
    ASSERT_EQ(record.size(), 18U);
    EXPECT_EQ(static_cast<unsigned char>(record[0]), kEmpty[0]);
    EXPECT_EQ(static_cast<unsigned char>(record[1]), kEmpty[1]);
    const Hash128 hash = hash128(std::span(record).first(2));
    ByteReader in{std::span(record).subspan(2)};
    EXPECT_EQ(in.fixed<std::uint64_t>(), hash.low);
    EXPECT_EQ(in.fixed<std::uint64_t>(), hash.high);
}

TEST(ChunkRecord, TheEtagOfAFullChunkIsItsPayloadsHash) {
    EXPECT_EQ(full_chunk().etag, hash128(bytes_of("payload")));
    EXPECT_NE(uniform_chunk().etag, full_chunk().etag);
}

TEST(ChunkRecord, RefusesEveryTruncation) {
    for (const EncodedChunk& chunk : {full_chunk(), uniform_chunk()}) {
        const Bytes record = encode_chunk_record(chunk);
        for (std::size_t size = 0; size < record.size(); ++size) {
            EXPECT_FALSE(decode_chunk_record(std::span(record).first(size), kMaterials)) << size;
        }
    }
}

TEST(ChunkRecord, RefusesEveryFlippedBit) {
    for (const EncodedChunk& chunk : {full_chunk(), uniform_chunk()}) {
        Bytes record = encode_chunk_record(chunk);
        for (std::size_t bit = 0; bit < record.size() * 8; ++bit) {
            record[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
            EXPECT_FALSE(decode_chunk_record(record, kMaterials)) << bit;
            record[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
        }
    }
}

TEST(ChunkRecord, RefusesAMaterialTheWorldLacks) {
    EXPECT_FALSE(decode_chunk_record(encode_chunk_record(uniform_chunk()), 4));
}

}  // namespace
}  // namespace terrane
