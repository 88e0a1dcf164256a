// Rock hangs together, caves can be reached, and columns stay short.
#include "tests/support/column_intervals.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace terrane {
namespace {

using terrane::testing::for_each_column;
using terrane::testing::hollow_intervals;
using terrane::testing::Interval;
using terrane::testing::JoinedIntervals;
using terrane::testing::kSky256;
using terrane::testing::solid_intervals;

constexpr std::int32_t kWidth = 512;

struct Square {
    std::vector<std::vector<Interval>> solid;
    std::size_t limits = 0;
};

Square square_of(const World& world) {
    Square square;
    square.solid.resize(std::size_t{kWidth} * kWidth);
    for_each_column(
        world, -kWidth, 3 * kWidth, kWidth, 64,
        [&](std::int32_t x, std::int32_t z, std::span<const Limit> column, const Palette& palette) {
            square.solid[static_cast<std::size_t>(z * kWidth + x)] =
                solid_intervals(column, palette);
            square.limits += column.size();
        });
    return square;
}

double voxels(const Interval& interval) {
    return static_cast<double>(interval.high - interval.low) / kUnitsPerVoxel;
}

bool is_border(std::size_t column) {
    const std::size_t x = column % kWidth;
    const std::size_t z = column / kWidth;
    return x == 0 || z == 0 || x + 1 == kWidth || z + 1 == kWidth;
}

/// Share of the solid that hangs on nothing: neither on the bottom nor on the square's border.
double floating_share(const Square& square) {
    JoinedIntervals joined(square.solid, kWidth, 1);
    std::vector<std::uint8_t> held(joined.size(), 0);
    for (std::size_t c = 0; c < square.solid.size(); ++c) {
        for (std::size_t i = 0; i < square.solid[c].size(); ++i) {
            if (square.solid[c][i].low == 0 || is_border(c)) {
                held[joined.root(c, i)] = 1;
            }
        }
    }
    double all = 0;
    double floating = 0;
    for (std::size_t c = 0; c < square.solid.size(); ++c) {
        for (std::size_t i = 0; i < square.solid[c].size(); ++i) {
            all += voxels(square.solid[c][i]);
            floating += held[joined.root(c, i)] == 0 ? voxels(square.solid[c][i]) : 0;
        }
    }
    return floating / all;
}

struct CaveShares {
    double volume = 0;
    double reached = 0;  ///< share that hangs together with the sky
    double largest = 0;  ///< share of the largest system, the sky not counted as a way
};

CaveShares cave_shares(const Square& square) {
    std::vector<std::vector<Interval>> with_sky;
    std::vector<std::vector<Interval>> caves;
    for (const auto& column : square.solid) {
        with_sky.push_back(hollow_intervals(column));
        caves.push_back(with_sky.back());
        caves.back().pop_back();
    }
    CaveShares shares;
    JoinedIntervals open(with_sky, kWidth, kUnitsPerVoxel);
    std::vector<std::uint8_t> reached(open.size(), 0);
    for (std::size_t c = 0; c < with_sky.size(); ++c) {
        reached[open.root(c, with_sky[c].size() - 1)] = 1;
    }
    JoinedIntervals systems(caves, kWidth, kUnitsPerVoxel);
    std::vector<double> volumes(systems.size(), 0);
    for (std::size_t c = 0; c < caves.size(); ++c) {
        for (std::size_t i = 0; i < caves[c].size(); ++i) {
            const double volume = voxels(caves[c][i]);
            shares.volume += volume;
            shares.reached += reached[open.root(c, i)] != 0 ? volume : 0;
            volumes[systems.root(c, i)] += volume;
        }
    }
    shares.reached /= shares.volume;
    shares.largest = *std::max_element(volumes.begin(), volumes.end()) / shares.volume;
    return shares;
}

class LandscapeRock : public ::testing::TestWithParam<const char*> {};

TEST_P(LandscapeRock, HangsTogether) {
    const auto world = load_shipped_world(GetParam());
    ASSERT_NE(world, nullptr);
    const Square square = square_of(*world);
    const double floating = floating_share(square);
    EXPECT_LT(floating, world->definition.relief.overhang > 0 ? 1e-5 : 1e-6);
    const double limits = static_cast<double>(square.limits) / (kWidth * kWidth);
    RecordProperty("floating", std::to_string(floating));
    RecordProperty("limits", std::to_string(limits));
    std::printf("%s: %.2e floating, %.1f limits a column\n", GetParam(), floating, limits);
}

TEST_P(LandscapeRock, WithoutOverhangsHangsTogether) {
    WorldDefinition definition = load_shipped_world(GetParam())->definition;
    definition.relief.overhang = 0;
    const auto world = World::build(definition);
    ASSERT_TRUE(world);
    const double floating = floating_share(square_of(*world));
    EXPECT_LT(floating, 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Worlds, LandscapeRock,
                         ::testing::Values("canyon", "karst", "fold", "range", "alpine", "coast"),
                         [](const auto& world) { return std::string(world.param); });

TEST_P(LandscapeRock, HasCavesThatCanBeReached) {
    const CaveShares shares = cave_shares(square_of(*load_shipped_world(GetParam())));
    EXPECT_GT(shares.volume, 10000);
    EXPECT_GE(shares.reached, 0.66);
    std::printf("%s: %.0f voxels of caves, %.0f %% reached\n", GetParam(), shares.volume,
                100 * shares.reached);
}

/// Neither between two that show the same nor third at one height.
TEST_P(LandscapeRock, HasNoLimitForNothing) {
    constexpr std::int32_t kSide = 128;
    std::size_t limits = 0;
    std::size_t idle = 0;
    for_each_column(*load_shipped_world(GetParam()), 700, -300, kSide, 64,
                    [&](std::int32_t, std::int32_t, std::span<const Limit> column, const Palette&) {
                        limits += column.size();
                        const auto same = [](const Limit& a, const Limit& b) {
                            return a.palette_id == b.palette_id && a.flow == b.flow;
                        };
                        for (std::size_t i = 1; i + 1 < column.size(); ++i) {
                            const Limit& before = column[i - 1];
                            const Limit& after = column[i + 1];
                            idle += (same(before, column[i]) && same(column[i], after)) ||
                                            before.y256 == after.y256
                                        ? std::size_t{1}
                                        : std::size_t{0};
                        }
                    });
    EXPECT_GT(limits, std::size_t{10} * kSide * kSide);
    EXPECT_EQ(idle, 0U);
}

/// Of the six worlds; a single one may have more.
TEST(LandscapeColumns, AreShortOnAverage) {
    double limits = 0;
    constexpr std::array kWorlds = {"canyon", "karst", "fold", "range", "alpine", "coast"};
    for (const char* name : kWorlds) {
        limits += static_cast<double>(square_of(*load_shipped_world(name)).limits);
    }
    EXPECT_LE(limits / (kWidth * kWidth) / kWorlds.size(), 24);
}

TEST(LandscapeCaves, CanBeReachedAndJoinToSystems) {
    const WorldDefinition karst = load_shipped_world("karst")->definition;
    int great = 0;
    for (const std::uint64_t seed :
         {karst.seed, std::uint64_t{21}, std::uint64_t{22}, std::uint64_t{23}}) {
        WorldDefinition definition = karst;
        definition.seed = seed;
        const auto world = World::build(definition);
        ASSERT_TRUE(world);
        const CaveShares shares = cave_shares(square_of(*world));
        EXPECT_GT(shares.volume, 10000) << seed;
        EXPECT_GE(shares.reached, 0.66) << seed;
        great += shares.largest > 0.5 ? 1 : 0;
        std::printf("seed %d: %.0f voxels of caves, %.0f %% reached, largest system %.0f %%\n",
                    static_cast<int>(seed), shares.volume, 100 * shares.reached,
                    100 * shares.largest);
    }
    EXPECT_GE(great, 3);
}

}  // namespace
}  // namespace terrane
