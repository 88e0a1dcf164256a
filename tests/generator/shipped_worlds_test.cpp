// The worlds of generator/worlds keep what they promise.
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "generator/world/world_file.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>

namespace terrane {
namespace {

std::map<MaterialKind, int> kinds_of(const WorldDefinition& world) {
    std::map<MaterialKind, int> counts;
    for (const Material& material : world.materials) {
        ++counts[material.kind];
    }
    return counts;
}

TEST(ShippedWorlds, OfThePaperAreItsTable2) {
    struct Row {
        const char* name;
        int regular, veins, caves;
        double density;
    };

    const Row rows[] = {{"paper-A0", 3, 0, 0, 0},   {"paper-A1", 3, 1, 0, 0.5},
                        {"paper-A2", 3, 0, 1, 0.5}, {"paper-A3", 3, 1, 1, 0.25},
                        {"paper-B0", 6, 0, 0, 0},   {"paper-B1", 6, 2, 0, 0.5},
                        {"paper-B2", 6, 0, 1, 0.5}, {"paper-B3", 6, 2, 1, 0.25}};
    const WorldDefinition b3 = load_shipped_world("paper-B3")->definition;
    for (const Row& row : rows) {
        const WorldDefinition world = load_shipped_world(row.name)->definition;
        EXPECT_EQ(kinds_of(world)[MaterialKind::void_], 1) << row.name;
        EXPECT_EQ(kinds_of(world)[MaterialKind::base], 1) << row.name;
        EXPECT_EQ(kinds_of(world)[MaterialKind::regular], row.regular) << row.name;
        EXPECT_EQ(kinds_of(world)[MaterialKind::vein], row.veins) << row.name;
        EXPECT_EQ(kinds_of(world)[MaterialKind::cave], row.caves) << row.name;
        EXPECT_EQ(world.terrain.vein_density, row.veins > 0 ? row.density : 0) << row.name;
        EXPECT_EQ(world.terrain.cave_density, row.caves > 0 ? row.density : 0) << row.name;
        for (const Material& material : world.materials) {
            EXPECT_NE(std::find(b3.materials.begin(), b3.materials.end(), material),
                      b3.materials.end())
                << row.name << ": " << material.name;
        }
        TerrainParameters terrain = world.terrain;
        terrain.vein_density = b3.terrain.vein_density;
        terrain.cave_density = b3.terrain.cave_density;
        EXPECT_EQ(terrain, b3.terrain) << row.name;
        EXPECT_EQ(world.grid, b3.grid) << row.name;
        EXPECT_EQ(world.seed, b3.seed) << row.name;
    }
}

TEST(ShippedWorlds, PaperB3IsTheGoldenOneToTheLastBit) {
    WorldDefinition shipped = load_shipped_world("paper-B3")->definition;
    const WorldDefinition golden = load_test_world("paper-B3-seed42")->definition;
    shipped.name = golden.name;
    EXPECT_EQ(shipped, golden);
}

/// Whether the topmost thing that has any thickness in the column is a cave.
bool opens_to_the_sky(std::span<const Limit> column, const Palette& palette) {
    const std::int32_t top_y256 = column.back().y256;
    const auto below = std::find_if(column.rbegin(), column.rend(), [&](const Limit& limit) {
        return palette[limit.palette_id].kind != PaletteKind::void_ && limit.y256 == top_y256;
    });
    return below != column.rend() && palette[below->palette_id].kind == PaletteKind::cave;
}

TEST(ShippedWorlds, BasinHasNoCaveOpenToTheSkyWithin500ColumnsOfTheOrigin) {
    const auto world = load_shipped_world("basin");
    ASSERT_NE(world, nullptr);
    ASSERT_EQ(world->definition.grid.side, 32);
    ASSERT_EQ(world->definition.grid.height, 32);
    EXPECT_LE(world->definition.terrain.depth, 200);
    constexpr std::int32_t kReach = 500;
    constexpr std::int32_t kSide = 32;
    StackGenerator generator(*world);
    Stack stack;
    std::int64_t columns = 0;
    std::int64_t cave_limits = 0;
    for (std::int32_t sz = -kReach / kSide - 1; sz <= kReach / kSide; ++sz) {
        for (std::int32_t sx = -kReach / kSide - 1; sx <= kReach / kSide; ++sx) {
            ASSERT_TRUE(generator.generate(stack, {.x = sx, .z = sz}));
            for (std::int32_t z = 0; z < kSide; ++z) {
                for (std::int32_t x = 0; x < kSide; ++x) {
                    const auto column = stack.columns.column(x, z);
                    ASSERT_FALSE(opens_to_the_sky(column, stack.palette))
                        << sx * kSide + x << "," << sz * kSide + z;
                    ++columns;
                    cave_limits +=
                        std::count_if(column.begin(), column.end(), [&](const Limit& limit) {
                            return stack.palette[limit.palette_id].kind == PaletteKind::cave;
                        });
                }
            }
        }
    }
    EXPECT_GE(columns, 1001 * 1001);
    EXPECT_GT(cave_limits, 1000);  // it does have caves
}

TEST(ShippedWorlds, OfFantasyDoHaveCavesOpenToTheSky) {
    // The same question that finds none in basin finds some where there are.
    const auto world = load_shipped_world("fantasy");
    ASSERT_NE(world, nullptr);
    StackGenerator generator(*world);
    Stack stack;
    int open = 0;
    for (std::int32_t sz = -4; sz < 4; ++sz) {
        for (std::int32_t sx = -4; sx < 4; ++sx) {
            ASSERT_TRUE(generator.generate(stack, {.x = sx, .z = sz}));
            for (std::int32_t x = 0; x < world->definition.grid.side; ++x) {
                open += opens_to_the_sky(stack.columns.column(x, 0), stack.palette) ? 1 : 0;
            }
        }
    }
    EXPECT_GT(open, 0);
}

}  // namespace
}  // namespace terrane
