// Ledges that lean out hang on the ground that they lean out of.
#include "generator/landscape/landscape_palette.h"
#include "tests/support/column_intervals.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <span>
#include <string>
#include <vector>

namespace terrane {
namespace {

using terrane::testing::for_each_column;
using terrane::testing::Interval;
using terrane::testing::solid_intervals;

constexpr std::int32_t kWidth = 512;

/// What lies over the air under overhangs, and all the solid of each column.
struct Ledges {
    std::vector<std::vector<Interval>> solid;
    std::vector<Interval> ledge;  ///< high 0: the column has none
};

Ledges ledges_of(const World& world, std::int64_t x0, std::int64_t z0) {
    const auto size = std::size_t{kWidth} * kWidth;
    Ledges ledges{.solid = std::vector<std::vector<Interval>>(size),
                  .ledge = std::vector<Interval>(size)};
    Palette palette(world.base_palette.begin(), world.base_palette.begin() + world.void_id() + 1);
    const std::uint16_t open_air = append_landscape_palette(palette, world.definition).open_air;
    for_each_column(
        world, x0, z0, kWidth, 64,
        [&](std::int32_t x, std::int32_t z, std::span<const Limit> column, const Palette& names) {
            const auto c = static_cast<std::size_t>(z * kWidth + x);
            ledges.solid[c] = solid_intervals(column, names);
            const bool has_ledge = std::any_of(column.begin(), column.end(), [&](const Limit& one) {
                return one.palette_id == open_air;
            });
            if (has_ledge) {
                ledges.ledge[c] = ledges.solid[c].back();
            }
        });
    return ledges;
}

bool meet(const Interval& a, const Interval& b) {
    return std::min(a.high, b.high) > std::max(a.low, b.low);
}

/// How many columns lie between a column's ledge and the ground that it hangs on, at most `most`.
std::vector<std::int32_t> columns_to_ground(const Ledges& ledges, std::int32_t most) {
    std::vector<std::int32_t> distance(ledges.ledge.size(), most);
    const auto neighbours = [](std::size_t c) {
        return std::array<std::size_t, 8>{c - kWidth - 1, c - kWidth, c - kWidth + 1, c - 1, c + 1,
                                          c + kWidth - 1, c + kWidth, c + kWidth + 1};
    };
    const auto for_each_ledge = [&](auto&& use) {
        for (std::size_t c = kWidth + 1; c + kWidth + 1 < ledges.ledge.size(); ++c) {
            if (ledges.ledge[c].high != 0) {
                use(c);
            }
        }
    };
    for_each_ledge([&](std::size_t c) {
        for (const std::size_t beside : neighbours(c)) {
            for (const Interval& rock : ledges.solid[beside]) {
                const bool is_ledge = ledges.ledge[beside].high == rock.high;
                if (!is_ledge && meet(rock, ledges.ledge[c])) {
                    distance[c] = 1;
                }
            }
        }
    });
    for (std::int32_t step = 2; step < most; ++step) {
        for_each_ledge([&](std::size_t c) {
            for (const std::size_t beside : neighbours(c)) {
                if (distance[c] == most && distance[beside] == step - 1 &&
                    meet(ledges.ledge[beside], ledges.ledge[c])) {
                    distance[c] = step;
                }
            }
        });
    }
    return distance;
}

struct Place {
    const char* world;
    std::int64_t x0;
    std::int64_t z0;
};

struct LedgeCount {
    std::int64_t all = 0;
    std::int64_t in_the_air = 0;
};

/// In the square whose first column is the place; those near its border may hang on what lies
/// beyond.
LedgeCount count_ledges(const World& world, const Place& place) {
    constexpr std::int32_t kFar = 12;  // columns; twice what a ledge can lean out
    const Ledges ledges = ledges_of(world, place.x0, place.z0);
    const std::vector<std::int32_t> distance = columns_to_ground(ledges, kFar);
    LedgeCount count;
    for (std::int32_t z = kFar; z < kWidth - kFar; ++z) {
        for (std::int32_t x = kFar; x < kWidth - kFar; ++x) {
            const auto c = static_cast<std::size_t>(z * kWidth + x);
            if (ledges.ledge[c].high != 0) {
                ++count.all;
                count.in_the_air += distance[c] == kFar ? 1 : 0;
            }
        }
    }
    return count;
}

class LandscapeOverhangs : public ::testing::TestWithParam<Place> {};

TEST_P(LandscapeOverhangs, HangOnTheGroundBesideThem) {
    const auto world = load_shipped_world(GetParam().world);
    ASSERT_NE(world, nullptr);
    const LedgeCount count = count_ledges(*world, GetParam());
    EXPECT_EQ(count.in_the_air, 0);
    EXPECT_GT(count.all, 100);
}

// Takes minutes.
TEST(LandscapeLedges, DISABLED_HangOnTheGroundAllOverTheWorlds) {
    LedgeCount sum;
    for (const char* name : {"canyon", "range", "karst", "fold", "alpine", "coast"}) {
        const auto world = load_shipped_world(name);
        ASSERT_NE(world, nullptr);
        LedgeCount of_world;
        for (std::int64_t k = 1; k <= 240; ++k) {
            const LedgeCount count = count_ledges(*world, {.world = name,
                                                           .x0 = k * 7919 % 40009 * 7 - 100000,
                                                           .z0 = k * 104729 % 40009 * 5 - 90000});
            of_world.all += count.all;
            of_world.in_the_air += count.in_the_air;
        }
        std::printf("%s: %lld columns with a ledge, %lld in the air\n", name,
                    static_cast<long long>(of_world.all),
                    static_cast<long long>(of_world.in_the_air));
        sum.all += of_world.all;
        sum.in_the_air += of_world.in_the_air;
    }
    EXPECT_LT(sum.in_the_air, sum.all / 10000);
}

// Where earlier versions had ledges in the air: rivers and sinkholes had cut into their hills, or
// the land under them had gone over from the rock's shape.
INSTANTIATE_TEST_SUITE_P(
    Places, LandscapeOverhangs,
    ::testing::Values(Place{"canyon", -800, 100}, Place{"canyon", 1200, 100},
                      Place{"canyon", -59216, -78351}, Place{"range", -44430, 33595},
                      Place{"karst", 81277, 50947}, Place{"fold", 102059, -13871},
                      Place{"alpine", -100, 100}, Place{"coast", -100, 100}),
    [](const auto& place) { return std::string(place.param.world) + std::to_string(place.index); });

}  // namespace
}  // namespace terrane
