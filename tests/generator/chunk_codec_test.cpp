#include "generator/volume/chunk_codec.h"

#include "generator/terrain/generate_stack.h"
#include "generator/terrain/load_world.h"
#include "generator/volume/plane_coder.h"
#include "generator/volume/voxel.h"
#include "tests/support/drawn_stack.h"
#include "tests/support/random_seed.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>

namespace terrane {
namespace {

constexpr std::int32_t kLeast = std::numeric_limits<std::int32_t>::min();
constexpr std::int32_t kMost = std::numeric_limits<std::int32_t>::max();

Chunk cut(const Stack& stack, std::int32_t y, std::int32_t height) {
    Chunk chunk;
    cut_chunk(chunk, stack, y, height);
    return chunk;
}

Bytes encoded(const Chunk& chunk, FlowPlane flow = FlowPlane::with) {
    Bytes bytes;
    encode_chunk(bytes, chunk, flow);
    return bytes;
}

Bytes encoded(const Stack& stack) {
    Bytes bytes;
    encode_stack(bytes, stack);
    return bytes;
}

std::string hex(std::span<const std::byte> bytes) {
    std::string text;
    for (const std::byte byte : bytes) {
        constexpr std::string_view kDigits = "0123456789abcdef";
        text += kDigits[static_cast<std::size_t>(byte >> 4)];
        text += kDigits[static_cast<std::size_t>(byte & std::byte{15})];
    }
    return text;
}

void expect_round_trip(const Chunk& chunk) {
    const auto decoded = decode_chunk(encoded(chunk));
    ASSERT_TRUE(decoded) << decoded.error().message;
    EXPECT_EQ(*decoded, chunk);
    Chunk still = chunk;
    for (Limit& limit : still.columns.limits) {
        limit.flow = {};
    }
    const auto without = decode_chunk(encoded(chunk, FlowPlane::without));
    ASSERT_TRUE(without) << without.error().message;
    EXPECT_EQ(*without, still);
}

void expect_round_trip(const Stack& stack) {
    const auto decoded = decode_stack(encoded(stack));
    ASSERT_TRUE(decoded) << decoded.error().message;
    EXPECT_EQ(*decoded, stack);
}

/// Every column ascends from 0, and the stack knows its highest limit.
void put_heights_in_order(Stack& stack) {
    ColumnGrid& columns = stack.columns;
    stack.highest_y256 = 0;
    for (std::int32_t z = -1; z <= stack.side; ++z) {
        for (std::int32_t x = -1; x <= stack.side; ++x) {
            const std::size_t i = columns.index_of(x, z);
            const auto column =
                std::span(columns.limits)
                    .subspan(columns.offsets[i], columns.offsets[i + 1] - columns.offsets[i]);
            std::vector<std::int32_t> heights;
            for (const Limit& limit : column) {
                heights.push_back(limit.y256);
            }
            std::ranges::sort(heights);
            heights.front() = 0;
            for (std::size_t k = 0; k < column.size(); ++k) {
                column[k].y256 = heights[k];
            }
            if (x >= 0 && x < stack.side && z >= 0 && z < stack.side) {
                stack.highest_y256 = std::max(stack.highest_y256, heights.back());
            }
        }
    }
}

/// A small stack that has blends, elements, a cave, an overlap and a hole.
Stack varied_stack() {
    Stack stack = drawn_stack(4, {"aabb#bcc", "aaabbAccc", "aabBBb.c", "aa", "abc", "aabbbbA#cc"});
    std::mt19937 random(3);
    for (Limit& limit : stack.columns.limits) {
        limit.y256 += static_cast<std::int32_t>(random() % 40);
    }
    put_heights_in_order(stack);
    return stack;
}

// The bytes are worked out in CHUNK_FORMAT.md, "An example".
TEST(ChunkCodec, AUniformChunkIsItsHeadAndOnePaletteEntry) {
    Chunk chunk;
    chunk.position = {.lod = 0, .x = -1, .y = 2, .z = 300};
    chunk.side = chunk.height = 32;
    chunk.uniform = true;
    chunk.uniform_content.composition.add(3, 1.0);
    chunk.uniform_content.kind = PaletteKind::void_;
    EXPECT_EQ(hex(encoded(chunk)),
              "020000000104d8042020"
              "09"
              "03000000000000f03f");
    EXPECT_EQ(encoded(chunk), encoded(chunk, FlowPlane::without));
    expect_round_trip(chunk);
}

TEST(ChunkCodec, ATinyChunksBytesStayTheSame) {
    const Chunk chunk = cut(drawn_stack(2, {"aab"}), 0, 4);
    EXPECT_EQ(hex(encoded(chunk)),
              "0201010005000a0204"
              "030800000000000000f03f"
              "1001000000000000e83f00000000000000d03f"
              "0903000000000000f03f"
              "000001"
              "0106000001010202"
              "01000000"
              "000000"
              "0000000000"
              "00ff0000008106"
              "00ff000000810a"
              "00ff000000810e"
              "00"
              "fe0000000000000000000000"
              "c80000000b0000009c000000"
              "00");
    expect_round_trip(chunk);
}

TEST(ChunkCodec, DrawnWorldsComeBack) {
    const Stack stack = varied_stack();
    expect_round_trip(stack);
    for (std::int32_t y = -1; y < 6; ++y) {
        expect_round_trip(cut(stack, y, 2));
    }
}

TEST(ChunkCodec, BlendsAreDerivedNotStored) {
    // A blend of 90/256 over a slope: only the tops need residuals.
    const auto column_at = [](std::int32_t i, std::int32_t error) {
        const std::int32_t bottom = 2000 + 17 * i;
        const std::int32_t top = 4000 - 23 * i;
        const std::int32_t middle = bottom + (((top - bottom) * 90 + 128) >> 8) + error;
        return std::vector<Limit>{{.y256 = 0, .palette_id = 0, .flow = {}},
                                  {.y256 = bottom, .palette_id = 0, .flow = {}},
                                  {.y256 = middle, .palette_id = 1, .flow = {}},
                                  {.y256 = top, .palette_id = 1, .flow = {}},
                                  {.y256 = top, .palette_id = 3, .flow = {}}};
    };
    std::vector<std::vector<Limit>> exact;
    std::vector<std::vector<Limit>> wrong;
    for (std::int32_t i = 0; i < 18; ++i) {
        for (std::int32_t j = 0; j < 18; ++j) {
            exact.push_back(column_at(i, 0));
            wrong.push_back(column_at(i, 1 + j % 2));
        }
    }
    const Stack stack = stack_of_columns(16, exact);
    const Stack other = stack_of_columns(16, wrong);
    expect_round_trip(stack);
    expect_round_trip(other);
    // Three planes of 18 x 18 heights, two of 16 x 16 flows, seven palette entries and little else.
    EXPECT_LT(encoded(stack).size(), 3 * 18 * 18 + 2 * 3 * 16 * 16 + 150U);
    EXPECT_GT(encoded(other).size(), encoded(stack).size() + 18 * 18U);
}

TEST(ChunkCodec, AnyLimitsComeBack) {
    std::mt19937 random(test_seed());
    const auto number = [&](std::uint32_t below) {
        return static_cast<std::uint32_t>(random()) % below;
    };
    for (int round = 0; round < 300; ++round) {
        const std::int32_t side = 1 + static_cast<std::int32_t>(number(9));
        const bool wild = number(2) == 0;
        const std::uint32_t limits_most = 1 + number(12);
        std::vector<std::vector<Limit>> columns(1 + number(60));
        for (std::vector<Limit>& column : columns) {
            std::uint32_t y = 0;
            for (std::uint32_t i = 0; i <= number(limits_most + 1); ++i) {
                y = wild ? static_cast<std::uint32_t>(random()) >> 1U : y + number(700);
                const auto part = [&] { return static_cast<std::int8_t>(random()); };
                column.push_back({.y256 = static_cast<std::int32_t>(y),
                                  .palette_id = static_cast<std::uint16_t>(number(7)),
                                  .flow = {.x = part(), .y = part(), .z = part()}});
            }
        }
        Stack stack = stack_of_columns(side, columns);
        for (Limit& limit : stack.columns.limits) {
            limit.flow.y = number(9) == 0 ? std::int8_t{-128} : limit.flow.y;
        }
        put_heights_in_order(stack);
        expect_round_trip(stack);
        Chunk chunk;
        chunk.position = {.lod = 3, .x = kLeast, .y = kMost, .z = kLeast};
        chunk.side = side + 2;
        chunk.height = 64;
        chunk.columns = stack.columns;
        chunk.columns.x_first = chunk.columns.z_first = 0;
        chunk.palette = stack.palette;
        chunk.stack_palette_ids = {0, 1, 7, 8, 1000, 65534, 65535};
        expect_round_trip(chunk);
    }
}

TEST(ChunkCodec, HeightsAtBothEndsOfInt32ComeBack) {
    std::vector<std::vector<Limit>> columns;
    for (int i = 0; i < 36; ++i) {
        const bool odd = i % 2 == 1;
        columns.push_back({{.y256 = odd ? kMost : kLeast, .palette_id = 0, .flow = {}},
                           {.y256 = odd ? kMost : kLeast, .palette_id = 0, .flow = {}},
                           {.y256 = odd ? kMost : 0, .palette_id = 1, .flow = {}},
                           {.y256 = odd || i % 3 == 0 ? kMost : 1, .palette_id = 1, .flow = {}}});
    }
    Chunk chunk;
    chunk.side = 6;
    chunk.height = 64;
    Stack stack = stack_of_columns(4, columns);
    chunk.columns = stack.columns;
    chunk.columns.x_first = chunk.columns.z_first = 0;
    chunk.palette = stack.palette;
    chunk.stack_palette_ids = {0, 1, 2, 3, 4, 5, 6};
    expect_round_trip(chunk);
}

TEST(ChunkCodec, ManyLimitsInAColumnNeedNoCap) {
    std::vector<Limit> column;
    for (std::int32_t i = 0; i < 3000; ++i) {
        column.push_back(
            {.y256 = i * 5, .palette_id = static_cast<std::uint16_t>(i % 7), .flow = {}});
    }
    const Stack stack = stack_of_columns(8, {column});
    expect_round_trip(stack);
    EXPECT_GE(encoded(stack).size() * kLimitsPerByteMax, stack.columns.limits.size());
}

TEST(ChunkCodec, EveryTruncatedPrefixIsRefused) {
    const Stack stack = varied_stack();
    const Bytes stack_bytes = encoded(stack);
    const Bytes chunk_bytes = encoded(cut(stack, 1, 3));
    const Bytes uniform_bytes = encoded(cut(stack, -1, 3));
    for (std::size_t size = 0; size < stack_bytes.size(); ++size) {
        EXPECT_FALSE(decode_stack(std::span(stack_bytes).first(size))) << size;
    }
    for (std::size_t size = 0; size < chunk_bytes.size(); ++size) {
        EXPECT_FALSE(decode_chunk(std::span(chunk_bytes).first(size))) << size;
    }
    for (std::size_t size = 0; size < uniform_bytes.size(); ++size) {
        EXPECT_FALSE(decode_chunk(std::span(uniform_bytes).first(size))) << size;
    }
}

void read_all(const Chunk& chunk) {
    for (std::int32_t i = 0; i < chunk.side; ++i) {
        EXPECT_GT(voxel_of(chunk, i, chunk.height - 1, i).count, 0);
    }
}

void read_all(const Stack& stack) {
    Chunk chunk;
    for (std::int32_t y = -1; y < (stack.position.lod > 0 ? 0 : 3); ++y) {
        cut_chunk(chunk, stack, stack.position.lod > 0 ? 0 : y, 3);
        read_all(chunk);
    }
}

TEST(ChunkCodec, EveryFlippedByteIsRefusedOrAnotherValidRecord) {
    const Stack stack = varied_stack();
    const auto flip_all = [](const Bytes& bytes, auto decode, auto encode) {
        for (std::size_t i = 0; i < bytes.size(); ++i) {
            for (const int flip : {0x01, 0x10, 0x80, 0xff}) {
                Bytes changed = bytes;
                changed[i] ^= static_cast<std::byte>(flip);
                const auto decoded = decode(changed);
                if (decoded) {  // then it is a record in its own right, and safe to read
                    read_all(*decoded);
                    const auto again = decode(encode(*decoded));
                    ASSERT_TRUE(again) << i << ' ' << flip;
                    EXPECT_EQ(*again, *decoded) << i << ' ' << flip;
                }
            }
        }
    };
    const auto chunk_of = [](const Bytes& bytes) { return decode_chunk(bytes); };
    const auto bytes_of_chunk = [](const Chunk& chunk) { return encoded(chunk); };
    flip_all(encoded(cut(stack, 1, 3)), chunk_of, bytes_of_chunk);
    flip_all(encoded(cut(stack, -1, 3)), chunk_of, bytes_of_chunk);
    flip_all(
        encoded(stack), [](const Bytes& bytes) { return decode_stack(bytes); },
        [](const Stack& changed) { return encoded(changed); });
}

TEST(ChunkCodec, WhatItRefusesItNames) {
    const Chunk chunk = cut(varied_stack(), 1, 3);
    const Bytes good = encoded(chunk);
    const auto code_with = [&](std::size_t at, int value) {
        Bytes bytes = good;
        bytes[at] = static_cast<std::byte>(value);
        const auto decoded = decode_chunk(bytes);
        return decoded ? ErrorCode::internal : decoded.error().code;
    };
    EXPECT_EQ(code_with(0, 1), ErrorCode::version_mismatch);
    EXPECT_EQ(code_with(1, 2), ErrorCode::malformed);   // a stack
    EXPECT_EQ(code_with(1, 9), ErrorCode::malformed);   // no kind
    EXPECT_EQ(code_with(2, 2), ErrorCode::malformed);   // no flag
    EXPECT_EQ(code_with(3, 18), ErrorCode::too_large);  // level
    EXPECT_EQ(code_with(7, 65), ErrorCode::too_large);  // side
    EXPECT_EQ(code_with(8, 65), ErrorCode::too_large);  // height
    EXPECT_EQ(code_with(8, 0), ErrorCode::malformed);
    EXPECT_FALSE(decode_stack(good));
    EXPECT_FALSE(decode_chunk(encoded(varied_stack())));
    Bytes longer = good;
    longer.push_back(std::byte{0});
    EXPECT_FALSE(decode_chunk(longer));
}

TEST(ChunkCodec, WhatReadersRelyOnIsChecked) {
    const auto refused = [](auto change) {
        Stack stack = varied_stack();
        change(stack);
        const auto decoded = decode_stack(encoded(stack));
        return !decoded && decoded.error().code == ErrorCode::malformed;
    };
    EXPECT_FALSE(refused([](Stack&) {}));
    EXPECT_TRUE(refused([](Stack& stack) { ++stack.highest_y256; }));
    EXPECT_TRUE(refused([](Stack& stack) { stack.columns.limits[0].y256 = 1; }));
    EXPECT_TRUE(refused([](Stack& stack) { stack.columns.limits[1].y256 = -1; }));
    EXPECT_TRUE(refused([](Stack& stack) { stack.palette[2].composition = {}; }));
    EXPECT_TRUE(refused([](Stack& stack) { stack.palette[3].kind = PaletteKind::layer; }));
    EXPECT_TRUE(refused([](Stack& stack) { stack.palette[4].kind = PaletteKind::void_; }));
    EXPECT_TRUE(refused([](Stack& stack) { stack.palette[0].kind = PaletteKind::vein; }));
    Chunk falling = cut(varied_stack(), 1, 3);
    falling.columns.limits[1].y256 = kLeast;
    EXPECT_FALSE(decode_chunk(encoded(falling)));
    Chunk bare = cut(varied_stack(), 1, 3);  // a column without any limit
    const std::uint32_t taken = bare.columns.offsets[1];
    bare.columns.limits.erase(bare.columns.limits.begin(), bare.columns.limits.begin() + taken);
    for (std::size_t i = 1; i < bare.columns.offsets.size(); ++i) {
        bare.columns.offsets[i] -= taken;
    }
    EXPECT_FALSE(decode_chunk(encoded(bare)));
}

TEST(ChunkCodec, MaterialsBeyondTheWorldsAreRefused) {
    const Stack stack = varied_stack();  // materials 0..5
    EXPECT_TRUE(decode_stack(encoded(stack), 6));
    EXPECT_FALSE(decode_stack(encoded(stack), 5));
    Chunk chunk;
    chunk.side = chunk.height = 4;
    chunk.uniform = true;
    chunk.uniform_content.composition.add(5, 1.0);
    EXPECT_TRUE(decode_chunk(encoded(chunk), 6));
    EXPECT_FALSE(decode_chunk(encoded(chunk), 5));
}

TEST(ChunkCodec, ASignatureThatNoRunUsesIsRefused) {
    Bytes good;
    {
        Chunk chunk;
        chunk.side = 2;
        chunk.height = 4;
        chunk.palette.push_back(drawn_palette()[0]);
        chunk.stack_palette_ids = {0};
        chunk.columns.width = chunk.columns.length = 2;
        chunk.columns.offsets = {0, 1, 2, 3, 4};
        chunk.columns.limits.assign(4, {.y256 = 7, .palette_id = 0, .flow = {}});
        good = encoded(chunk, FlowPlane::without);
    }
    ASSERT_TRUE(decode_chunk(good));
    // ... 01 01 00: one signature of one limit; a second one is put behind it.
    const std::array<std::byte, 3> table = {std::byte{1}, std::byte{1}, std::byte{0}};
    const auto head = std::ranges::search(std::span(good).subspan(21), table);
    ASSERT_FALSE(head.empty());
    Bytes unused(good.data(), &*head.begin());
    ByteWriter(unused).varint(2);
    for (const unsigned value : {1U, 0U, 2U, 0U, 0U}) {
        ByteWriter(unused).varint(value);
    }
    unused.insert(unused.end(), &*head.begin() + 3, good.data() + good.size());
    EXPECT_FALSE(decode_chunk(unused));
}

TEST(ChunkCodec, ASmallRecordCannotAskForManyLimits) {
    // A signature of 4,000 limits, 64 x 64 times over: 16 million limits out of 8,000 bytes.
    Bytes bytes;
    ByteWriter out(bytes);
    for (const unsigned head : {2U, 1U, 0U, 0U, 0U, 0U, 0U, 64U, 64U}) {
        out.varint(head);
    }
    out.varint(2);
    for (const unsigned material : {0U, 1U}) {
        out.varint(1U << 3U);
        out.varint(material);
        out.f64(1.0);
    }
    out.varint(0);
    out.varint(0);
    out.varint(1);
    out.varint(4000);
    for (unsigned i = 0; i < 4000; ++i) {
        out.varint(i % 2);
    }
    for (unsigned row = 0; row < 64; ++row) {
        out.varint(row == 0 ? 1U : 0U);
        out.varint(0);
    }
    bytes.resize(bytes.size() + 4096);
    const auto decoded = decode_chunk(bytes);
    ASSERT_FALSE(decoded);
    EXPECT_EQ(decoded.error().code, ErrorCode::malformed);
}

TEST(PlaneCoder, SmoothSurfacesCostAByteACell) {
    const auto plane = std::make_unique<Plane>();
    for (std::uint32_t z = 0; z < 66; ++z) {
        plane->view().mark(z, 0, 66);
        for (std::uint32_t x = 0; x < 66; ++x) {
            plane->view().row(z)[x] = 100000U + x * x * 3 - z * z * 2 + x * z * 5;
        }
    }
    Bytes bytes;
    const auto scratch = std::make_unique<PlaneCodes>();
    encode_heights(bytes, plane->view(), *scratch);
    EXPECT_EQ(bytes[0], std::byte{1});  // second order, a byte a cell
    EXPECT_LT(bytes.size(), 66 * 66 + 100U);
    const auto decoded = std::make_unique<Plane>();
    decoded->present = plane->present;
    ByteReader reader(bytes);
    ASSERT_TRUE(decode_heights(decoded->view(), reader));
    EXPECT_EQ(decoded->values, plane->values);
    EXPECT_EQ(reader.remaining(), 0U);
}

TEST(PlaneCoder, AnySurfaceComesBack) {
    // Rough ones take two bytes a cell, wild ones escape from those too; holes are anywhere.
    std::mt19937 random(test_seed());
    const auto scratch = std::make_unique<PlaneCodes>();
    for (const std::uint32_t range : {1U, 100U, 300U, 60000U, 70000000U, 0xFFFFFFFFU}) {
        for (const unsigned holes_of_8 : {0U, 1U, 6U}) {
            const auto plane = std::make_unique<Plane>();
            for (std::size_t z = 0; z < 66; ++z) {
                for (std::size_t x = 0; x < 66; ++x) {
                    if (random() % 8 >= holes_of_8) {
                        plane->view().mark(z, x, 1);
                        plane->view().row(z)[x] = static_cast<std::uint32_t>(random()) % range;
                    }
                }
            }
            Bytes bytes;
            encode_heights(bytes, plane->view(), *scratch);
            const auto decoded = std::make_unique<Plane>();
            decoded->present = plane->present;
            ByteReader reader(bytes);
            ASSERT_TRUE(decode_heights(decoded->view(), reader));
            EXPECT_EQ(reader.remaining(), 0U);
            EXPECT_EQ(decoded->values, plane->values);
            for (std::size_t size = 0; size < bytes.size(); size += 1 + bytes.size() / 50) {
                ByteReader shortened{std::span(bytes).first(size)};
                EXPECT_FALSE(decode_heights(decoded->view(), shortened)) << size;
            }
        }
    }
}

class GoldenWorld : public testing::TestWithParam<const char*> {};

TEST_P(GoldenWorld, ChunksComeBackAndHaveTheWholeColumnsVoxels) {
    const auto path = std::filesystem::path(TERRANE_SOURCE_DIR) / "tests/data" / GetParam();
    const LoadedWorld loaded = load_world(path);
    ASSERT_TRUE(loaded.ok());
    const std::int32_t height = loaded.world->definition.grid.height;
    StackGenerator generator(*loaded.world);
    Stack stack;
    Chunk chunk;
    for (const auto& [x, z] : {std::pair{0, 0}, {-1, -1}, {37, -12}}) {
        ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = x, .z = z}));
        expect_round_trip(stack);
        const std::int32_t top = stack.highest_y256 / kUnitsPerVoxel / height + 1;
        std::vector<Voxel> row(static_cast<std::size_t>(height));
        for (std::int32_t y = -1; y <= top; y += std::max(1, top / 6)) {
            cut_chunk(chunk, stack, y, height);
            expect_round_trip(chunk);
            for (std::int32_t i = 0; i < stack.side * stack.side; i += 7) {
                const std::int32_t column_x = i % stack.side;
                const std::int32_t column_z = i / stack.side;
                expand_column(row, stack.columns.column(column_x, column_z), stack.palette,
                              std::int64_t{y} * height);
                for (std::int32_t voxel = 0; voxel < height; ++voxel) {
                    Voxel& whole = row[static_cast<std::size_t>(voxel)];
                    whole.flow = chunk.uniform ? Flow{} : whole.flow;
                    ASSERT_EQ(voxel_of(chunk, column_x, voxel, column_z), whole);
                }
            }
        }
    }
}

INSTANTIATE_TEST_SUITE_P(All, GoldenWorld,
                         testing::Values("paper-B3-seed42.toml", "dense-seed43.toml",
                                         "edge-deep.toml", "edge-dense.toml", "edge-many.toml",
                                         "edge-one.toml", "edge-picky.toml", "edge-pinch.toml"),
                         [](const auto& world) {
                             std::string name(world.param);
                             std::erase_if(name, [](char c) { return c == '-' || c == '.'; });
                             return name;
                         });

}  // namespace
}  // namespace terrane
