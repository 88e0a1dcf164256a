#include "generator/volume/chunk.h"

#include "generator/terrain/generate_stack.h"
#include "generator/volume/cut_columns.h"
#include "tests/support/drawn_stack.h"
#include "tests/support/test_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace terrane {
namespace {

using ::testing::ElementsAre;

std::vector<std::int32_t> heights_of(std::span<const Limit> column) {
    std::vector<std::int32_t> heights;
    for (const Limit& limit : column) {
        heights.push_back(limit.y256);
    }
    return heights;
}

Chunk cut(const Stack& stack, std::int32_t y, std::int32_t height) {
    Chunk chunk;
    cut_chunk(chunk, stack, y, height);
    return chunk;
}

TEST(Chunk, HasTheLimitsInsideAndTheNextOnesOutside) {
    const Stack stack = drawn_stack(4, {"aaabbbccccc"});
    const Chunk chunk = cut(stack, 1, 4);
    ASSERT_FALSE(chunk.uniform);
    EXPECT_EQ(chunk.position, (ChunkPos{.lod = 0, .x = -3, .y = 1, .z = 5}));
    EXPECT_EQ(chunk.side, 4);
    EXPECT_EQ(chunk.height, 4);
    EXPECT_EQ(chunk.columns.width, 4);
    EXPECT_EQ(chunk.columns.x_first, 0);
    ASSERT_EQ(chunk.columns.offsets.size(), 17U);
    EXPECT_THAT(heights_of(chunk.columns.column(0, 0)),
                ElementsAre(3 * 256, 6 * 256, 6 * 256, 11 * 256));
}

TEST(Chunk, LimitsOnTheFloorCountAsBelowAndOnTheCeilingAsAbove) {
    const Stack stack = drawn_stack(4, {"aaaabbbbcccc"});
    const Chunk lower = cut(stack, 0, 6);
    EXPECT_THAT(heights_of(lower.columns.column(0, 0)), ElementsAre(0, 4 * 256, 4 * 256, 8 * 256));
    const Chunk upper = cut(stack, 1, 6);
    // (4, b) is the last at or below 6; (12, void) follows (12, c) at the ceiling and is not
    // needed.
    EXPECT_THAT(heights_of(upper.columns.column(3, 3)),
                ElementsAre(4 * 256, 8 * 256, 8 * 256, 12 * 256));
    const Chunk whole = cut(stack, 2, 4);
    EXPECT_TRUE(whole.uniform);
    EXPECT_EQ(whole.uniform_content, stack.palette[drawn_id('c')]);
    EXPECT_TRUE(whole.columns.limits.empty());
    EXPECT_TRUE(whole.columns.offsets.empty());
    EXPECT_TRUE(whole.palette.empty());
}

TEST(Chunk, TheVoidClosesAColumnThatEndsInside) {
    const Stack stack = drawn_stack(4, {"aaaaa", "aa"});
    const Chunk chunk = cut(stack, 0, 8);
    const auto column = chunk.columns.column(0, 0);
    ASSERT_EQ(column.size(), 4U);
    EXPECT_EQ(column.back().y256, 8 * 256);
    EXPECT_EQ(column.back().flow, Flow{});
    EXPECT_EQ(chunk.palette[column.back().palette_id].kind, PaletteKind::void_);
}

TEST(Chunk, ThePaletteHoldsWhatIsUsedInAscendingStackId) {
    const Stack stack = drawn_stack(4, {"aaB#bb", "aaA#bb"});
    const Chunk chunk = cut(stack, 0, 4);
    EXPECT_THAT(chunk.stack_palette_ids, ElementsAre(0, 4, 5, 6));
    ASSERT_EQ(chunk.palette.size(), 4U);
    for (std::size_t i = 0; i < chunk.palette.size(); ++i) {
        EXPECT_EQ(chunk.palette[i], stack.palette[chunk.stack_palette_ids[i]]);
    }
    const Chunk all = cut(stack, 0, 64);
    for (std::int32_t z = 0; z < 4; ++z) {
        for (std::int32_t x = 0; x < 4; ++x) {
            const auto original = stack.columns.column(x, z);
            const auto column = all.columns.column(x, z);
            ASSERT_EQ(column.size(), original.size() + 1);
            for (std::size_t i = 0; i < original.size(); ++i) {
                Limit limit = column[i];
                limit.palette_id = all.stack_palette_ids[limit.palette_id];
                EXPECT_EQ(limit, original[i]);
            }
        }
    }
}

TEST(Chunk, AboveEverythingIsTheVoidAndBelowTheBase) {
    const Stack stack = drawn_stack(4, {"abc"});
    constexpr std::int32_t kLeast = std::numeric_limits<std::int32_t>::min();
    constexpr std::int32_t kMost = std::numeric_limits<std::int32_t>::max();
    for (const std::int32_t y : {1, 2, 1 << 20, kMost - 1, kMost}) {
        const Chunk chunk = cut(stack, y, 64);
        EXPECT_TRUE(chunk.uniform) << y;
        EXPECT_EQ(chunk.uniform_content.kind, PaletteKind::void_) << y;
        EXPECT_EQ(chunk.position.y, y);
    }
    for (const std::int32_t y : {-1, -2, kLeast + 1, kLeast}) {
        const Chunk chunk = cut(stack, y, 64);
        EXPECT_TRUE(chunk.uniform) << y;
        EXPECT_EQ(chunk.uniform_content, stack.palette[0]) << y;
    }
}

TEST(Chunk, InsideOneCaveIsUniformCave) {
    const Chunk chunk = cut(drawn_stack(4, {"aa#######bb"}), 1, 4);
    EXPECT_TRUE(chunk.uniform);
    EXPECT_EQ(chunk.uniform_content.kind, PaletteKind::cave);
}

TEST(Chunk, TwoElementsOfEqualCompositionAreUniformTogether) {
    EXPECT_TRUE(cut(drawn_stack(4, {"aAAAAABBBBBb"}), 1, 4).uniform);
    EXPECT_TRUE(cut(drawn_stack(4, {"aAAAAAAAAAAb", "aBBBBBBBBBBb"}), 1, 4).uniform);
    EXPECT_FALSE(cut(drawn_stack(4, {"aAAAAABcBBBb"}), 1, 4).uniform);
}

TEST(Chunk, OneDifferentColumnIsEnoughNotToBeUniform) {
    std::vector<std::string> drawings(36, "aaaaaaaa");
    drawings[35] = "a";  // The apron does not count,
    EXPECT_TRUE(cut(drawn_stack(4, drawings), 1, 4).uniform);
    drawings[28] = "aaaa.aaa";  // the last column inside does.
    EXPECT_FALSE(cut(drawn_stack(4, drawings), 1, 4).uniform);
}

TEST(Chunk, HeightsAtTheEndOfInt32DoNotOverflow) {
    constexpr std::int32_t kMost = std::numeric_limits<std::int32_t>::max();
    const std::vector<Limit> column = {{.y256 = 0, .palette_id = 0, .flow = {}},
                                       {.y256 = kMost, .palette_id = 0, .flow = {}},
                                       {.y256 = kMost, .palette_id = 3, .flow = {}}};
    const Stack stack = stack_of_columns(4, {column});
    const std::int32_t top = kMost / (64 * kUnitsPerVoxel);
    EXPECT_TRUE(cut(stack, top - 1, 64).uniform);
    const Chunk chunk = cut(stack, top, 64);
    ASSERT_FALSE(chunk.uniform);
    EXPECT_THAT(heights_of(chunk.columns.column(0, 0)), ElementsAre(0, kMost, kMost, kMost));
}

/// A chunk's limits with the compositions that they show, and nothing of who numbers them how.
std::vector<std::pair<Limit, PaletteEntry>> shown(const ColumnGrid& columns,
                                                  const Palette& palette) {
    std::vector<std::pair<Limit, PaletteEntry>> limits;
    for (Limit limit : columns.limits) {
        const PaletteEntry& entry = palette[limit.palette_id];
        limit.palette_id = 0;
        limits.emplace_back(limit, entry);
    }
    return limits;
}

class CutAtOnce : public testing::TestWithParam<std::string> {};

TEST_P(CutAtOnce, AllChunksOfARectangleAreThoseOfItsStacks) {
    const auto world = load_test_world(GetParam());
    const std::int32_t side = world->definition.grid.side;
    const std::int32_t height = world->definition.grid.height;
    const std::int32_t squares = 100 / side;
    StackGenerator generator(*world);
    ColumnCutter cutter;
    ColumnSet set;
    Stack stack;
    Chunk chunk;
    std::vector<ChunkLimits> cut_at_once;
    for (const std::int64_t first : {-3, 0, 40}) {
        ASSERT_TRUE(generator.generate(
            set, {.x0 = first * side, .z0 = 0, .width = squares * side, .length = side}));
        const std::int32_t count = set.highest_y256 / (height * kUnitsPerVoxel) + 2;
        for (std::int32_t x = 0; x < squares; ++x) {
            cutter.cut(cut_at_once, set.columns, set.palette,
                       {.x0 = x * side, .z0 = 0, .side = side, .height = height, .count = count});
            ASSERT_TRUE(generator.generate(
                stack, {.lod = 0, .x = static_cast<std::int32_t>(first) + x, .z = 0}));
            for (std::int32_t y = 0; y < count; ++y) {
                cut_chunk(chunk, stack, y, height);
                const ChunkLimits& other = cut_at_once[static_cast<std::size_t>(y)];
                ASSERT_EQ(other.uniform, chunk.uniform);
                if (chunk.uniform) {
                    EXPECT_EQ(set.palette[other.content_id], chunk.uniform_content);
                    continue;
                }
                ASSERT_EQ(other.columns.offsets, chunk.columns.offsets);
                ASSERT_EQ(shown(other.columns, set.palette), shown(chunk.columns, chunk.palette));
            }
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Worlds, CutAtOnce,
                         testing::Values("paper-B3-seed42", "dense-seed43", "edge-dense",
                                         "edge-pinch", "edge-deep"),
                         [](const auto& world) {
                             std::string name(world.param);
                             std::erase(name, '-');
                             return name;
                         });

TEST(Chunk, ReusedBuffersLeaveNothingBehind) {
    const Stack stack = drawn_stack(4, {"aaB#bb", "aaA#bb"});
    Chunk reused;
    for (const std::int32_t y : {0, 1, -1, 0, 5, 1, 0}) {
        cut_chunk(reused, stack, y, 4);
        EXPECT_EQ(reused, cut(stack, y, 4)) << y;
    }
}

}  // namespace
}  // namespace terrane
