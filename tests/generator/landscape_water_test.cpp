// Water in landscapes lies in its beds and runs downhill.
#include "generator/landscape/relief.h"
#include "tests/support/column_intervals.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

namespace terrane {
namespace {

using terrane::testing::for_each_column;
using terrane::testing::open_water256;
using terrane::testing::solid_intervals;

class LandscapeWater : public ::testing::TestWithParam<const char*> {};

TEST_P(LandscapeWater, NowhereStandsThreeQuartersOfAVoxelAboveANeighbour) {
    constexpr std::int32_t kWidth = 480;
    const auto world = load_shipped_world(GetParam());
    ASSERT_NE(world, nullptr);
    std::int64_t wet = 0;
    int walls = 0;
    std::string where;
    for (const std::int64_t at : {std::int64_t{-700}, std::int64_t{5000}, std::int64_t{1} << 35}) {
        std::vector<std::int32_t> water(std::size_t{kWidth} * kWidth);
        std::vector<std::int32_t> highest(water.size());
        for_each_column(*world, at, -2 * at, kWidth, 96,
                        [&](std::int32_t x, std::int32_t z, std::span<const Limit> column,
                            const Palette& palette) {
                            const auto i = static_cast<std::size_t>(z * kWidth + x);
                            water[i] = open_water256(column, palette, world->definition.materials);
                            const auto solid = solid_intervals(column, palette);
                            highest[i] = std::max(water[i], solid.back().high);
                        });
        for (std::int32_t z = 0; z + 1 < kWidth; ++z) {
            for (std::int32_t x = 0; x + 1 < kWidth; ++x) {
                const auto i = static_cast<std::size_t>(z * kWidth + x);
                wet += water[i] != INT32_MIN ? 1 : 0;
                for (const std::size_t other : {i + 1, i + kWidth}) {
                    for (const auto& [a, b] : {std::pair(i, other), std::pair(other, i)}) {
                        if (water[a] != INT32_MIN &&
                            water[a] - highest[b] > 3 * kUnitsPerVoxel / 4) {
                            ++walls;
                            where = std::to_string(at + x) + "," + std::to_string(-2 * at + z);
                        }
                    }
                }
            }
        }
    }
    EXPECT_GT(wet, 500);
    EXPECT_EQ(walls, 0) << "the last at " << where;
}

/// How many neighbours of dry columns near water lie over a voxel lower than these, which stand no
/// higher than a bank.
TEST(LandscapeBanks, AreNoWallsInFrontOfLowGround) {
    constexpr std::int32_t kWidth = 256;
    constexpr std::int32_t kNear = 8;
    const auto world = load_shipped_world("canyon");
    ASSERT_NE(world, nullptr);
    std::vector<std::int32_t> water(std::size_t{kWidth} * kWidth);
    std::vector<std::int32_t> top(water.size());
    // Six arms meet here, over ground that lies lower than they do.
    for_each_column(
        *world, -720, 220, kWidth, 64,
        [&](std::int32_t x, std::int32_t z, std::span<const Limit> column, const Palette& palette) {
            const auto i = static_cast<std::size_t>(z * kWidth + x);
            water[i] = open_water256(column, palette, world->definition.materials);
            top[i] = solid_intervals(column, palette).back().high;
        });
    const auto level_near = [&](std::int32_t x, std::int32_t z) {
        std::int32_t level = INT32_MIN;
        for (std::int32_t dz = -kNear; dz <= kNear; ++dz) {
            for (std::int32_t dx = -kNear; dx <= kNear; ++dx) {
                level =
                    std::max(level, water[static_cast<std::size_t>((z + dz) * kWidth + x + dx)]);
            }
        }
        return level;
    };
    int banks = 0;
    int walls = 0;
    for (std::int32_t z = kNear; z < kWidth - kNear; ++z) {
        for (std::int32_t x = kNear; x < kWidth - kNear; ++x) {
            const auto i = static_cast<std::size_t>(z * kWidth + x);
            const std::int32_t level = level_near(x, z);
            if (water[i] != INT32_MIN || level == INT32_MIN ||
                top[i] > level + 2 * kUnitsPerVoxel) {
                continue;
            }
            ++banks;
            for (const std::size_t beside : {i - 1, i + 1, i - kWidth, i + kWidth}) {
                walls += water[beside] == INT32_MIN && top[i] - top[beside] > kUnitsPerVoxel;
            }
        }
    }
    std::printf("%d columns of banks, %d walls\n", banks, walls);
    EXPECT_GT(banks, 3000);
    EXPECT_EQ(walls, 0);
}

INSTANTIATE_TEST_SUITE_P(Worlds, LandscapeWater,
                         ::testing::Values("canyon", "karst", "fold", "range", "alpine", "coast"),
                         [](const auto& world) { return std::string(world.param); });

TEST(LandscapeRivers, RunDownhillAndJoin) {
    const auto world = load_shipped_world("canyon");
    ASSERT_NE(world, nullptr);
    const RiverConstants constants(world->definition);
    RiverGraph graph;
    const std::int64_t far = std::int64_t{1} << 40;
    graph.build(constants,
                {.first_i = far, .last_i = far + 40, .first_j = -far, .last_j = -far + 40});
    int sinks = 0;
    int joins = 0;
    for (const Reach& reach : graph.reaches()) {
        if (reach.is_sink) {
            ++sinks;
            continue;
        }
        EXPECT_LT(reach.level_change, 0);
        const std::int64_t x = reach.x + static_cast<std::int64_t>(reach.px.back());
        const std::int64_t z = reach.z + static_cast<std::int64_t>(reach.pz.back());
        for (const Reach& next : graph.reaches()) {
            if (next.x == x && next.z == z) {
                EXPECT_EQ(reach.level + reach.level_change, next.level);
                EXPECT_FLOAT_EQ(reach.measure + reach.measure_change, next.measure);
                joins += next.measure > reach.measure && reach.measure > 0 ? 1 : 0;
            }
        }
    }
    EXPECT_GT(sinks, 0);
    EXPECT_LT(sinks, 300);
    EXPECT_GT(joins, 100);
}

TEST(LandscapeRivers, AreTheSameFromAnyRangeOfCells) {
    const auto world = load_shipped_world("coast");
    ASSERT_NE(world, nullptr);
    const RiverConstants constants(world->definition);
    RiverGraph wide;
    wide.build(constants, {.first_i = -9, .last_i = 9, .first_j = -8, .last_j = 8});
    for (std::int64_t j = -8; j <= 8; ++j) {
        for (std::int64_t i = -9; i <= 9; ++i) {
            RiverGraph one;
            one.build(constants, {.first_i = i, .last_i = i, .first_j = j, .last_j = j});
            const Reach& a = one.reach(i, j);
            const Reach& b = wide.reach(i, j);
            EXPECT_EQ(a.level, b.level);
            EXPECT_EQ(a.measure, b.measure);
            EXPECT_EQ(a.px, b.px);
            EXPECT_EQ(a.level_change, b.level_change);
        }
    }
}

}  // namespace
}  // namespace terrane
