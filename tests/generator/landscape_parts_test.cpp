// A landscape's mesh in its parts: ground, caves, and the water's own surface.
#include "generator/mesh/blocky.h"
#include "generator/mesh/draco_codec.h"
#include "generator/mesh/glb.h"
#include "generator/mesh/height_field.h"
#include "generator/mesh/surface_nets.h"
#include "generator/terrain/generate_stack.h"
#include "generator/volume/water.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

namespace terrane {
namespace {

using Counts = std::map<MeshPart, std::size_t>;

Counts triangles_by_part(const Mesh& mesh) {
    Counts counts;
    for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
        ++counts[mesh.part_of_triangle(i)];
    }
    return counts;
}

/// Heights in 1/256 voxel at which a column's water meets air.
std::vector<std::int32_t> surfaces_of(std::span<const Limit> limits, const Palette& palette,
                                      std::span<const Material> materials) {
    std::vector<std::int32_t> found;
    bool was_wet = false;
    for (std::size_t i = 0; i < limits.size(); ++i) {
        const bool is_last = i + 1 == limits.size();
        if (!is_last && limits[i + 1].y256 == limits[i].y256) {
            continue;
        }
        const PaletteEntry& entry = palette[limits[i].palette_id];
        const bool is_wet = !is_last && is_water(entry, materials);
        if (was_wet && !is_wet && (is_last || !entry.is_solid())) {
            found.push_back(limits[i].y256);
        }
        was_wet = is_wet;
    }
    return found;
}

/// Voxels of solid above a height.
double rock_over(std::span<const Limit> limits, const Palette& palette, std::int32_t y256) {
    std::int64_t sum = 0;
    for (std::size_t i = 0; i + 1 < limits.size(); ++i) {
        if (palette[limits[i].palette_id].is_solid()) {
            sum += std::max(0, limits[i + 1].y256 - std::max(y256, limits[i].y256));
        }
    }
    return static_cast<double>(sum) / kUnitsPerVoxel;
}

class LandscapeParts : public testing::TestWithParam<const char*> {
  protected:
    void SetUp() override {
        world_ = load_shipped_world(GetParam());
        ASSERT_NE(world_, nullptr);
        whole_ = {.first = 0, .last = static_cast<std::int64_t>(world_->stack.height_bound) + 1};
    }

    template <typename Visit>
    void for_each_stack(Visit visit) {
        StackGenerator generator(*world_);
        Stack stack;
        for (std::int32_t z = 0; z < 6; ++z) {
            for (std::int32_t x = -3; x < 3; ++x) {
                ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = x, .z = z}));
                visit(stack);
            }
        }
    }

    std::shared_ptr<const World> world_;
    HeightRange whole_;
};

TEST_P(LandscapeParts, EveryWetColumnHasASquareOfWaterAtItsLevel) {
    SurfaceNetsMesher mesher(world_->definition);
    BlockyMesher blocky_mesher(world_->definition);
    const std::int32_t height = world_->definition.grid.height;
    const std::vector<Material>& materials = world_->definition.materials;
    Mesh mesh;
    std::size_t surfaces = 0;
    for_each_stack([&](const Stack& stack) {
        mesher.mesh(mesh, stack, whole_);
        std::map<std::array<std::int32_t, 2>, std::vector<std::int32_t>> squares;
        for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
            if (mesh.part_of_triangle(i / 3) != MeshPart::water) {
                continue;
            }
            std::int32_t least_x = INT32_MAX;
            std::int32_t least_z = INT32_MAX;
            std::int32_t mean256 = 0;
            for (std::size_t corner = 0; corner < 3; ++corner) {
                const std::uint32_t v = mesh.indices[i + corner];
                ASSERT_EQ(mesh.parts[v], MeshPart::water);
                ASSERT_EQ(materials[mesh.material_ids[v]].kind, MaterialKind::water);
                least_x = std::min(least_x, mesh.positions256[v].x);
                least_z = std::min(least_z, mesh.positions256[v].z);
                mean256 += mesh.positions256[v].y / 3;
            }
            if (mesh.normals[mesh.indices[i]].y == 1) {
                squares[{least_x / 256, least_z / 256}].push_back(mean256);
            }
        }
        for (std::int32_t z = 0; z < stack.side; ++z) {
            for (std::int32_t x = 0; x < stack.side; ++x) {
                const auto levels =
                    surfaces_of(stack.columns.column(x, z), stack.palette, materials);
                surfaces += levels.size();
                ASSERT_EQ(squares[(std::array{x, z})].size(), 2 * levels.size());
                for (const std::int32_t level : levels) {
                    const auto is_near = [&](std::int32_t y256) {
                        return std::abs(y256 - level) < 192;
                    };
                    EXPECT_EQ(std::ranges::count_if(squares[(std::array{x, z})], is_near), 2);
                }
            }
        }
        // Chunk by chunk it is as much, in both styles.
        const std::size_t wanted = triangles_by_part(mesh)[MeshPart::water];
        std::size_t smooth = 0;
        std::size_t blocky = 0;
        for (std::int32_t y = 0; std::int64_t{y} * height < whole_.last; ++y) {
            mesher.mesh(mesh, stack, y, height);
            smooth += triangles_by_part(mesh)[MeshPart::water];
            for (const glm::i32vec3& p : mesh.positions256) {
                ASSERT_TRUE(p.y >= -256 && p.y <= height * 256);
            }
            blocky_mesher.mesh(mesh, stack, y, height);
            blocky += triangles_by_part(mesh)[MeshPart::water];
        }
        EXPECT_EQ(smooth, wanted);
        EXPECT_EQ(blocky, wanted);
    });
    EXPECT_GT(surfaces, 300U);
}

TEST_P(LandscapeParts, WaterOfNeighbouringStacksMeetsInTheSamePoints) {
    SurfaceNetsMesher mesher(world_->definition);
    StackGenerator generator(*world_);
    std::size_t shared = 0;
    const std::int32_t side256 = world_->definition.grid.side * 256;
    for (std::int32_t z = -6; z < 6; ++z) {
        for (std::int32_t x = -6; x < 6; ++x) {
            std::array<std::set<std::array<std::int32_t, 2>>, 2> points;
            for (std::int32_t i = 0; i < 2; ++i) {
                Stack stack;
                Mesh mesh;
                ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = x + i, .z = z}));
                mesher.mesh(mesh, stack, whole_);
                for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
                    const glm::i32vec3& p = mesh.positions256[v];
                    if (mesh.part(v) == MeshPart::water && mesh.normals[v].y == 1 &&
                        p.x == (i == 0 ? side256 : 0)) {
                        points[static_cast<std::size_t>(i)].insert({p.y, p.z});
                    }
                }
            }
            // Where the shore runs across the side, one of the two has no square at a point.
            for (const auto& [y, row] : points[0]) {
                const bool is_there = points[1].contains({y, row});
                shared += is_there ? 1 : 0;
                for (const auto& [other_y, other_row] : points[1]) {
                    EXPECT_TRUE(is_there || other_row != row || std::abs(other_y - y) > 128);
                }
            }
        }
    }
    EXPECT_GT(shared, 20U);
}

TEST_P(LandscapeParts, CavesLieUnderRock) {
    SurfaceNetsMesher mesher(world_->definition);
    Mesh mesh;
    Counts counts;
    for_each_stack([&](const Stack& stack) {
        mesher.mesh(mesh, stack, whole_);
        for (const auto& [part, count] : triangles_by_part(mesh)) {
            counts[part] += count;
        }
        for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
            if (mesh.part(v) != MeshPart::cave) {
                continue;
            }
            const glm::i32vec3& p = mesh.positions256[v];
            // All four columns of the vertex's cell; on a side it is not known which cell it was.
            for (std::int32_t i = 0; i < 4; ++i) {
                const std::int32_t x = (p.x - 128 + 256) / 256 - 1 + i % 2;
                const std::int32_t z = (p.z - 128 + 256) / 256 - 1 + i / 2;
                EXPECT_GE(rock_over(stack.columns.column(x, z), stack.palette, p.y),
                          kCaveRoofVoxels);
            }
        }
    });
    EXPECT_GT(counts[MeshPart::ground], 50000U);
    EXPECT_GT(counts[MeshPart::cave], 1000U);
}

TEST_P(LandscapeParts, GoThroughDracoAndAreAGlbsPrimitives) {
    SurfaceNetsMesher mesher(world_->definition);
    const DracoSettings settings{.side = world_->definition.grid.side,
                                 .height_voxels = static_cast<std::int32_t>(whole_.last) + 1};
    Mesh mesh;
    std::set<std::string> seen;
    for_each_stack([&](const Stack& stack) {
        mesher.mesh(mesh, stack, whole_);
        const auto bytes = encode_draco(mesh, settings);
        ASSERT_TRUE(bytes) << bytes.error().message;
        const auto decoded = decode_draco(*bytes);
        ASSERT_TRUE(decoded) << decoded.error().message;
        EXPECT_EQ(triangles_by_part(*decoded), triangles_by_part(mesh));
        for (std::size_t v = 0; v < decoded->vertex_count(); ++v) {
            const bool is_water =
                world_->definition.materials[decoded->material_ids[v]].kind == MaterialKind::water;
            ASSERT_EQ(is_water, decoded->part(v) == MeshPart::water);
        }
        add_side_skirts(mesh, stack.side);
        const Counts counts = triangles_by_part(mesh);
        const auto glb = encode_glb(mesh, settings, {.corner_m = {}, .unit_m = {1, 1, 1}});
        ASSERT_TRUE(glb) << glb.error().message;
        ByteReader in(*glb);
        ASSERT_TRUE(in.take(12));
        const std::size_t json_bytes = *in.fixed<std::uint32_t>();
        ASSERT_TRUE(in.take(4));
        const auto json = nlohmann::json::parse(text_of(*in.take(json_bytes)));
        ASSERT_TRUE(in.take(8));
        const std::string binary(text_of(*in.take(in.remaining())));
        const auto& primitives = json["meshes"][0]["primitives"];
        ASSERT_EQ(primitives.size(), counts.size());
        for (const auto& primitive : primitives) {
            const std::string part =
                counts.size() == 1 ? "ground" : primitive["extras"]["part"].get<std::string>();
            seen.insert(part);
            const std::size_t material = primitive["material"];
            EXPECT_EQ(json["materials"][material].value("alphaMode", "OPAQUE") == "BLEND",
                      part == "water");
            const std::size_t view =
                primitive["extensions"]["KHR_draco_mesh_compression"]["bufferView"];
            const std::size_t offset =
                json["bufferViews"][view].value("byteOffset", std::size_t{0});
            EXPECT_EQ(binary.substr(offset, 5), "DRACO");
        }
    });
    EXPECT_EQ(seen, (std::set<std::string>{"ground", "caves", "water"}));
}

INSTANTIATE_TEST_SUITE_P(Worlds, LandscapeParts, testing::Values("canyon", "karst", "coast"),
                         [](const auto& world) { return std::string(world.param); });

TEST(LandscapePartsFromAfar, TheSeaHasItsLevelAtCoarseLevels) {
    const auto world = load_shipped_world("coast");
    ASSERT_NE(world, nullptr);
    const double sea = world->definition.relief.sea_level.value_or(0);
    ASSERT_GT(sea, 0);
    StackGenerator generator(*world);
    HeightFieldMesher mesher(world->definition);
    for (const std::int32_t lod : {1, 3, 6, 9}) {
        std::size_t at_sea = 0;
        std::size_t water = 0;
        for (std::int32_t x = -6; x < 6; ++x) {
            Stack stack;
            Mesh mesh;
            ASSERT_TRUE(generator.generate(stack, {.lod = lod, .x = x, .z = 1}));
            mesher.mesh(mesh, stack, true);
            for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
                const bool is_water = mesh.part(v) == MeshPart::water;
                water += is_water ? 1 : 0;
                at_sea +=
                    is_water && mesh.positions256[v].y == static_cast<int>(sea * 256) ? 1U : 0U;
            }
        }
        EXPECT_GT(at_sea, 100U) << lod;
        EXPECT_GE(water, at_sea);
    }
}

TEST(LandscapePartsOfFormat1, AreOneGround) {
    const auto world = load_shipped_world("basin");
    ASSERT_NE(world, nullptr);
    StackGenerator generator(*world);
    Stack stack;
    Mesh mesh;
    ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = 0, .z = 0}));
    SurfaceNetsMesher(world->definition).mesh(mesh, stack, HeightRange{.first = 0, .last = 256});
    EXPECT_GT(mesh.triangle_count(), 0U);
    EXPECT_TRUE(mesh.parts.empty());
}

}  // namespace
}  // namespace terrane
