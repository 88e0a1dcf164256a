#include "generator/mesh/height_field.h"

#include "generator/mesh/draco_codec.h"
#include "generator/terrain/generate_stack.h"
#include "tests/support/test_world.h"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <utility>

namespace terrane {
namespace {

struct Tile {
    Stack stack;
    Mesh mesh;
};

Tile make_tile(const World& world, StackPos position, bool with_skirts) {
    Tile tile;
    StackGenerator generator(world);
    EXPECT_TRUE(generator.generate(tile.stack, position));
    HeightFieldMesher(world.definition).mesh(tile.mesh, tile.stack, with_skirts);
    return tile;
}

/// How often each directed edge is used; of a closed surface each way once.
std::map<std::pair<std::uint32_t, std::uint32_t>, int> directed_edges(const Mesh& mesh) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
        for (std::size_t j = 0; j < 3; ++j) {
            ++edges[{mesh.indices[i + j], mesh.indices[i + (j + 1) % 3]}];
        }
    }
    return edges;
}

TEST(HeightField, FacesUpAndHasTheHeightsOfItsColumns) {
    const auto world = load_test_world("paper-B3-seed42");
    for (const std::int32_t lod : {1, 4, 17}) {
        const Tile tile = make_tile(*world, {.lod = lod, .x = -2, .z = 3}, false);
        const auto side = static_cast<std::size_t>(tile.stack.side);
        ASSERT_EQ(tile.mesh.vertex_count(), (side + 1) * (side + 1));
        ASSERT_EQ(tile.mesh.triangle_count(), 2 * side * side);
        for (const glm::i32vec3& p : tile.mesh.positions256) {
            const auto column = tile.stack.columns.column(p.x / 256, p.z / 256);
            EXPECT_EQ(p.y, column.back().y256);
        }
        for (std::size_t i = 0; i < tile.mesh.indices.size(); i += 3) {
            const auto at = [&](std::size_t j) {
                return glm::vec3(tile.mesh.positions256[tile.mesh.indices[i + j]]);
            };
            EXPECT_GT(glm::cross(at(1) - at(0), at(2) - at(0)).y, 0);
        }
        for (const glm::vec3& normal : tile.mesh.normals) {
            EXPECT_NEAR(glm::length(normal), 1, 1e-5);
            EXPECT_GT(normal.y, 0);
        }
    }
}

TEST(HeightField, OfNeighboursAgreesOnTheSharedSide) {
    const auto world = load_test_world("dense-seed43");
    const Tile west = make_tile(*world, {.lod = 1, .x = -1, .z = 0}, false);
    const Tile east = make_tile(*world, {.lod = 1, .x = 0, .z = 0}, false);
    const Tile south = make_tile(*world, {.lod = 1, .x = -1, .z = 1}, false);
    const auto side = static_cast<std::size_t>(west.stack.side);
    const std::size_t row = side + 1;
    for (std::size_t i = 0; i < row; ++i) {
        const std::pair<std::size_t, std::size_t> with_east{i * row + side, i * row};
        const std::pair<std::size_t, std::size_t> with_south{side * row + i, i};
        for (const auto& [mesh, at] :
             {std::pair(&east.mesh, with_east), std::pair(&south.mesh, with_south)}) {
            EXPECT_EQ(west.mesh.positions256[at.first].y, mesh->positions256[at.second].y);
            EXPECT_EQ(west.mesh.normals[at.first], mesh->normals[at.second]);
            EXPECT_EQ(west.mesh.colors[at.first], mesh->colors[at.second]);
            EXPECT_EQ(west.mesh.material_ids[at.first], mesh->material_ids[at.second]);
        }
    }
}

TEST(HeightField, SkirtsCloseItsSidesAndStayAboveZero) {
    const auto world = load_test_world("paper-B3-seed42");
    for (const std::int32_t lod : {1, 2, 10}) {
        const Tile bare = make_tile(*world, {.lod = lod, .x = 0, .z = 0}, false);
        const Tile tile = make_tile(*world, {.lod = lod, .x = 0, .z = 0}, true);
        const auto side = static_cast<std::size_t>(tile.stack.side);
        EXPECT_EQ(tile.mesh.vertex_count(), bare.mesh.vertex_count() + 4 * (side + 1));
        const auto edges = directed_edges(tile.mesh);
        std::size_t open_at_the_top = 0;
        for (const auto& [edge, count] : edges) {
            EXPECT_EQ(count, 1);
            const bool both_on_top =
                edge.first < bare.mesh.vertex_count() && edge.second < bare.mesh.vertex_count();
            if (both_on_top && !edges.contains({edge.second, edge.first})) {
                ++open_at_the_top;
            }
        }
        EXPECT_EQ(open_at_the_top, 0U);
        for (std::size_t i = bare.mesh.vertex_count(); i < tile.mesh.vertex_count(); ++i) {
            EXPECT_GE(tile.mesh.positions256[i].y, 0);
        }
    }
}

/// What hangs in the plane at `at256` along one axis (0 or 2): its area by part, in 1/65536 square
/// cells, doubled; and where it faces.
struct Hanging {
    std::map<MeshPart, std::int64_t> area;
    std::map<std::int64_t, int> facing;  ///< the sign of the normal along the axis
};

Hanging hanging_at(const Mesh& mesh, int axis, std::int32_t at256) {
    Hanging hanging;
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
        const auto corner = [&](std::size_t j) { return mesh.positions256[mesh.indices[i + j]]; };
        if (corner(0)[axis] != at256 || corner(1)[axis] != at256 || corner(2)[axis] != at256) {
            continue;
        }
        const auto a = corner(1) - corner(0);
        const auto b = corner(2) - corner(0);
        const std::int64_t turned = axis == 0 ? std::int64_t{a.y} * b.z - std::int64_t{a.z} * b.y
                                              : std::int64_t{a.x} * b.y - std::int64_t{a.y} * b.x;
        const MeshPart part = mesh.parts.empty() ? MeshPart::ground : mesh.parts[mesh.indices[i]];
        hanging.area[part] += std::abs(turned);
        if (turned != 0) {
            ++hanging.facing[turned > 0 ? 1 : -1];
        }
    }
    return hanging;
}

// Whatever of level 0 ends at a side of level 1's tile, tubes above all, ends at something.
TEST(HeightField, OfALandscapesLevelOneClosesItsSidesDownToZero) {
    const auto world = load_shipped_world("karst");
    ASSERT_NE(world, nullptr);
    Tile tile = make_tile(*world, {.lod = 1, .x = -7, .z = 4}, true);
    const std::int32_t side = tile.stack.side;
    for (const int axis : {0, 2}) {
        for (const std::int32_t at : {0, side}) {
            std::int64_t under_the_edge = 0;
            for (std::int32_t i = 0; i < side; ++i) {
                const auto top = [&](std::int32_t along) {
                    const std::size_t x = static_cast<std::size_t>(axis == 0 ? at : along);
                    const std::size_t z = static_cast<std::size_t>(axis == 0 ? along : at);
                    return tile.mesh.positions256[z * static_cast<std::size_t>(side + 1) + x].y;
                };
                under_the_edge += std::int64_t{256} * (top(i) + top(i + 1));
            }
            Hanging hanging = hanging_at(tile.mesh, axis, at * 256);
            EXPECT_EQ(hanging.area[MeshPart::ground] + hanging.area[MeshPart::cave],
                      under_the_edge);
            EXPECT_GT(hanging.area[MeshPart::cave], hanging.area[MeshPart::ground]);
            ASSERT_EQ(hanging.facing.size(), 1U);
            EXPECT_EQ(hanging.facing.begin()->first, at == 0 ? -1 : 1) << "not outwards";
        }
    }
    const auto tallest = static_cast<std::int32_t>(world->stack.height_bound) + 3;
    const auto bytes = encode_draco(tile.mesh, {.side = side, .height_voxels = tallest});
    ASSERT_TRUE(bytes);
    const auto decoded = decode_draco(*bytes);
    ASSERT_TRUE(decoded);
    EXPECT_EQ(std::ranges::count(decoded->parts, MeshPart::cave),
              std::ranges::count(tile.mesh.parts, MeshPart::cave));
    // Farther out seldom anybody stands beside level 0, and the layers of format 1 have no such
    // tubes.
    tile = make_tile(*world, {.lod = 2, .x = -7, .z = 4}, true);
    EXPECT_EQ(hanging_at(tile.mesh, 0, 0).area.count(MeshPart::cave), 0U);
    tile = make_tile(*load_test_world("paper-B3-seed42"), {.lod = 1, .x = 0, .z = 0}, true);
    EXPECT_TRUE(tile.mesh.parts.empty());
}

TEST(HeightField, EncodesAndDecodesAtEveryLevel) {
    const auto world = load_test_world("paper-B3-seed42");
    const auto tallest = static_cast<std::int32_t>(world->stack.height_bound) + 2;
    for (std::int32_t lod = 1; lod <= kLodMax; ++lod) {
        const Tile tile = make_tile(*world, {.lod = lod, .x = 1, .z = -1}, true);
        const auto bytes =
            encode_draco(tile.mesh, {.side = tile.stack.side, .height_voxels = tallest + 1});
        ASSERT_TRUE(bytes) << bytes.error().message;
        const auto decoded = decode_draco(*bytes);
        ASSERT_TRUE(decoded);
        EXPECT_EQ(decoded->triangle_count(), tile.mesh.triangle_count());
    }
}

}  // namespace
}  // namespace terrane
