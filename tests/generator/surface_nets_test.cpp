#include "generator/mesh/surface_nets.h"

#include "generator/mesh/kernels/mesh_kernels.h"
#include "generator/mesh/shade.h"
#include "generator/terrain/kernels/kernel_choice.h"
#include "generator/volume/color.h"
#include "tests/support/ascii_cut.h"
#include "tests/support/drawn_worlds.h"
#include "tests/support/mesh_audit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace terrane {
namespace {

using World = std::vector<Limit> (*)(const Letters&, std::uint64_t, ColumnPos);

constexpr std::string_view kLetters = "abc.o";

Mesh mesh_of(const Letters& letters, const Stack& stack, HeightRange heights) {
    SurfaceNetsMesher mesher(letters.definition());
    Mesh mesh;
    mesher.mesh(mesh, stack, heights);
    return mesh;
}

glm::dvec3 voxels(const Mesh& mesh, std::size_t corner) {
    return glm::dvec3(mesh.positions256[mesh.indices[corner]]) / 256.0;
}

/// Six times the volume that a closed mesh encloses, negative if it is inside out.
double six_volumes(const Mesh& mesh) {
    double sum = 0;
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
        const glm::dvec3 a = voxels(mesh, i);
        const glm::dvec3 b = voxels(mesh, i + 1);
        const glm::dvec3 c = voxels(mesh, i + 2);
        sum += a.x * (b.y * c.z - b.z * c.y) + a.y * (b.z * c.x - b.x * c.z) +
               a.z * (b.x * c.y - b.y * c.x);
    }
    return sum;
}

TEST(SurfaceNets, FlatGroundIsAFlatSquareThatLooksUp) {
    const Letters letters("ab.");
    const Stack stack = stack_of_cut(letters, {"......", "bbbbbb", "aaaaaa", "aaaaaa"});
    const Mesh mesh = mesh_of(letters, stack, {.first = 0, .last = 4});
    EXPECT_EQ(mesh.vertex_count(), 25U);
    EXPECT_EQ(mesh.triangle_count(), 32U);
    for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
        EXPECT_EQ(mesh.positions256[i].y, 3 * 256);
        EXPECT_EQ(mesh.normals[i], glm::vec3(0, 1, 0));
        EXPECT_EQ(mesh.material_ids[i], 1);
    }
    double area = 0;
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
        const glm::dvec3 p = voxels(mesh, i + 1) - voxels(mesh, i);
        const glm::dvec3 q = voxels(mesh, i + 2) - voxels(mesh, i);
        const double up = p.z * q.x - p.x * q.z;
        EXPECT_GT(up, 0);
        area += up / 2;
    }
    EXPECT_EQ(area, 16.0);
}

TEST(SurfaceNets, HeightsBetweenVoxelsAreKept) {
    const Letters letters("a.");
    const Stack stack = stack_of_columns({}, 4, letters.palette(), [&](ColumnPos) {
        return std::vector<Limit>{
            {0, letters.id('a'), {}}, {700, letters.id('a'), {}}, {700, letters.id('.'), {}}};
    });
    for (const glm::i32vec3& position :
         mesh_of(letters, stack, {.first = 0, .last = 4}).positions256) {
        EXPECT_EQ(position.y, 700);
    }
    // The same ground from the chunk over y = 2, whose floor is 2 voxels up.
    for (const glm::i32vec3& position :
         mesh_of(letters, stack, {.first = 2, .last = 4}).positions256) {
        EXPECT_EQ(position.y, 700 - 512);
    }
}

TEST(SurfaceNets, ChunksWithoutSurfaceAreEmpty) {
    const Letters letters("ab.");
    const Stack stack = stack_of_cut(letters, {"bbbbbb", "aaaaaa", "aaaaaa"});
    SurfaceNetsMesher mesher(letters.definition());
    Mesh mesh;
    for (const std::int32_t y : {INT32_MIN, -1, 1, 2, INT32_MAX}) {
        mesher.mesh(mesh, stack, 0, 4);
        EXPECT_EQ(mesh.triangle_count(), 32U);
        mesher.mesh(mesh, stack, y, 4);
        EXPECT_EQ(mesh.vertex_count(), 0U) << y;
        EXPECT_EQ(mesh.triangle_count(), 0U) << y;
    }
}

TEST(SurfaceNets, AWallNextDoorIsMadeThoughAllOwnColumnsAreLower) {
    const Letters letters("a.");
    const Stack stack = stack_of_cut(letters, {".....a", ".....a", ".....a", ".....a", "aaaaaa"});
    const Mesh mesh = mesh_of(letters, stack, {.first = 2, .last = 4});
    EXPECT_GT(mesh.triangle_count(), 0U);
    for (const glm::i32vec3& position : mesh.positions256) {
        EXPECT_EQ(position.x, 4 * 256);
    }
}

TEST(SurfaceNets, ACaveIsAClosedHollow) {
    const Letters letters("a.o");
    const Stack stack = stack_of_columns({}, 8, letters.palette(), [&](ColumnPos at) {
        const bool hollow = at.x >= 2 && at.x < 6 && at.z >= 2 && at.z < 6;
        return letters.column(hollow ? "aaaooooaaa" : "aaaaaaaaaa");
    });
    const Mesh mesh = mesh_of(letters, stack, {.first = 0, .last = 9});  // the top is at 10
    ASSERT_GT(mesh.triangle_count(), 0U);
    MeshAudit audit(8, 9);
    audit.add(mesh, {});
    EXPECT_EQ(audit.open_interior_edges, 0);
    EXPECT_EQ(audit.open_edges_inside(), 0);
    const auto edges = static_cast<std::size_t>(audit.interior_edges);
    EXPECT_EQ(mesh.vertex_count() + mesh.triangle_count() - edges, 2U) << "Euler";
    // 4 x 4 x 4 voxels are hollow, with corners cut; the mesh faces inwards, out of the solid.
    EXPECT_NEAR(six_volumes(mesh) / 6, -48, 12);
    for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
        const glm::vec3 to_middle = glm::vec3(4, 5, 4) - glm::vec3(mesh.positions256[i]) / 256.0F;
        const glm::vec3& n = mesh.normals[i];
        EXPECT_GE(n.x * to_middle.x + n.y * to_middle.y + n.z * to_middle.z, 0) << i;
        EXPECT_NEAR(n.x * n.x + n.y * n.y + n.z * n.z, 1, 1e-5);
    }
}

TEST(SurfaceNets, AnOverhangHasACeiling) {
    const Letters letters("ab.o");
    const Stack stack = stack_of_cut(letters, {
                                                  "..........",
                                                  "bbbbbb....",
                                                  "bbbbbb....",
                                                  "bbboooo...",
                                                  "bbboooo...",
                                                  "aaaaaaaaaa",
                                              });
    const Mesh mesh = mesh_of(letters, stack, {.first = 0, .last = 6});
    MeshAudit audit(8, 6);
    audit.add(mesh, {});
    EXPECT_EQ(audit.open_interior_edges, 0);
    int ceilings = 0;
    for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
        if (mesh.normals[i].y < -0.9F) {
            ++ceilings;
            EXPECT_EQ(mesh.positions256[i].y, 3 * 256);
            EXPECT_EQ(mesh.material_ids[i], letters.id('b'));
        }
    }
    EXPECT_GT(ceilings, 8);
}

TEST(SurfaceNets, ColorsAreLinearAndMixWithTheComposition) {
    EXPECT_EQ(linear_from_srgb({.r = 0, .g = 255, .b = 10}).g, 1.0F);
    EXPECT_NEAR(linear_from_srgb({.r = 188, .g = 0, .b = 10}).r, 0.502886F, 1e-6F);
    EXPECT_NEAR(linear_from_srgb({.r = 188, .g = 0, .b = 10}).b, 10 / 255.0 / 12.92, 1e-7);

    const Letters letters("ab.");
    std::vector<PaletteShade> shades;
    const auto colors = linear_colors_of(letters.definition());
    find_palette_shades(shades, letters.palette(), colors);
    const std::vector<Limit> column = {
        {0, 0, {}}, {256, 0, {}}, {768, 1, {}}, {1024, 1, {}}, {1024, 2, {}}};
    const auto at = [&](std::int32_t y256) {
        return shade_at(column, y256, letters.palette(), shades);
    };
    EXPECT_EQ(at(-500), shades[0].shade);
    EXPECT_EQ(at(256), shades[0].shade);
    EXPECT_EQ(at(1024), shades[1].shade);
    EXPECT_EQ(at(1025), shades[2].shade);
    EXPECT_EQ(at(511).material, 0);
    EXPECT_EQ(at(513).material, 1);
    EXPECT_NEAR(at(512).g, (shades[0].color.g + shades[1].color.g) / 2 * 255, 0.5);
}

TEST(SurfaceNets, AWallShowsItsStrataButASlopeOnlyItsTop) {
    const Letters letters("abc.");
    const Stack wall = stack_of_columns({}, 4, letters.palette(), [&](ColumnPos at) {
        return letters.column(at.x < 2 ? "aaaaaabbbbbbbbbc" : "a");
    });
    const Mesh wall_mesh = mesh_of(letters, wall, {.first = 0, .last = 20});
    int in_a = 0;
    int in_b = 0;
    for (std::size_t i = 0; i < wall_mesh.vertex_count(); ++i) {
        const std::int32_t y = wall_mesh.positions256[i].y / 256;
        if (y >= 2 && y < 11) {
            EXPECT_EQ(wall_mesh.material_ids[i], letters.id(y < 6 ? 'a' : 'b')) << y;
            ++(y < 6 ? in_a : in_b);
        }
    }
    EXPECT_GT(in_a, 15);
    EXPECT_GT(in_b, 15);

    const Stack slope = stack_of_columns({}, 8, letters.palette(), [&](ColumnPos at) {
        const auto top = static_cast<std::int32_t>(300 + 800 * (at.x + 1));  // 72 degrees
        return std::vector<Limit>{{0, letters.id('a'), {}},
                                  {top - 30, letters.id('a'), {}},
                                  {top - 30, letters.id('c'), {}},
                                  {top, letters.id('c'), {}},
                                  {top, letters.id('.'), {}}};
    });
    const Mesh slope_mesh = mesh_of(letters, slope, {.first = 0, .last = 40});
    EXPECT_GT(slope_mesh.vertex_count(), 200U);
    for (const std::uint8_t material : slope_mesh.material_ids) {
        EXPECT_EQ(material, letters.id('c'));
    }
}

// The rule of the method, written out with no bits: the vertex of every cell that a mesh has.
struct Crossings {
    std::int32_t x = 0, y = 0, z = 0, count = 0;

    void add(std::int32_t dx, std::int32_t dy, std::int32_t dz) {
        x += dx;
        y += dy;
        z += dz;
        ++count;
    }

    std::int32_t mean(std::int32_t sum) const { return std::min((sum + count / 2) / count, 255); }
};

struct Point {
    std::int32_t distance;
    bool is_solid;
};

Point point_at(const Stack& stack, std::int32_t x, std::int32_t z, std::int32_t y256) {
    const auto limits = stack.columns.column(x, z);
    std::int32_t nearest = 1024;
    bool solid_below = true;
    bool is_solid = y256 <= 0;
    for (std::size_t i = 0; i + 1 <= limits.size(); ++i) {
        const bool solid_above =
            i + 1 < limits.size() && stack.palette[limits[i].palette_id].is_solid();
        if (i + 1 < limits.size() && limits[i].y256 == limits[i + 1].y256) {
            continue;  // no span between them
        }
        if (solid_above != solid_below) {
            nearest = std::min(nearest, std::abs(y256 - limits[i].y256));
        }
        if (i + 1 < limits.size() && limits[i].y256 < y256 && y256 <= limits[i + 1].y256) {
            is_solid = solid_above;
        }
        solid_below = solid_above;
    }
    return {.distance = is_solid ? nearest : -nearest, .is_solid = is_solid};
}

glm::i32vec3 expected_vertex(const Stack& stack, glm::i32vec3 cell) {
    Crossings crossings;
    const auto at = [&](int x, int y, int z) {
        return point_at(stack, cell.x + x, cell.z + z, (cell.y + y) * 256);
    };
    for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < 2; ++j) {
            const Point low = at(i, 0, j);
            if (low.is_solid != at(i, 1, j).is_solid) {
                std::int32_t dy = 0;  // the lowest end that changes to the other kind
                while (at(i, 0, j).is_solid ==
                       point_at(stack, cell.x + i, cell.z + j, cell.y * 256 + dy + 1).is_solid) {
                    ++dy;
                }
                crossings.add(256 * i, dy, 256 * j);
            }
            const auto level = [&](Point from, Point to, auto add) {
                if (from.is_solid != to.is_solid) {
                    const double length = from.distance - to.distance;
                    add(length == 0
                            ? 128
                            : static_cast<int>(std::floor(256 * from.distance / length + 0.5)));
                }
            };
            level(at(0, i, j), at(1, i, j), [&](int t) { crossings.add(t, 256 * i, 256 * j); });
            level(at(i, j, 0), at(i, j, 1), [&](int t) { crossings.add(256 * i, 256 * j, t); });
        }
    }
    EXPECT_GT(crossings.count, 0);
    return {crossings.mean(crossings.x), crossings.mean(crossings.y), crossings.mean(crossings.z)};
}

class SurfaceNetsOf : public testing::TestWithParam<World> {
  protected:
    Stack stack(StackPos position, std::int32_t side, std::uint64_t seed) const {
        return stack_of_columns(position, side, letters_.palette(),
                                [&](ColumnPos at) { return GetParam()(letters_, seed, at); });
    }

    Letters letters_{kLetters};
};

TEST_P(SurfaceNetsOf, EveryVertexIsTheMeanOfItsCrossings) {
    std::int64_t checked = 0;
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
        const Stack drawn = stack({.lod = 0, .x = -3, .z = 2}, 12, seed);
        const Mesh mesh = mesh_of(letters_, drawn, {.first = 0, .last = 1000});
        for (const glm::i32vec3& position : mesh.positions256) {
            const glm::i32vec3 cell = {floor_div(position.x - 128, 256), floor_div(position.y, 256),
                                       floor_div(position.z - 128, 256)};
            const glm::i32vec3 offset = expected_vertex(drawn, cell);
            ++checked;
            EXPECT_EQ(position.y, cell.y * 256 + offset.y);
            EXPECT_EQ(position.x, cell.x == -1   ? 0
                                  : cell.x == 11 ? 12 * 256
                                                 : cell.x * 256 + 128 + offset.x);
            EXPECT_EQ(position.z, cell.z == -1   ? 0
                                  : cell.z == 11 ? 12 * 256
                                                 : cell.z * 256 + 128 + offset.z);
        }
    }
    EXPECT_GT(checked, 400);
}

TEST_P(SurfaceNetsOf, NeighboursMeetWithoutCracksSidewaysAndUpwards) {
    for (const std::int32_t height : {4, 7, 64}) {
        constexpr std::int32_t kSide = 8;
        MeshAudit audit(kSide, height);
        SurfaceNetsMesher mesher(letters_.definition());
        Mesh mesh;
        for (std::int32_t z = -2; z <= 1; ++z) {
            for (std::int32_t x = -2; x <= 1; ++x) {
                const Stack drawn = stack({.lod = 0, .x = x, .z = z}, kSide, 11);
                for (std::int32_t y = -1; y * height < 930; ++y) {
                    mesher.mesh(mesh, drawn, y, height);
                    audit.add(mesh, {.lod = 0, .x = x, .y = y, .z = z});
                }
            }
        }
        EXPECT_GT(audit.interior_edges, 2500) << height;
        EXPECT_EQ(audit.open_interior_edges, 0) << height;
        EXPECT_EQ(audit.open_edges_inside(), 0) << height;
        EXPECT_GT(audit.shared_vertices, 300) << height;
        EXPECT_EQ(audit.different_vertices, 0) << height;
    }
}

TEST_P(SurfaceNetsOf, AllHeightsAtOnceAreTheChunksTogether) {
    using Triangle = std::array<std::array<std::int32_t, 3>, 3>;
    const auto triangles_of = [](const Mesh& mesh, std::int32_t y256) {
        std::multiset<Triangle> triangles;
        for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
            Triangle triangle;
            for (std::size_t corner = 0; corner < 3; ++corner) {
                const glm::i32vec3& p = mesh.positions256[mesh.indices[i + corner]];
                triangle[corner] = {p.x, p.y + y256, p.z};
            }
            triangles.insert(triangle);
        }
        return triangles;
    };
    const Stack drawn = stack({}, 9, 4);
    const auto whole =
        triangles_of(mesh_of(letters_, drawn, {.first = -7, .last = 1000}), -7 * 256);
    std::multiset<Triangle> parts;
    for (std::int32_t y = 0; y < 1000; y += 10) {
        parts.merge(triangles_of(mesh_of(letters_, drawn, {.first = y, .last = y + 10}), y * 256));
    }
    EXPECT_GT(whole.size(), 100U);
    EXPECT_EQ(whole, parts);
}

TEST_P(SurfaceNetsOf, EveryVertexIsUsedAndWhatTheMesherDidBeforeDoesNotMatter) {
    SurfaceNetsMesher mesher(letters_.definition());
    Mesh mesh;
    mesher.mesh(mesh, stack({.lod = 0, .x = 9, .z = 9}, 16, 1), {.first = 0, .last = 1000});
    const Stack drawn = stack({.lod = 0, .x = 5, .z = 0}, 8, 2);
    mesher.mesh(mesh, drawn, {.first = 3, .last = 60});
    const Mesh fresh = mesh_of(letters_, drawn, {.first = 3, .last = 60});
    EXPECT_EQ(mesh.positions256, fresh.positions256);
    EXPECT_EQ(mesh.normals, fresh.normals);
    EXPECT_EQ(mesh.colors, fresh.colors);
    EXPECT_EQ(mesh.material_ids, fresh.material_ids);
    EXPECT_EQ(mesh.indices, fresh.indices);
    ASSERT_GT(mesh.vertex_count(), 0U);
    const std::set<std::uint32_t> used(mesh.indices.begin(), mesh.indices.end());
    EXPECT_EQ(used.size(), mesh.vertex_count());
    EXPECT_EQ(*used.rbegin(), mesh.vertex_count() - 1);
}

TEST_P(SurfaceNetsOf, EveryInstructionSetMakesTheSameMesh) {
    const Stack drawn = stack({.lod = 0, .x = 2, .z = -3}, 21, 2);
    const HeightRange heights = {.first = -3, .last = 1000};
    const Mesh chosen = mesh_of(letters_, drawn, heights);
    ASSERT_GT(chosen.vertex_count(), std::size_t{4} * kCellBatch);
    for (const KernelSet& set : available_kernel_sets()) {
        SurfaceNetsMesher mesher(letters_.definition(), *set.kernels->mesh);
        Mesh mesh;
        mesher.mesh(mesh, drawn, heights);
        EXPECT_EQ(mesh.positions256, chosen.positions256) << set.name;
        EXPECT_EQ(mesh.normals, chosen.normals) << set.name;
        EXPECT_EQ(mesh.colors, chosen.colors) << set.name;
        EXPECT_EQ(mesh.material_ids, chosen.material_ids) << set.name;
        EXPECT_EQ(mesh.indices, chosen.indices) << set.name;
    }
}

INSTANTIATE_TEST_SUITE_P(Worlds, SurfaceNetsOf, testing::Values(&hills, &caves, &rubble, &depths),
                         [](const auto& world) {
                             return world.param == &hills    ? "Hills"
                                    : world.param == &caves  ? "Caves"
                                    : world.param == &rubble ? "Rubble"
                                                             : "Depths";
                         });

}  // namespace
}  // namespace terrane
