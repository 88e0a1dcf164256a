// Landscapes go through all that stacks go through: codec and mesh.
#include "generator/mesh/surface_nets.h"
#include "generator/terrain/generate_stack.h"
#include "generator/volume/chunk_codec.h"
#include "generator/volume/water.h"
#include "tests/support/mesh_audit.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string>

namespace terrane {
namespace {

/// The mesh without the water's surface, which ends at its banks.
Mesh without_water(const Mesh& mesh) {
    Mesh out = mesh;
    out.indices.clear();
    for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
        if (mesh.part_of_triangle(i) != MeshPart::water) {
            const auto corner = mesh.indices.begin() + static_cast<std::ptrdiff_t>(3 * i);
            out.indices.insert(out.indices.end(), corner, corner + 3);
        }
    }
    // Water's vertices come last.
    const auto dry = static_cast<std::size_t>(
        std::find(out.parts.begin(), out.parts.end(), MeshPart::water) - out.parts.begin());
    out.positions256.resize(dry);
    out.normals.resize(dry);
    out.colors.resize(dry);
    out.material_ids.resize(dry);
    out.parts.resize(dry);
    return out;
}

class LandscapeStacks : public testing::TestWithParam<const char*> {};

TEST_P(LandscapeStacks, MeshWithoutCracksAndKeepTheirBytes) {
    const auto world = load_shipped_world(GetParam());
    ASSERT_NE(world, nullptr);
    const std::int32_t height = world->definition.grid.height;
    StackGenerator generator(*world);
    SurfaceNetsMesher mesher(world->definition);
    MeshAudit audit(world->definition.grid.side, height);
    Stack stack;
    Mesh mesh;
    Bytes bytes;
    std::size_t coded_bytes = 0;
    std::int64_t columns = 0;
    for (std::int32_t z = 4; z < 9; ++z) {
        for (std::int32_t x = -3; x < 2; ++x) {
            ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = x, .z = z}));
            encode_stack(bytes, stack);
            coded_bytes += bytes.size();
            columns += std::int64_t{stack.side} * stack.side;
            const auto decoded = decode_stack(bytes, world->definition.materials.size());
            ASSERT_TRUE(decoded) << decoded.error().message;
            EXPECT_EQ(*decoded, stack);
            for (std::int32_t y = -1; (y - 1) * height * kUnitsPerVoxel <= stack.highest_y256;
                 ++y) {
                mesher.mesh(mesh, stack, y, height);
                audit.add(without_water(mesh), {.lod = 0, .x = x, .y = y, .z = z});
            }
        }
    }
    EXPECT_GT(audit.interior_edges, 50000);
    EXPECT_EQ(audit.open_interior_edges, 0);
    EXPECT_EQ(audit.open_edges_inside(), 0);
    EXPECT_EQ(audit.different_vertices, 0);
    const double bytes_a_column = static_cast<double>(coded_bytes) / static_cast<double>(columns);
    EXPECT_LT(bytes_a_column, 90);
    std::printf("%s: %.1f bytes a column\n", GetParam(), bytes_a_column);
}

INSTANTIATE_TEST_SUITE_P(Worlds, LandscapeStacks, testing::Values("canyon", "karst", "coast"),
                         [](const auto& world) { return std::string(world.param); });

TEST(Landscape, NothingStandsAboveTheHeightBoundAtAnyLevel) {
    for (const char* name : {"canyon", "karst", "fold", "range", "alpine", "coast"}) {
        const auto world = load_shipped_world(name);
        ASSERT_NE(world, nullptr);
        StackGenerator generator(*world);
        Stack stack;
        for (std::int32_t lod = 0; lod <= 17; ++lod) {
            ASSERT_TRUE(generator.generate(stack, {.lod = lod, .x = -2, .z = 3})) << lod;
            EXPECT_LE(stack.highest_y256, world->stack.height_bound * kUnitsPerVoxel) << lod;
            for (std::size_t i = 0; i + 1 < stack.columns.offsets.size(); ++i) {
                const Limit& first = stack.columns.limits[stack.columns.offsets[i]];
                const Limit& last = stack.columns.limits[stack.columns.offsets[i + 1] - 1];
                ASSERT_EQ(first.y256, 0);
                ASSERT_EQ(last.palette_id, world->void_id());
            }
        }
    }
}

/// Up to level 4 to the last bit; farther ones leave out what is narrower than their steps.
TEST(Landscape, HeightsOfCoarseLevelsAreThoseOfLevel0) {
    // Without caves, overhangs and channels, whose banks know their neighbours.
    WorldDefinition definition = load_shipped_world("fold")->definition;
    definition.caves.cell = 0;
    definition.relief.overhang = 0;
    definition.relief.rivers = 0;
    const auto world = World::build(definition);
    ASSERT_TRUE(world);
    StackGenerator generator(*world);
    ColumnSet fine;
    ColumnSet coarse;
    for (const std::int32_t lod : {1, 3, 4, 5, 7}) {
        const std::int64_t step = std::int64_t{1} << lod;
        std::int64_t apart256 = 0;
        ASSERT_TRUE(generator.generate(
            coarse, {.x0 = -40 * step, .z0 = 7 * step, .width = 6, .length = 6, .lod = lod}));
        for (std::int32_t z = 0; z < 6; ++z) {
            for (std::int32_t x = 0; x < 6; ++x) {
                ASSERT_TRUE(generator.generate(
                    fine, {.x0 = (x - 40) * step, .z0 = (z + 7) * step, .width = 1, .length = 1}));
                const std::int32_t high = coarse.columns.column(x, z).back().y256;
                const std::int32_t wanted = fine.columns.column(0, 0).back().y256;
                EXPECT_TRUE(lod > 4 || high == wanted) << lod << ": " << high << ", " << wanted;
                apart256 += std::abs(high - wanted);
            }
        }
        EXPECT_LE(apart256 / 36, step * kUnitsPerVoxel / 20) << lod;
    }
}

}  // namespace
}  // namespace terrane
