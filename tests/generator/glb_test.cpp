#include "generator/mesh/glb.h"

#include "generator/mesh/height_field.h"
#include "generator/mesh/surface_nets.h"
#include "generator/terrain/generate_stack.h"
#include "tests/support/test_world.h"

#include <draco/compression/decode.h>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstring>
#include <map>
#include <set>
#include <tuple>

namespace terrane {
namespace {

using Json = nlohmann::json;

/// A file taken apart as a viewer would.
struct ReadGlb {
    Json json;
    std::unique_ptr<draco::Mesh> mesh;  ///< null without a BIN chunk
};

ReadGlb read_glb(const Bytes& bytes) {
    ByteReader in(bytes);
    EXPECT_EQ(text_of(*in.take(4)), "glTF");
    EXPECT_EQ(in.fixed<std::uint32_t>(), 2U);
    EXPECT_EQ(in.fixed<std::uint32_t>(), bytes.size());
    ReadGlb out;
    const auto json_bytes = in.fixed<std::uint32_t>();
    EXPECT_EQ(*json_bytes % 4, 0U);
    EXPECT_EQ(text_of(*in.take(4)), "JSON");
    out.json = Json::parse(text_of(*in.take(*json_bytes)));
    if (in.remaining() == 0) {
        return out;
    }
    const auto binary_bytes = in.fixed<std::uint32_t>();
    EXPECT_EQ(text_of(*in.take(4)), std::string_view("BIN\0", 4));
    EXPECT_EQ(in.remaining(), *binary_bytes);
    EXPECT_EQ(*binary_bytes % 4, 0U);
    const std::size_t draco_bytes = out.json["bufferViews"][0]["byteLength"];
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(in.take(draco_bytes)->data()), draco_bytes);
    draco::Decoder decoder;
    auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
    EXPECT_TRUE(decoded.ok());
    out.mesh = std::move(decoded).value();
    return out;
}

const draco::PointAttribute* attribute(const ReadGlb& glb, const char* name) {
    const auto& ids = glb.json["meshes"][0]["primitives"][0]["extensions"]
                              ["KHR_draco_mesh_compression"]["attributes"];
    return glb.mesh->GetAttributeByUniqueId(ids[name].get<std::uint32_t>());
}

std::array<float, 3> position_of(const ReadGlb& glb, std::uint32_t point) {
    std::array<float, 3> position{};
    const auto* positions = attribute(glb, "POSITION");
    positions->GetMappedValue(draco::PointIndex(point), position.data());
    return position;
}

Vector3 world_position(const ReadGlb& glb, std::uint32_t point) {
    const auto local = position_of(glb, point);
    const Json& node = glb.json["nodes"][0];
    Vector3 at{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        at[axis] = node["translation"][axis].get<double>() +
                   node["scale"][axis].get<double>() * static_cast<double>(local[axis]);
    }
    return at;
}

class GlbOfWorld : public testing::Test {
  protected:
    void SetUp() override {
        world_ = load_test_world("dense-seed43");
        ASSERT_NE(world_, nullptr);
    }

    DracoSettings settings() const {
        return {.side = side(),
                .height_voxels = static_cast<std::int32_t>(world_->stack.height_bound) + 2};
    }

    std::int32_t side() const { return world_->definition.grid.side; }

    Stack stack_at(StackPos position) const {
        StackGenerator generator(*world_);
        Stack stack;
        EXPECT_TRUE(generator.generate(stack, position));
        return stack;
    }

    Mesh mesh_at(StackPos position) const {
        Mesh mesh;
        if (position.lod > 0) {
            HeightFieldMesher(world_->definition).mesh(mesh, stack_at(position), true);
        } else {
            SurfaceNetsMesher(world_->definition)
                .mesh(mesh, stack_at(position), {0, settings().height_voxels - 1});
            add_side_skirts(mesh, side());
        }
        return mesh;
    }

    ReadGlb glb_at(StackPos position) const {
        const auto bytes =
            encode_glb(mesh_at(position), settings(),
                       glb_place_of(first_column_of(position, side()), 0, position.lod,
                                    world_->definition.grid.voxel_size_m));
        EXPECT_TRUE(bytes);
        return read_glb(*bytes);
    }

    std::shared_ptr<const World> world_;
};

TEST_F(GlbOfWorld, SaysWhatTheDracoMeshHolds) {
    for (const std::int32_t lod : {0, 1, 7, 17}) {
        const ReadGlb glb = glb_at({.lod = lod, .x = -1, .z = 0});
        const Json& json = glb.json;
        EXPECT_EQ(json["extensionsRequired"], Json({"KHR_draco_mesh_compression"}));
        EXPECT_EQ(json["extensionsUsed"], Json({"KHR_draco_mesh_compression"}));
        const Json& accessors = json["accessors"];
        EXPECT_EQ(accessors[0]["count"], glb.mesh->num_points());
        EXPECT_EQ(accessors[1]["count"], glb.mesh->num_points());
        EXPECT_EQ(accessors[2]["count"], glb.mesh->num_points());
        EXPECT_EQ(accessors[3]["count"], 3 * glb.mesh->num_faces());
        EXPECT_EQ(attribute(glb, "NORMAL")->attribute_type(), draco::GeometryAttribute::NORMAL);
        const auto* color = attribute(glb, "COLOR_0");
        EXPECT_EQ(color->num_components(), 4);
        EXPECT_EQ(color->data_type(), draco::DT_UINT8);
        EXPECT_TRUE(color->normalized());
        std::array<float, 3> least = position_of(glb, 0);
        std::array<float, 3> most = least;
        for (std::uint32_t i = 0; i < glb.mesh->num_points(); ++i) {
            const auto at = position_of(glb, i);
            for (std::size_t axis = 0; axis < 3; ++axis) {
                least[axis] = std::min(least[axis], at[axis]);
                most[axis] = std::max(most[axis], at[axis]);
            }
        }
        EXPECT_EQ(accessors[0]["min"].get<decltype(least)>(), least) << lod;
        EXPECT_EQ(accessors[0]["max"].get<decltype(most)>(), most) << lod;
    }
}

TEST_F(GlbOfWorld, HasEveryTriangleOfTheMeshWhereItIsInTheWorld) {
    for (const std::int32_t lod : {0, 3}) {
        const StackPos at{.lod = lod, .x = 2, .z = -3};
        const Mesh mesh = mesh_at(at);
        const ReadGlb glb = glb_at(at);
        const double column_m = static_cast<double>(1 << lod);
        std::set<Vector3> wanted;
        for (const std::uint32_t i : mesh.indices) {
            const glm::i32vec3 p = mesh.positions256[i];
            wanted.insert({(2 * side() + rounded_to_draco_step(p.x) / 256.0) * column_m,
                           rounded_to_draco_step(p.y) / 256.0,
                           (-3 * side() + rounded_to_draco_step(p.z) / 256.0) * column_m});
        }
        std::set<Vector3> found;
        for (std::uint32_t i = 0; i < glb.mesh->num_points(); ++i) {
            found.insert(world_position(glb, i));
        }
        // Triangles that rounding flattens may take a vertex with them.
        for (const Vector3& one : found) {
            EXPECT_TRUE(wanted.contains(one)) << one[0] << " " << one[1] << " " << one[2];
        }
        EXPECT_GT(found.size(), wanted.size() * 98 / 100);
    }
}

using Looks = std::tuple<std::array<float, 3>, std::array<std::uint8_t, 4>>;

/// What the tile's vertices on a plane x = at look like, by their place in the world.
std::map<Vector3, std::set<Looks>> side_of(const ReadGlb& glb, double x_m) {
    std::map<Vector3, std::set<Looks>> side;
    for (std::uint32_t i = 0; i < glb.mesh->num_points(); ++i) {
        const Vector3 at = world_position(glb, i);
        if (at[0] == x_m) {
            Looks looks;
            attribute(glb, "NORMAL")->GetMappedValue(draco::PointIndex(i), &std::get<0>(looks));
            attribute(glb, "COLOR_0")->GetMappedValue(draco::PointIndex(i), &std::get<1>(looks));
            side[at].insert(looks);
        }
    }
    return side;
}

TEST_F(GlbOfWorld, MeetsItsNeighbourInTheSamePoints) {
    for (const std::int32_t lod : {0, 1, 5}) {
        const ReadGlb left = glb_at({.lod = lod, .x = 0, .z = 0});
        const ReadGlb right = glb_at({.lod = lod, .x = 1, .z = 0});
        const double seam = static_cast<double>(side() << lod);
        const auto from_left = side_of(left, seam);
        const auto from_right = side_of(right, seam);
        std::size_t shared = 0;
        for (const auto& [at, looks] : from_left) {
            const auto other = from_right.find(at);
            if (other != from_right.end()) {
                ++shared;
                EXPECT_EQ(looks, other->second);
            }
        }
        EXPECT_GE(shared, static_cast<std::size_t>(side()));
        EXPECT_GE(shared * 100, from_left.size() * 98);
    }
}

TEST_F(GlbOfWorld, StaysInItsBox) {
    for (const std::int32_t lod : {0, 1, 9, 17}) {
        const ReadGlb glb = glb_at({.lod = lod, .x = 0, .z = -1});
        const double width = static_cast<double>(side()) * static_cast<double>(1 << lod);
        for (std::uint32_t i = 0; i < glb.mesh->num_points(); ++i) {
            const Vector3 at = world_position(glb, i);
            EXPECT_GE(at[0], 0);
            EXPECT_LE(at[0], width);
            EXPECT_GE(at[1], -1);
            EXPECT_LE(at[1], settings().height_voxels - 1);
            EXPECT_GE(at[2], -width);
            EXPECT_LE(at[2], 0);
        }
    }
}

TEST_F(GlbOfWorld, SkirtsHangFromEveryOpenFloorEdge) {
    const StackPos at{.lod = 0, .x = 0, .z = 0};
    Mesh bare;
    SurfaceNetsMesher(world_->definition)
        .mesh(bare, stack_at(at), {0, settings().height_voxels - 1});
    Mesh skirted = bare;
    add_side_skirts(skirted, side());
    // One strip of two triangles for each column of the four sides at the least.
    EXPECT_GE(skirted.triangle_count(),
              bare.triangle_count() + 2 * 4 * static_cast<std::size_t>(side() - 1));
    for (std::size_t i = bare.vertex_count(); i < skirted.vertex_count(); ++i) {
        const glm::i32vec3 p = skirted.positions256[i];
        EXPECT_TRUE(p.x == 0 || p.z == 0 || p.x == side() * 256 || p.z == side() * 256);
    }
    // A strip faces out of the tile.
    for (std::size_t i = bare.indices.size(); i < skirted.indices.size(); i += 3) {
        const glm::dvec3 a(skirted.positions256[skirted.indices[i]]);
        const glm::dvec3 b(skirted.positions256[skirted.indices[i + 1]]);
        const glm::dvec3 c(skirted.positions256[skirted.indices[i + 2]]);
        const glm::dvec3 normal = glm::cross(b - a, c - a);
        const glm::dvec3 middle = (a + b + c) / 3.0;
        const double half = side() * 128.0;
        EXPECT_GE(normal.x * (middle.x - half) + normal.z * (middle.z - half), 0);
    }
}

TEST_F(GlbOfWorld, IsTheSameBytesEveryTime) {
    const Mesh mesh = mesh_at({.lod = 0, .x = 5, .z = 5});
    const GlbPlace place = glb_place_of({.x = 160, .z = 160}, 0, 0, 1.0);
    EXPECT_EQ(*encode_glb(mesh, settings(), place), *encode_glb(mesh, settings(), place));
}

TEST(Glb, OfNoTrianglesIsAnEmptyScene) {
    const auto bytes = encode_glb({}, {}, {});
    ASSERT_TRUE(bytes);
    EXPECT_EQ(*bytes, empty_glb());
    const ReadGlb glb = read_glb(*bytes);
    EXPECT_EQ(glb.mesh, nullptr);
    EXPECT_EQ(glb.json, Json::parse(R"({"asset":{"version":"2.0"},"scene":0,
                                        "scenes":[{"name":"empty"}]})"));
}

TEST(Glb, RefusesWhatLeavesItsBox) {
    Mesh mesh;
    mesh.positions256 = {{0, 0, 0}, {256, 0, 0}, {0, 64 * 256, 256}};
    mesh.normals.assign(3, {0, 1, 0});
    mesh.colors.assign(3, {1, 2, 3});
    mesh.material_ids.assign(3, 0);
    mesh.indices = {0, 2, 1};
    const auto bytes = encode_glb(mesh, {.side = 32, .height_voxels = 33}, {});
    ASSERT_FALSE(bytes);
    EXPECT_EQ(bytes.error().code, ErrorCode::out_of_range);
}

TEST(Glb, KeepsPlacesTenMillionKilometresAway) {
    const GlbPlace place =
        glb_place_of({.x = -(std::int64_t{1} << 52), .z = 12345678901}, 32, 0, 0.5);
    EXPECT_EQ(place.corner_m, (Vector3{-2251799813685248.0, 16.0, 6172839450.5}));
    EXPECT_EQ(place.unit_m, (Vector3{0.5, 0.5, 0.5}));
}

}  // namespace
}  // namespace terrane
