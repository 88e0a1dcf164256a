// A landscape's levels of detail: what a generator made before, how columns are cut into rectangles
// and the kernel set change nothing.
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/kernels/kernel_choice.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>

namespace terrane {
namespace {

class LandscapeLevels : public testing::TestWithParam<const char*> {};

TEST_P(LandscapeLevels, AreTheSameColdAndWarmAndForEveryKernelSet) {
    const auto world = load_shipped_world(GetParam());
    ASSERT_NE(world, nullptr);
    StackGenerator warm(*world);
    for (const std::int32_t lod : {0, 7, 3, 5, 4, 6, 1, 8, 13}) {
        for (const StackPos position :
             {StackPos{.lod = lod, .x = 2, .z = -3}, StackPos{.lod = lod, .x = 3, .z = -3}}) {
            Stack before;
            ASSERT_TRUE(warm.generate(before, position));
            for (const KernelSet& set : available_kernel_sets()) {
                StackGenerator cold(*world, *set.kernels);
                Stack once;
                ASSERT_TRUE(cold.generate(once, position));
                EXPECT_EQ(once, before) << lod << ", " << set.name;
            }
        }
    }
}

TEST_P(LandscapeLevels, AreTheSameInRectanglesOfAnySize) {
    const auto world = load_shipped_world(GetParam());
    ASSERT_NE(world, nullptr);
    StackGenerator generator(*world);
    for (const std::int32_t lod : {3, 4, 5, 6, 7}) {
        const std::int64_t step = std::int64_t{1} << lod;
        const std::int64_t far = std::int64_t{1} << 35;
        ColumnSet all;
        ASSERT_TRUE(generator.generate(
            all, {.x0 = far, .z0 = -far, .width = 40, .length = 12, .lod = lod}));
        for (const std::int32_t side : {1, 3, 7}) {
            for (std::int32_t x = 0; x + side <= 40; x += 3 * side) {
                const std::int32_t z = x % (13 - side);
                ColumnSet part;
                ASSERT_TRUE(generator.generate(part, {.x0 = far + x * step,
                                                      .z0 = -far + z * step,
                                                      .width = side,
                                                      .length = side,
                                                      .lod = lod}));
                for (std::int32_t n = 0; n < side * side; ++n) {
                    const auto a = part.columns.column(n % side, n / side);
                    const auto b = all.columns.column(x + n % side, z + n / side);
                    ASSERT_TRUE(std::equal(a.begin(), a.end(), b.begin(), b.end(),
                                           [&](const Limit& one, const Limit& other) {
                                               return one.y256 == other.y256 &&
                                                      one.flow == other.flow &&
                                                      part.palette[one.palette_id] ==
                                                          all.palette[other.palette_id];
                                           }))
                        << "level " << lod << ", side " << side << ": " << x << "," << z;
                }
            }
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Worlds, LandscapeLevels,
                         testing::Values("canyon", "karst", "fold", "range", "alpine", "coast"),
                         [](const auto& world) { return std::string(world.param); });

}  // namespace
}  // namespace terrane
