#include "storage/record.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>
#include <vector>

namespace terrane {
namespace {

constexpr std::int32_t kLeast = std::numeric_limits<std::int32_t>::min();
constexpr std::int32_t kMost = std::numeric_limits<std::int32_t>::max();

StoreIdentity sample_identity() {
    return {.fingerprint = {.high = 0x0102030405060708, .low = 0x090a0b0c0d0e0f10},
            .content_id = {.high = 0x1112131415161718, .low = 0x191a1b1c1d1e1f20},
            .generator_version = 7,
            .world_name = "sample"};
}

std::string hex(std::string_view bytes) {
    std::string out;
    for (const char c : bytes) {
        constexpr std::string_view kDigits = "0123456789abcdef";
        out += kDigits[static_cast<unsigned char>(c) >> 4U];
        out += kDigits[static_cast<unsigned char>(c) & 15U];
    }
    return out;
}

std::string stack_key(std::int32_t x, std::int32_t z) {
    return encode_key(sample_identity(),
                      {.family = Family::stacks, .position = {.lod = 0, .x = x, .y = 0, .z = z}});
}

TEST(RecordKey, StackHasTheseBytes) {
    const RecordKey key{
        .family = Family::stacks, .format = 2, .position = {.lod = 3, .x = 1, .y = 99, .z = -1}};
    // x biased is 80000001, z biased is 7fffffff: x's bit first in every pair.
    EXPECT_EQ(hex(encode_key(sample_identity(), key)),
              "73"
              "0102030405060708090a0b0c0d0e0f10"
              "00000007"
              "02"
              "03"
              "9555555555555557");
}

TEST(RecordKey, MeshHasTheseBytes) {
    const RecordKey key{
        .family = Family::meshes, .format = 1, .position = {.lod = 0, .x = 0, .y = 1, .z = 0}};
    EXPECT_EQ(hex(encode_key(sample_identity(), key)),
              "6d"
              "1112131415161718191a1b1c1d1e1f20"
              "00000007"
              "01"
              "00"
              "e00000000000000000000001");
}

TEST(RecordKey, DiffersInEveryFieldAndAtTheExtremes) {
    std::set<std::string> keys;
    std::size_t count = 0;
    for (const Family family : {Family::stacks, Family::meshes}) {
        for (const std::uint8_t format : std::initializer_list<std::uint8_t>{0, 1, 255}) {
            for (const std::int32_t lod : {0, 17, 255}) {
                for (const std::int32_t x : {kLeast, -1, 0, 1, kMost}) {
                    for (const std::int32_t z : {kLeast, -1, 0, 1, kMost}) {
                        keys.insert(encode_key(sample_identity(),
                                               {.family = family,
                                                .format = format,
                                                .position = {.lod = lod, .x = x, .y = 0, .z = z}}));
                        ++count;
                    }
                }
            }
        }
    }
    EXPECT_EQ(keys.size(), count);
}

TEST(RecordKey, MeshesDifferByHeightAndStacksDoNot) {
    RecordKey low{.family = Family::meshes, .position = {.lod = 0, .x = 5, .y = 0, .z = 5}};
    RecordKey high = low;
    high.position.y = -1;
    EXPECT_NE(encode_key(sample_identity(), low), encode_key(sample_identity(), high));
    low.family = Family::stacks;
    high.family = Family::stacks;
    EXPECT_EQ(encode_key(sample_identity(), low), encode_key(sample_identity(), high));
}

TEST(RecordKey, SortsAlongTheMortonCurve) {
    EXPECT_LT(stack_key(-1, 0), stack_key(0, 0));
    EXPECT_LT(stack_key(kLeast, kLeast), stack_key(kMost, kMost));
    // An aligned 4 x 4 square is one run of keys: nothing outside sorts between its corners.
    const std::string first = stack_key(4, 8);
    const std::string last = stack_key(7, 11);
    for (std::int32_t x = 0; x < 16; ++x) {
        for (std::int32_t z = 0; z < 16; ++z) {
            const std::string key = stack_key(x, z);
            const bool inside = x >= 4 && x < 8 && z >= 8 && z < 12;
            EXPECT_EQ(inside, first <= key && key <= last) << x << "," << z;
        }
    }
}

TEST(RecordKey, StacksKeepTheirKeyWhenOnlyTheContentIdChanges) {
    StoreIdentity other = sample_identity();
    other.content_id.low += 1;
    const RecordKey stack{.family = Family::stacks, .position = {}};
    const RecordKey mesh{.family = Family::meshes, .position = {}};
    EXPECT_EQ(encode_key(sample_identity(), stack), encode_key(other, stack));
    EXPECT_NE(encode_key(sample_identity(), mesh), encode_key(other, mesh));
    other.generator_version += 1;
    EXPECT_NE(encode_key(sample_identity(), stack), encode_key(other, stack));
}

TEST(RecordFrame, ComesBackAndHasTheseBytes) {
    Bytes framed;
    frame_value(framed, "key", bytes_of("value"));
    const auto value = unframe_value("key", framed);
    ASSERT_TRUE(value);
    EXPECT_EQ(text_of(*value), "value");
    // Checksum: XXH3-128 of 01 'k' 'e' 'y' 'v' 'a' 'l' 'u' 'e', halves little endian.
    const Hash128 checksum = hash128(bytes_of("\x01keyvalue"));
    Bytes expected;
    ByteWriter writer(expected);
    writer.fixed(std::uint8_t{1});
    writer.fixed(checksum.high);
    writer.fixed(checksum.low);
    writer.raw(bytes_of("value"));
    EXPECT_EQ(framed, expected);
}

TEST(RecordFrame, HoldsAnEmptyValue) {
    Bytes framed;
    frame_value(framed, "key", {});
    EXPECT_EQ(framed.size(), kRecordHeadBytes);
    const auto value = unframe_value("key", framed);
    ASSERT_TRUE(value);
    EXPECT_TRUE(value->empty());
}

TEST(RecordFrame, RefusesEveryTruncationAndEveryFlippedBit) {
    Bytes framed;
    frame_value(framed, "key", bytes_of("a small value"));
    for (std::size_t size = 0; size < framed.size(); ++size) {
        const auto cut = unframe_value("key", std::span(framed).first(size));
        ASSERT_FALSE(cut) << size;
        EXPECT_EQ(cut.error().code, ErrorCode::corrupt);
    }
    for (std::size_t i = 0; i < framed.size() * 8; ++i) {
        Bytes damaged = framed;
        damaged[i / 8] ^= static_cast<std::byte>(1U << (i % 8));
        EXPECT_FALSE(unframe_value("key", damaged)) << "bit " << i;
    }
}

TEST(RecordFrame, RefusesAValueFiledUnderAnotherKey) {
    Bytes framed;
    frame_value(framed, "key", bytes_of("value"));
    EXPECT_FALSE(unframe_value("kez", framed));
}

TEST(StoreMetadata, ComesBackAndRefusesEveryTruncation) {
    Bytes framed;
    encode_metadata(framed, {.format = 1, .identity = sample_identity()});
    const auto metadata = decode_metadata(framed);
    ASSERT_TRUE(metadata);
    EXPECT_EQ(metadata->format, 1U);
    EXPECT_EQ(metadata->identity.fingerprint, sample_identity().fingerprint);
    EXPECT_EQ(metadata->identity.content_id, sample_identity().content_id);
    EXPECT_EQ(metadata->identity.generator_version, 7U);
    EXPECT_EQ(metadata->identity.world_name, "sample");
    for (std::size_t size = 0; size < framed.size(); ++size) {
        EXPECT_FALSE(decode_metadata(std::span(framed).first(size))) << size;
    }
}

TEST(StoreMetadata, RefusesWellFramedNonsense) {
    Bytes value;
    ByteWriter writer(value);
    writer.fixed(kStoreFormat);
    Bytes framed;
    frame_value(framed, kMetadataKey, value);
    ASSERT_FALSE(decode_metadata(framed));
    EXPECT_EQ(decode_metadata(framed).error().code, ErrorCode::corrupt);

    value.resize(40);
    writer.fixed(std::uint16_t{9});
    writer.raw(bytes_of("short"));
    frame_value(framed, kMetadataKey, value);
    ASSERT_FALSE(decode_metadata(framed));
    EXPECT_EQ(decode_metadata(framed).error().code, ErrorCode::corrupt);
}

TEST(StoreMetadata, SaysThatANewerFormatIsNewer) {
    Bytes framed;
    encode_metadata(framed, {.format = kStoreFormat + 1, .identity = sample_identity()});
    const auto metadata = decode_metadata(framed);
    ASSERT_FALSE(metadata);
    EXPECT_EQ(metadata.error().code, ErrorCode::version_mismatch);
}

}  // namespace
}  // namespace terrane
