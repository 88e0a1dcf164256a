#include "generator/mesh/draco_codec.h"

#include "generator/mesh/surface_nets.h"
#include "tests/support/drawn_worlds.h"
#include "tests/support/mesh_audit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace terrane {
namespace {

constexpr std::int32_t kSide = 16;
constexpr std::int32_t kHeight = 16;
constexpr DracoSettings kSettings = {.side = kSide, .height_voxels = kHeight + 1, .speed = 7};

using World = std::vector<Limit> (*)(const Letters&, std::uint64_t, ColumnPos);

Mesh mesh_of(World world, ChunkPos chunk) {
    const Letters letters("abc.o");
    SurfaceNetsMesher mesher(letters.definition());
    Mesh mesh;
    mesher.mesh(mesh,
                stack_of_columns(stack_of(chunk), kSide, letters.palette(),
                                 [&](ColumnPos at) { return world(letters, 3, at); }),
                chunk.y, kHeight);
    return mesh;
}

using Vertex = std::array<std::int32_t, 7>;
using Triangle = std::array<Vertex, 3>;

/// Triangles by what their corners are, each turned to the least of its three turns: where rounding
/// makes corners equal, the least corner does not say which.
std::multiset<Triangle> triangles_of(const Mesh& mesh) {
    std::multiset<Triangle> triangles;
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
        Triangle triangle;
        for (std::size_t corner = 0; corner < 3; ++corner) {
            const std::uint32_t v = mesh.indices[i + corner];
            const glm::i32vec3& p = mesh.positions256[v];
            triangle[corner] = {rounded_to_draco_step(p.x), rounded_to_draco_step(p.y),
                                rounded_to_draco_step(p.z), mesh.colors[v].x,
                                mesh.colors[v].y,           mesh.colors[v].z,
                                mesh.material_ids[v]};
        }
        Triangle least = triangle;
        for (int turn = 0; turn < 2; ++turn) {
            std::rotate(triangle.begin(), triangle.begin() + 1, triangle.end());
            least = std::min(least, triangle);
        }
        triangles.insert(least);
    }
    return triangles;
}

TEST(DracoCodec, GivesBackEveryTriangleRoundedTo32thsOfAVoxel) {
    for (const World world : {&hills, &caves, &rubble}) {
        for (const std::int32_t y : {0, 1}) {
            const Mesh mesh = mesh_of(world, {.lod = 0, .x = -2, .y = y, .z = 5});
            ASSERT_GT(mesh.triangle_count(), 100U);
            const auto bytes = encode_draco(mesh, kSettings);
            ASSERT_TRUE(bytes) << bytes.error().message;
            const auto decoded = decode_draco(*bytes);
            ASSERT_TRUE(decoded) << decoded.error().message;
            EXPECT_EQ(triangles_of(*decoded), triangles_of(mesh));
            EXPECT_EQ(encode_draco(mesh, kSettings), bytes) << "not deterministic";
        }
    }
}

TEST(DracoCodec, KeepsNormalsWithinTheirEightBits) {
    const Mesh mesh = mesh_of(&hills, {});
    const auto decoded = decode_draco(*encode_draco(mesh, kSettings));
    ASSERT_TRUE(decoded);
    std::map<std::array<std::int32_t, 3>, glm::vec3> normals;
    for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
        const glm::i32vec3& p = mesh.positions256[i];
        normals[{rounded_to_draco_step(p.x), rounded_to_draco_step(p.y),
                 rounded_to_draco_step(p.z)}] = mesh.normals[i];
    }
    ASSERT_EQ(normals.size(), mesh.vertex_count());
    for (std::size_t i = 0; i < decoded->vertex_count(); ++i) {
        const glm::i32vec3& p = decoded->positions256[i];
        const glm::vec3 expected = normals.at({p.x, p.y, p.z});
        const glm::vec3& n = decoded->normals[i];
        EXPECT_GT(n.x * expected.x + n.y * expected.y + n.z * expected.z, 0.9995F);
    }
}

TEST(DracoCodec, DecodedNeighboursStillMeet) {
    for (const World world : {&hills, &caves, &rubble}) {
        MeshAudit audit(kSide, kHeight);
        for (std::int32_t z = -1; z <= 1; ++z) {
            for (std::int32_t x = -1; x <= 1; ++x) {
                for (std::int32_t y = 0; y * kHeight < 64; ++y) {
                    const ChunkPos chunk{.lod = 0, .x = x, .y = y, .z = z};
                    Mesh mesh = mesh_of(world, chunk);
                    if (mesh.indices.empty()) {
                        continue;
                    }
                    const auto decoded = decode_draco(*encode_draco(mesh, kSettings));
                    ASSERT_TRUE(decoded) << decoded.error().message;
                    audit.add(*decoded, chunk);
                }
            }
        }
        EXPECT_EQ(audit.open_edges_inside(), 0);
    }
}

TEST(DracoCodec, RoundsHalfUpwardsOnBothSidesOfZero) {
    EXPECT_EQ(rounded_to_draco_step(0), 0);
    EXPECT_EQ(rounded_to_draco_step(3), 0);
    EXPECT_EQ(rounded_to_draco_step(4), 8);
    EXPECT_EQ(rounded_to_draco_step(-4), 0);
    EXPECT_EQ(rounded_to_draco_step(-5), -8);
    EXPECT_EQ(rounded_to_draco_step(-256), -256);
}

TEST(DracoCodec, UsesTheFewestBitsThatReachAcrossAChunk) {
    EXPECT_EQ(draco_position_bits({.side = 4, .height_voxels = 5}), 8);
    EXPECT_EQ(draco_position_bits({.side = 32, .height_voxels = 33}), 11);
    EXPECT_EQ(draco_position_bits({.side = 62, .height_voxels = 63}), 11);
    EXPECT_EQ(draco_position_bits({.side = 63, .height_voxels = 64}), 12);
    EXPECT_EQ(draco_position_bits({.side = 32, .height_voxels = 16384 + 1}), 20);
}

TEST(DracoCodec, RefusesWhatHasNoEncoding) {
    EXPECT_EQ(encode_draco(Mesh{}, kSettings).error().code, ErrorCode::invalid_argument);
    Mesh mesh = mesh_of(&hills, {});
    mesh.positions256[3].x = kSide * 256 + 1;
    EXPECT_EQ(encode_draco(mesh, kSettings).error().code, ErrorCode::out_of_range);
    mesh.positions256[3] = {0, -257, 0};
    EXPECT_EQ(encode_draco(mesh, kSettings).error().code, ErrorCode::out_of_range);
}

Bytes small_sample() {
    const Letters letters("ab.");
    SurfaceNetsMesher mesher(letters.definition());
    Mesh mesh;
    mesher.mesh(mesh, stack_of_cut(letters, {"...b..", "bbbbbb", "aaaaaa"}), 0, 4);
    return *encode_draco(mesh, {.side = 4, .height_voxels = 5});
}

TEST(DracoCodec, RefusesEveryTruncation) {
    const Bytes sample = small_sample();
    ASSERT_TRUE(decode_draco(sample));
    for (std::size_t size = 0; size < sample.size(); ++size) {
        // A copy, so that a read beyond the end is seen by the address sanitizer.
        const Bytes prefix(sample.begin(), sample.begin() + static_cast<std::ptrdiff_t>(size));
        EXPECT_FALSE(decode_draco(prefix)) << size;
    }
}

TEST(DracoCodec, SurvivesEveryFlippedByte) {
    const Bytes sample = small_sample();
    int refused = 0;
    for (std::size_t at = 0; at < sample.size(); ++at) {
        for (const unsigned flip : {0x01U, 0x80U, 0xFFU}) {
            Bytes flipped = sample;
            flipped[at] ^= std::byte{static_cast<unsigned char>(flip)};
            const auto decoded = decode_draco(flipped);
            refused += decoded ? 0 : 1;
            if (decoded) {
                for (const std::uint32_t index : decoded->indices) {
                    ASSERT_LT(index, decoded->vertex_count());
                }
            }
        }
    }
    EXPECT_GT(refused, 30);
}

TEST(DracoCodec, RefusesAPromiseOfMoreTrianglesThanItsBytesCanHold) {
    Bytes sample = small_sample();
    // "DRACO", version, geometry, method, flags, traversal: 12 bytes; then vertices and triangles.
    const Bytes huge = {std::byte{0xFF}, std::byte{0xFF}, std::byte{0xFF}, std::byte{0x0F}};
    sample.insert(sample.begin() + 13, huge.begin(), huge.end());
    const auto decoded = decode_draco(sample);
    ASSERT_FALSE(decoded);
    EXPECT_EQ(decoded.error().code, ErrorCode::malformed);
    EXPECT_NE(decoded.error().message.find("cannot hold"), std::string::npos)
        << decoded.error().message;
}

TEST(DracoCodec, RefusesACountOfVerticesBeyond64Bits) {
    Bytes sample = small_sample();
    // The vertices' own byte becomes their tenth; the triangles behind it are there as before.
    sample.insert(sample.begin() + 12, 9, std::byte{0xFF});
    const auto decoded = decode_draco(sample);
    ASSERT_FALSE(decoded);
    EXPECT_EQ(decoded.error().code, ErrorCode::malformed);
    EXPECT_NE(decoded.error().message.find("header"), std::string::npos) << decoded.error().message;
}

}  // namespace
}  // namespace terrane
