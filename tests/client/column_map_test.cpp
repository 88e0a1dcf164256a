// What a client makes of columns against what the generator makes of the whole stack.
#include "client-sample/cpp/column_map.h"

#include "generator/terrain/generate_stack.h"
#include "tests/client/scripted_peer.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <tuple>
#include <vector>

namespace terrane {
namespace {

/// The hello of a server of this world, as far as a column map looks at it.
ServerHello hello_of(const World& world) {
    ServerHello hello = test_hello();
    hello.chunk_side = world.definition.grid.side;
    hello.chunk_height = world.definition.grid.height;
    hello.height_bound_voxels = world.stack.height_bound;
    hello.levels = kLodMax + 1;
    hello.materials.clear();
    for (const Material& material : world.definition.materials) {
        const Rgb8 color = material.color;
        hello.materials.push_back(
            {.name = material.name,
             .color_rgb =
                 (std::uint32_t{color.r} << 16U) | (std::uint32_t{color.g} << 8U) | color.b,
             .texture = {},
             .solid = material.kind != MaterialKind::void_ && material.kind != MaterialKind::cave});
    }
    return hello;
}

using Corner = std::tuple<int, int, int, int, int, int, int, float, float, float>;
using Triangle = std::array<Corner, 3>;

/// A mesh as a sorted list of triangles, so that vertices may be numbered in any order.
std::vector<Triangle> triangles_of(const Mesh& mesh) {
    std::vector<Triangle> triangles;
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
        Triangle triangle;
        for (std::size_t k = 0; k < 3; ++k) {
            const auto v = mesh.indices[i + k];
            const auto& p = mesh.positions256[v];
            const auto& c = mesh.colors[v];
            const auto& n = mesh.normals[v];
            triangle[k] = {p.x, p.y, p.z, c.r, c.g, c.b, mesh.material_ids[v], n.x, n.y, n.z};
        }
        std::ranges::rotate(triangle, std::ranges::min_element(triangle));
        triangles.push_back(triangle);
    }
    std::ranges::sort(triangles);
    return triangles;
}

/// Whole stacks around the origin, generated here and given to a map as the server would cut them.
class ColumnMapTest : public testing::TestWithParam<std::string> {
  protected:
    void SetUp() override {
        world_ = load_shipped_world(GetParam());
        ASSERT_NE(world_, nullptr);
        map_ = std::make_unique<ColumnMap>(hello_of(*world_));
        heights_ = static_cast<std::int32_t>(world_->stack.height_bound) / height() + 1;
    }

    std::int32_t side() const { return world_->definition.grid.side; }

    std::int32_t height() const { return world_->definition.grid.height; }

    const Stack& stack(StackPos position) {
        const auto known = stacks_.find(position);
        if (known != stacks_.end()) {
            return known->second;
        }
        StackGenerator generator(*world_);
        Stack made;
        EXPECT_TRUE(generator.generate(made, position));
        return stacks_.emplace(position, std::move(made)).first->second;
    }

    void put(StackPos position) {
        const std::int32_t heights = position.lod == 0 ? heights_ : 1;
        for (std::int32_t y = 0; y < heights; ++y) {
            Chunk chunk;
            cut_chunk(chunk, stack(position), y, height());
            if (chunk.uniform) {
                ChunkAnswer answer{.request_id = 0,
                                   .key = chunk.position,
                                   .format = ChunkFormat::columns,
                                   .status = ChunkStatus::uniform,
                                   .source = ChunkSource::cache,
                                   .etag = {},
                                   .timings = {},
                                   .payload_bytes = 0,
                                   .uniform = {}};
                for (const Share& share : chunk.uniform_content.composition.shares()) {
                    answer.uniform.push_back(
                        {.material = share.material, .concentration = share.concentration});
                }
                ASSERT_TRUE(map_->put(answer, {}));
            } else {
                map_->put(chunk);
            }
        }
    }

    void put_around(StackPos position) {
        for (std::int32_t z = -1; z <= 1; ++z) {
            for (std::int32_t x = -1; x <= 1; ++x) {
                put({.lod = position.lod, .x = position.x + x, .z = position.z + z});
            }
        }
    }

    std::shared_ptr<const World> world_;
    std::unique_ptr<ColumnMap> map_;
    std::map<StackPos, Stack> stacks_;
    std::int32_t heights_ = 0;
};

TEST_P(ColumnMapTest, MeshesWhatTheServerMeshes) {
    const StackPos position{.lod = 0, .x = -2, .z = 1};
    put_around(position);
    SurfaceNetsMesher mesher(world_->definition);
    std::size_t triangles = 0;
    for (std::int32_t y = 0; y < heights_; ++y) {
        const auto mesh = map_->mesh({.lod = 0, .x = -2, .y = y, .z = 1});
        ASSERT_TRUE(mesh) << mesh.error().message;
        Mesh expected;
        mesher.mesh(expected, stack(position), y, height());
        EXPECT_EQ(triangles_of(*mesh), triangles_of(expected)) << "at y " << y;
        triangles += mesh->triangle_count();
    }
    EXPECT_GT(triangles, 100U);
}

TEST_P(ColumnMapTest, MeshesTheTilesOfLevelsToo) {
    const StackPos position{.lod = 3, .x = 0, .z = -1};
    put_around(position);
    HeightFieldMesher mesher(world_->definition);
    const auto mesh = map_->mesh({.lod = 3, .x = 0, .y = 0, .z = -1});
    ASSERT_TRUE(mesh) << mesh.error().message;
    Mesh expected;
    mesher.mesh(expected, stack(position), true);
    EXPECT_EQ(triangles_of(*mesh), triangles_of(expected));
}

TEST_P(ColumnMapTest, TakesFinerColumnsAtTheRimOfALevel) {
    const StackPos position{.lod = 1, .x = 0, .z = 0};
    put_around(position);
    // Beside it to the east lies level 0 in place of level 1: four stacks, of which two touch it.
    map_->forget({.lod = 1, .x = 1, .y = 0, .z = 0});
    put({.lod = 0, .x = 2, .z = 0});
    put({.lod = 0, .x = 2, .z = 1});
    EXPECT_FALSE(map_->mesh({.lod = 1, .x = 0, .y = 0, .z = 0}));
    const auto mesh = map_->mesh({.lod = 1, .x = 0, .y = 0, .z = 0}, MissingNeighbour::repeat);
    ASSERT_TRUE(mesh) << mesh.error().message;
    Mesh expected;
    HeightFieldMesher(world_->definition).mesh(expected, stack(position), true);
    EXPECT_EQ(triangles_of(*mesh), triangles_of(expected));
}

TEST_P(ColumnMapTest, GivesColumnsAndVoxelsOfTheWholeStack) {
    const StackPos position{.lod = 0, .x = 3, .z = -4};
    put(position);
    for (const ColumnPos local :
         {ColumnPos{.x = 0, .z = 0}, ColumnPos{.x = side() / 2, .z = side() / 3},
          ColumnPos{.x = side() - 1, .z = side() - 1}}) {
        const ColumnPos place{.x = 3 * side() + local.x, .z = -4 * side() + local.z};
        const auto limits = stack(position).columns.column(static_cast<std::int32_t>(local.x),
                                                           static_cast<std::int32_t>(local.z));
        const auto column = map_->column(place);
        ASSERT_TRUE(column);
        for (std::int32_t y = 0; y < heights_ * height(); ++y) {
            const Voxel expected = voxel_at(limits, stack(position).palette, y);
            // A chunk of one content throughout says so, and no more: its flow is not sent.
            const Voxel joined = voxel_at(column->limits, column->palette, y);
            EXPECT_TRUE(std::ranges::equal(joined.shares(), expected.shares())) << "y " << y;
            const auto asked = map_->voxel({.x = place.x, .y = y, .z = place.z});
            ASSERT_TRUE(asked);
            EXPECT_TRUE(std::ranges::equal(asked->shares(), expected.shares())) << "y " << y;
        }
        const auto ground = map_->ground_under(place, 1e9);
        ASSERT_TRUE(ground);
        EXPECT_EQ(map_->is_solid(
                      {.x = place.x, .y = static_cast<std::int64_t>(*ground) - 1, .z = place.z}),
                  true);
        EXPECT_EQ(map_->is_solid(
                      {.x = place.x, .y = static_cast<std::int64_t>(*ground) + 1, .z = place.z}),
                  false);
    }
    EXPECT_FALSE(map_->column({.x = 0, .z = 0}));
    EXPECT_FALSE(map_->voxel({.x = 0, .y = 3, .z = 0}));
}

TEST_P(ColumnMapTest, NamesWhatAMeshLacks) {
    const ChunkPos key{.lod = 0, .x = 0, .y = 1, .z = 0};
    EXPECT_EQ(map_->missing_for_mesh(key).size(), 27U);
    put_around({.lod = 0, .x = 0, .z = 0});
    EXPECT_TRUE(map_->missing_for_mesh(key).empty());
    map_->forget({.lod = 0, .x = 1, .y = 2, .z = -1});
    const auto missing = map_->missing_for_mesh(key);
    ASSERT_EQ(missing.size(), 1U);
    EXPECT_EQ(missing[0], (ChunkPos{.lod = 0, .x = 1, .y = 2, .z = -1}));
    const auto refused = map_->mesh(key);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::not_found);
    EXPECT_NE(refused.error().message.find("chunk 0/1/2/-1"), std::string::npos);
    EXPECT_TRUE(map_->mesh(key, MissingNeighbour::repeat));
}

INSTANTIATE_TEST_SUITE_P(Worlds, ColumnMapTest, testing::Values("basin", "fantasy", "paper-B3"),
                         [](const auto& name) {
                             std::string text = name.param;
                             std::erase(text, '-');
                             return text;
                         });

}  // namespace
}  // namespace terrane
