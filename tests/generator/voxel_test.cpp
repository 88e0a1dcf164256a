#include "generator/volume/voxel.h"

#include "generator/volume/chunk.h"
#include "generator/volume/color.h"
#include "tests/support/drawn_stack.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace terrane {
namespace {

Limit limit(std::int32_t y256, char letter, Flow flow = {}) {
    return {.y256 = y256, .palette_id = drawn_id(letter), .flow = flow};
}

TEST(Voxel, SharpFrontiersDoNotMix) {
    const Palette palette = drawn_palette();
    const auto column = drawn_column("aac");
    for (const auto& [y, material] :
         {std::pair{0, 0}, {1, 0}, {2, 2}, {3, 3}, {1000, 3}, {-5, 0}}) {
        const Voxel voxel = voxel_at(column, palette, y);
        ASSERT_EQ(voxel.count, 1) << y;
        EXPECT_EQ(voxel.storage[0],
                  (Share{.material = static_cast<std::uint16_t>(material), .concentration = 1}))
            << y;
    }
}

TEST(Voxel, BetweenTwoLimitsCompositionAndFlowAreMixedAtTheVoxelsCentre) {
    // From a at 0 to c at 4 voxels: the centre of voxel 1 is 1.5 / 4 of the way.
    const std::vector<Limit> column = {limit(0, 'a', {.x = 100, .y = -8, .z = 0}),
                                       limit(1024, 'c', {.x = 0, .y = 4, .z = 1})};
    const Voxel voxel = voxel_at(column, drawn_palette(), 1);
    ASSERT_EQ(voxel.count, 2);
    EXPECT_EQ(voxel.storage[0], (Share{.material = 0, .concentration = 0.625}));
    EXPECT_EQ(voxel.storage[1], (Share{.material = 2, .concentration = 0.375}));
    // 62.5 and -3.5 are rounded half away from zero.
    EXPECT_EQ(voxel.flow, (Flow{.x = 63, .y = -4, .z = 0}));
}

TEST(Voxel, SharesOfOneMaterialAreMerged) {
    const std::vector<Limit> column = {limit(0, 'a'), limit(512, 'b')};
    const Voxel voxel = voxel_at(column, drawn_palette(), 0);
    ASSERT_EQ(voxel.count, 2);
    EXPECT_DOUBLE_EQ(voxel.storage[0].concentration, 0.75 + 0.25 * 0.25);
    EXPECT_DOUBLE_EQ(voxel.storage[1].concentration, 0.25 * 0.75);
}

TEST(Voxel, TheVoidMixesLikeAnyComposition) {
    const std::vector<Limit> column = {limit(0, 'a'), limit(512, '.')};
    const Voxel voxel = voxel_at(column, drawn_palette(), 1);
    ASSERT_EQ(voxel.count, 2);
    EXPECT_EQ(voxel.storage[1], (Share{.material = 3, .concentration = 0.75}));
}

TEST(Voxel, EqualEndsAreCopiedExactly) {
    Palette palette = drawn_palette();
    palette[4].composition.storage[0].concentration = 0.1;
    palette[5].composition.storage[0].concentration = 0.1;
    const std::vector<Limit> column = {limit(0, 'A'), limit(7680, 'B')};
    for (std::int64_t y = 0; y < 30; ++y) {
        EXPECT_EQ(voxel_at(column, palette, y).storage[0].concentration, 0.1);
    }
}

TEST(Voxel, ExtremeHeightsAreTheEndsOfTheColumn) {
    const auto column = drawn_column("abc");
    const Palette palette = drawn_palette();
    EXPECT_EQ(voxel_at(column, palette, std::int64_t{1} << 40).storage[0].material, 3);
    EXPECT_EQ(voxel_at(column, palette, -(std::int64_t{1} << 40)).storage[0].material, 0);
}

/// Random blended columns over the drawn palette.
std::vector<Limit> random_column(std::mt19937& random) {
    std::vector<Limit> column = {limit(0, 'a', {.x = 120, .y = 5, .z = -40})};
    const int count = 1 + static_cast<int>(random() % 12);
    for (int i = 0; i < count; ++i) {
        const char letter = "abc.AB#"[random() % 7];
        column.push_back(
            limit(column.back().y256 + static_cast<std::int32_t>(random() % 1500), letter,
                  {.x = static_cast<std::int8_t>(random() % 255 - 127U), .y = 1, .z = 2}));
    }
    column.push_back(limit(column.back().y256, '.'));
    return column;
}

TEST(Voxel, ChunksAndTheRowFormGiveTheWholeColumnsVoxels) {
    std::mt19937 random(7);
    for (int round = 0; round < 20; ++round) {
        std::vector<std::vector<Limit>> columns(36);
        std::ranges::generate(columns, [&] { return random_column(random); });
        const Stack stack = stack_of_columns(4, columns);
        Chunk chunk;
        for (std::int32_t y = -1; y < 12; ++y) {
            cut_chunk(chunk, stack, y, 5);
            for (std::int32_t i = 0; i < 80; ++i) {
                const std::int32_t x = i % 4;
                const std::int32_t z = i / 4 % 4;
                const auto column = stack.columns.column(x, z);
                Voxel whole = voxel_at(column, stack.palette, y * 5 + i / 16);
                std::array<Voxel, 9> row;
                expand_column(row, column, stack.palette, y * 5 + i / 16 - 8);
                EXPECT_EQ(row[8], whole);
                if (chunk.uniform) {
                    whole.flow = {};
                }
                EXPECT_EQ(voxel_of(chunk, x, i / 16, z), whole) << y << ' ' << i;
            }
        }
    }
}

TEST(Color, TheCurveIsTheStandards) {
    for (int code = 0; code < 256; ++code) {
        const double value = code / 255.0;
        const double linear =
            value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
        const auto byte = static_cast<std::uint8_t>(code);
        const LinearColor color = linear_from_srgb({.r = byte, .g = 0, .b = 255});
        EXPECT_NEAR(color.r, linear, 1e-7);
        EXPECT_EQ(srgb_from_linear(color), (Rgb8{.r = byte, .g = 0, .b = 255}));
    }
    EXPECT_EQ(srgb_from_linear({.r = -1, .g = 2, .b = 0.5F}), (Rgb8{.r = 0, .g = 255, .b = 188}));
}

TEST(Color, MixesAreLinearLight) {
    std::vector<Material> materials(4);
    materials[0].color = {.r = 255, .g = 255, .b = 255};
    const std::vector<Limit> column = {limit(0, 'a'), limit(512, 'c')};
    const auto colors = palette_colors(drawn_palette(), std::vector<Material>(6, materials[0]));
    EXPECT_FLOAT_EQ(color_at(column, colors, 256).r, 1.0F);
    const std::vector<Share> half = {{.material = 0, .concentration = 0.5},
                                     {.material = 1, .concentration = 0.5}};
    EXPECT_EQ(srgb_from_linear(color_of(half, materials)), (Rgb8{.r = 188, .g = 188, .b = 188}));
}

}  // namespace
}  // namespace terrane
