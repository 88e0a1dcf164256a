// Levels of detail have exactly the heights and limits of level 0 at their columns.
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/kernels/kernel_choice.h"
#include "generator/terrain/world.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <string>

namespace terrane {
namespace {

std::shared_ptr<const World> without_elements(const World& world) {
    WorldDefinition definition = world.definition;
    definition.terrain.vein_density = 0;
    definition.terrain.cave_density = 0;
    auto barren = World::build(definition);
    EXPECT_TRUE(barren);
    return std::make_shared<const World>(std::move(*barren));
}

bool has_elements(const World& world, std::int32_t lod) {
    const TerrainParameters& terrain = world.definition.terrain;
    return lod == 0 || (1 << lod) <= std::max(terrain.vein_area, terrain.cave_area) / 8;
}

/// Heights and compositions; flow is a slope over the level's own spacing and may differ.
void expect_same_matter(std::span<const Limit> coarse, const Palette& coarse_palette,
                        std::span<const Limit> fine, const Palette& fine_palette) {
    ASSERT_EQ(coarse.size(), fine.size());
    for (std::size_t i = 0; i < coarse.size(); ++i) {
        ASSERT_EQ(coarse[i].y256, fine[i].y256);
        ASSERT_EQ(coarse_palette[coarse[i].palette_id], fine_palette[fine[i].palette_id]);
    }
}

class Levels : public testing::TestWithParam<std::string> {};

TEST_P(Levels, HaveTheColumnsOfLevelZero) {
    const auto world = load_test_world(GetParam());
    const auto barren = without_elements(*world);
    StackGenerator coarse(*world);
    StackGenerator fine(*world);
    StackGenerator fine_barren(*barren);
    Stack stack;
    ColumnSet column;
    for (std::int32_t lod = 0; lod <= kLodMax; ++lod) {
        const StackPos position{.lod = lod, .x = lod % 3 - 2, .z = 1 - lod % 2};
        ASSERT_TRUE(coarse.generate(stack, position));
        const ColumnPos first = first_column_of(position, stack.side);
        StackGenerator& reference = has_elements(*world, lod) ? fine : fine_barren;
        for (std::int32_t z = -1; z <= stack.side; z += 3) {
            for (std::int32_t x = -1; x <= stack.side; ++x) {
                const std::int64_t step = std::int64_t{1} << lod;
                ASSERT_TRUE(reference.generate(
                    column,
                    {.x0 = first.x + x * step, .z0 = first.z + z * step, .width = 1, .length = 1}));
                expect_same_matter(stack.columns.column(x, z), stack.palette,
                                   column.columns.column(0, 0), column.palette);
                ASSERT_FALSE(HasFatalFailure()) << "level " << lod << " at " << x << "," << z;
            }
        }
    }
}

TEST_P(Levels, AreTheSameOnEveryKernelSet) {
    const auto world = load_test_world(GetParam());
    for (const std::int32_t lod : {0, 1, 3, 5, 9, 17}) {
        Stack first;
        for (const KernelSet& set : available_kernel_sets()) {
            Stack stack;
            ASSERT_TRUE(StackGenerator(*world, *set.kernels)
                            .generate(stack, {.lod = lod, .x = -3, .z = 2}));
            if (first.side == 0) {
                first = stack;
            }
            EXPECT_EQ(stack, first) << set.name << " level " << lod;
        }
    }
}

TEST_P(Levels, BeyondTheEdgeOfTheWorldAreRefused) {
    const auto world = load_test_world(GetParam());
    StackGenerator generator(*world);
    Stack stack;
    const auto most = std::numeric_limits<std::int32_t>::max();
    EXPECT_TRUE(generator.generate(stack, {.lod = 0, .x = most, .z = -most - 1}));
    const auto far = generator.generate(stack, {.lod = kLodMax, .x = most, .z = 0});
    if (static_cast<std::int64_t>(most) * stack.side << kLodMax > kColumnCoordinateLimit) {
        ASSERT_FALSE(far);
        EXPECT_EQ(far.error().code, ErrorCode::out_of_range);
    }
    const auto unknown = generator.generate(stack, {.lod = kLodMax + 1, .x = 0, .z = 0});
    ASSERT_FALSE(unknown);
    EXPECT_EQ(unknown.error().code, ErrorCode::unsupported);
}

INSTANTIATE_TEST_SUITE_P(GoldenWorlds, Levels,
                         testing::Values("paper-B3-seed42", "dense-seed43", "edge-dense",
                                         "edge-pinch", "edge-one"),
                         [](const auto& world) {
                             std::string name = world.param;
                             std::replace(name.begin(), name.end(), '-', '_');
                             return name;
                         });

}  // namespace
}  // namespace terrane
