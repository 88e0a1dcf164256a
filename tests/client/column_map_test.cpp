// What a client makes of columns against what the generator makes of the whole stack.
#include "client-sample/cpp/column_map.h"

#include "generator/terrain/generate_stack.h"
#include "tests/client/scripted_peer.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <memory>
#include <string>
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
        hello.materials.push_back({.name = material.name,
                                   .color_rgb = (std::uint32_t{color.r} << 16U) |
                                                (std::uint32_t{color.g} << 8U) | color.b,
                                   .texture = {},
                                   .solid = is_solid(material.kind),
                                   .kind = static_cast<WireMaterialKind>(material.kind)});
    }
    hello.mesh_parts = world.definition.has_landscape();
    return hello;
}

/// Vertex for vertex, index for index.
void expect_same(const Mesh& made, const Mesh& expected) {
    EXPECT_EQ(made.positions256, expected.positions256);
    EXPECT_EQ(made.normals, expected.normals);
    EXPECT_EQ(made.colors, expected.colors);
    EXPECT_EQ(made.material_ids, expected.material_ids);
    EXPECT_EQ(made.parts, expected.parts);
    EXPECT_EQ(made.indices, expected.indices);
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
        SCOPED_TRACE("at y " + std::to_string(y));
        const auto mesh = map_->mesh({.lod = 0, .x = -2, .y = y, .z = 1});
        ASSERT_TRUE(mesh) << mesh.error().message;
        Mesh expected;
        mesher.mesh(expected, stack(position), y, height());
        expect_same(*mesh, expected);
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
    expect_same(*mesh, expected);
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
    if (!world_->definition.has_landscape()) {
        expect_same(*mesh, expected);
        return;
    }
    // Caves and overhangs are level 0's only: the rim itself may be another.
    const auto vertices = static_cast<std::size_t>((side() + 1) * (side() + 1));
    ASSERT_GE(mesh->vertex_count(), vertices);
    for (std::size_t i = 0; i < vertices; ++i) {
        if (expected.positions256[i].x < side() * kUnitsPerVoxel) {
            EXPECT_EQ(mesh->positions256[i], expected.positions256[i]) << i;
        }
    }
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
    // Of the heights next to it, or with the rock overhead.
    const bool has_parts = world_->definition.has_landscape();
    EXPECT_EQ(map_->missing_for_mesh(key).size(),
              has_parts ? 9U * static_cast<unsigned>(heights_) : 27U);
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

INSTANTIATE_TEST_SUITE_P(Worlds, ColumnMapTest,
                         testing::Values("basin", "fantasy", "paper-B3", "canyon", "karst",
                                         "coast"),
                         [](const auto& name) {
                             std::string text = name.param;
                             std::erase(text, '-');
                             return text;
                         });

using ColumnMapOfLandscapes = ColumnMapTest;

/// Numbers of vertices.
std::array<std::size_t, 3> count_parts(const Mesh& mesh) {
    std::array<std::size_t, 3> counts{};
    for (const MeshPart part : mesh.parts) {
        ++counts.at(static_cast<std::size_t>(part));
    }
    return counts;
}

TEST_P(ColumnMapOfLandscapes, HaveTheirWaterAndCaves) {
    std::array<std::size_t, 3> counts{};
    SurfaceNetsMesher mesher(world_->definition);
    HeightFieldMesher tile_mesher(world_->definition);
    for (const StackPos position :
         {StackPos{.lod = 0, .x = 0, .z = 0}, StackPos{.lod = 0, .x = 9, .z = -7},
          StackPos{.lod = 0, .x = -20, .z = 14}, StackPos{.lod = 0, .x = 31, .z = 40},
          StackPos{.lod = 1, .x = 6, .z = 2}, StackPos{.lod = 4, .x = -1, .z = 0},
          StackPos{.lod = 6, .x = 0, .z = -1}}) {
        put_around(position);
        for (std::int32_t y = 0; y < (position.lod == 0 ? heights_ : 1); ++y) {
            const ChunkPos key{.lod = position.lod, .x = position.x, .y = y, .z = position.z};
            SCOPED_TRACE("chunk " + std::to_string(key.lod) + "/" + std::to_string(key.x) + "/" +
                         std::to_string(y) + "/" + std::to_string(key.z));
            const auto mesh = map_->mesh(key);
            ASSERT_TRUE(mesh) << mesh.error().message;
            Mesh expected;
            if (key.lod == 0) {
                mesher.mesh(expected, stack(position), y, height());
            } else {
                tile_mesher.mesh(expected, stack(position), true);
            }
            expect_same(*mesh, expected);
            const auto found = count_parts(*mesh);
            std::ranges::transform(counts, found, counts.begin(), std::plus<>());
        }
    }
    EXPECT_GT(counts[0], 1000U);
    EXPECT_GT(counts[2], 100U);
    if (GetParam() == "karst" || GetParam() == "canyon") {
        EXPECT_GT(counts[1], 100U);
    }
}

TEST_P(ColumnMapOfLandscapes, CallACaveGroundWhenTheRockOverItIsNotHeld) {
    put_around({.lod = 0, .x = 0, .z = 0});
    const ChunkPos key{.lod = 0, .x = 0, .y = 0, .z = 0};
    const auto whole = map_->mesh(key);
    ASSERT_TRUE(whole);
    map_->forget({.lod = 0, .x = 0, .y = heights_ - 1, .z = 0});
    const auto refused = map_->mesh(key);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::not_found);
    for (std::int32_t y = 2; y < heights_ - 1; ++y) {
        map_->forget({.lod = 0, .x = 0, .y = y, .z = 0});
    }
    const auto mesh = map_->mesh(key, MissingNeighbour::repeat);
    ASSERT_TRUE(mesh) << mesh.error().message;
    EXPECT_EQ(mesh->positions256, whole->positions256);
    EXPECT_EQ(mesh->normals, whole->normals);
    EXPECT_EQ(mesh->indices, whole->indices);
    ASSERT_EQ(mesh->parts.size(), whole->parts.size());
    for (std::size_t i = 0; i < whole->parts.size(); ++i) {
        EXPECT_LE(mesh->parts[i], whole->parts[i]);
    }
    map_->forget({.lod = 0, .x = 0, .y = 1, .z = 0});
    EXPECT_FALSE(map_->mesh(key, MissingNeighbour::repeat));
}

INSTANTIATE_TEST_SUITE_P(Worlds, ColumnMapOfLandscapes,
                         testing::Values("canyon", "karst", "coast", "alpine"),
                         [](const auto& name) { return name.param; });

}  // namespace
}  // namespace terrane
