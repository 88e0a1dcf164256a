// The mesh promises, counted over generated terrain: no interior edge is open, and what two chunks
// share is the same in both, before Draco and after.
#include "generator/mesh/draco_codec.h"
#include "generator/mesh/surface_nets.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "tests/support/mesh_audit.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <iostream>
#include <string>

namespace terrane {
namespace {

struct Area {
    const char* world;
    std::int32_t stacks;  ///< along x and along z, around the origin
};

/// Calls visit(chunk, mesh) for every chunk of the area that has a surface.
template <typename Visit>
void for_each_mesh(const World& world, std::int32_t stacks, Visit visit) {
    StackGenerator generator(world);
    SurfaceNetsMesher mesher(world.definition);
    const std::int32_t height = world.definition.grid.height;
    Stack stack;
    Mesh mesh;
    for (std::int32_t z = -stacks / 2; z < stacks - stacks / 2; ++z) {
        for (std::int32_t x = -stacks / 2; x < stacks - stacks / 2; ++x) {
            ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = x, .z = z}));
            // One chunk above the highest own column: walls up to a higher neighbour are there.
            for (std::int32_t y = -1; (y - 1) * height * kUnitsPerVoxel <= stack.highest_y256;
                 ++y) {
                mesher.mesh(mesh, stack, y, height);
                if (!mesh.indices.empty()) {
                    visit(ChunkPos{.lod = 0, .x = x, .y = y, .z = z}, mesh);
                }
            }
        }
    }
}

TEST(MeshOfWorlds, HasNoOpenEdgeAndNoVertexThatNeighboursDisagreeOn) {
    std::int64_t interior_edges = 0;
    std::int64_t shared_vertices = 0;
    for (const Area& area : {Area{"paper-B3-seed42", 22}, Area{"dense-seed43", 20},
                             Area{"edge-dense", 8}, Area{"edge-pinch", 22}, Area{"edge-many", 4},
                             Area{"edge-deep", 2}, Area{"edge-picky", 10}, Area{"edge-one", 6}}) {
        const auto world = load_test_world(area.world);
        ASSERT_NE(world, nullptr);
        MeshAudit audit(world->definition.grid.side, world->definition.grid.height);
        for_each_mesh(*world, area.stacks,
                      [&](ChunkPos chunk, const Mesh& mesh) { audit.add(mesh, chunk); });
        std::cout << area.world << ": " << audit.interior_edges << " interior edges, "
                  << audit.shared_vertices << " shared vertices\n";
        EXPECT_GT(audit.interior_edges, 5000) << area.world;
        EXPECT_EQ(audit.open_interior_edges, 0) << area.world;
        EXPECT_EQ(audit.open_edges_inside(), 0) << area.world;
        EXPECT_EQ(audit.different_vertices, 0) << area.world;
        interior_edges += audit.interior_edges;
        shared_vertices += audit.shared_vertices;
    }
    EXPECT_GE(interior_edges, 555'000);
    EXPECT_GE(shared_vertices, 8'000);
}

TEST(MeshOfWorlds, StillMeetsAfterDraco) {
    for (const char* name : {"paper-B3-seed42", "edge-dense"}) {
        const auto world = load_test_world(name);
        ASSERT_NE(world, nullptr);
        const Grid& grid = world->definition.grid;
        const DracoSettings settings = {.side = grid.side, .height_voxels = grid.height + 1};
        MeshAudit audit(grid.side, grid.height);
        for_each_mesh(*world, 6, [&](ChunkPos chunk, const Mesh& mesh) {
            const auto bytes = encode_draco(mesh, settings);
            ASSERT_TRUE(bytes) << bytes.error().message;
            const auto decoded = decode_draco(*bytes);
            ASSERT_TRUE(decoded) << decoded.error().message;
            EXPECT_EQ(decoded->triangle_count(), mesh.triangle_count());
            audit.add(*decoded, chunk);
        });
        EXPECT_GT(audit.interior_edges, 5000) << name;
        EXPECT_EQ(audit.open_edges_inside(), 0) << name;
    }
}

}  // namespace
}  // namespace terrane
