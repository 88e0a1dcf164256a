// Blocky meshes against voxels read one by one: the same faces, each once, in as many chunks as
// they lie in.
#include "generator/mesh/blocky.h"

#include "generator/mesh/draco_codec.h"
#include "generator/mesh/shade.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "generator/volume/voxel.h"
#include "tests/support/ascii_cut.h"
#include "tests/support/drawn_worlds.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace terrane {
namespace {

/// A unit square: the voxel it belongs to (world voxels), the axis it looks along, which way.
struct Face {
    std::array<std::int64_t, 3> voxel{};
    int axis = 0;
    int sign = 1;

    friend auto operator<=>(const Face&, const Face&) = default;
};

using Faces = std::map<Face, std::uint8_t>;  ///< and its material

/// Cuts the mesh's rectangles into unit squares; a square that is there twice fails the test.
void add_faces(Faces& faces, const Mesh& mesh, std::array<std::int64_t, 3> corner) {
    ASSERT_EQ(mesh.vertex_count() * 6, mesh.indices.size() * 4);
    for (std::size_t first = 0; first < mesh.vertex_count(); first += 4) {
        const glm::vec3 normal = mesh.normals[first];
        int axis = 0;
        while (axis < 3 && normal[axis] == 0.0F) {
            ++axis;
        }
        ASSERT_LT(axis, 3);
        glm::vec3 flat(0.0F);
        flat[axis] = normal[axis] > 0 ? 1.0F : -1.0F;
        glm::i32vec3 low = mesh.positions256[first];
        glm::i32vec3 high = low;
        for (std::size_t i = first; i < first + 4; ++i) {
            EXPECT_EQ(mesh.normals[i], flat);
            EXPECT_EQ(mesh.material_ids[i], mesh.material_ids[first]);
            for (int a = 0; a < 3; ++a) {
                EXPECT_EQ(mesh.positions256[i][a] % 256, 0);
                low[a] = std::min(low[a], mesh.positions256[i][a]);
                high[a] = std::max(high[a], mesh.positions256[i][a]);
            }
        }
        ASSERT_EQ(low[axis], high[axis]);
        // Both triangles turn counter-clockwise seen from outside and fill the rectangle.
        double area = 0;
        for (std::size_t i = first / 4 * 6; i < first / 4 * 6 + 6; i += 3) {
            const glm::dvec3 a = mesh.positions256[mesh.indices[i]];
            const glm::dvec3 b = mesh.positions256[mesh.indices[i + 1]];
            const glm::dvec3 c = mesh.positions256[mesh.indices[i + 2]];
            const glm::dvec3 p = b - a;
            const glm::dvec3 q = c - a;
            const std::array<double, 3> cross = {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z,
                                                 p.x * q.y - p.y * q.x};
            const double outwards =
                cross[static_cast<std::size_t>(axis)] * static_cast<double>(flat[axis]);
            EXPECT_GT(outwards, 0);
            area += outwards / 2;
        }
        const int u = (axis + 1) % 3;
        const int v = (axis + 2) % 3;
        EXPECT_EQ(area, static_cast<double>(high[u] - low[u]) * (high[v] - low[v]));
        for (std::int32_t i = low[u]; i < high[u]; i += 256) {
            for (std::int32_t j = low[v]; j < high[v]; j += 256) {
                Face face{.axis = axis, .sign = flat[axis] > 0 ? 1 : -1};
                const auto at = [&](int a, std::int32_t value256) {
                    face.voxel[static_cast<std::size_t>(a)] =
                        corner[static_cast<std::size_t>(a)] + value256 / 256;
                };
                at(u, i);
                at(v, j);
                at(axis, low[axis] - (face.sign > 0 ? 256 : 0));
                EXPECT_TRUE(faces.emplace(face, mesh.material_ids[first]).second)
                    << "twice: " << face.voxel[0] << ", " << face.voxel[1] << ", " << face.voxel[2];
            }
        }
    }
}

/// Reads voxels one at a time, by what they are made of.
class VoxelReader {
  public:
    explicit VoxelReader(const WorldDefinition& definition) : definition_(definition) {}

    /// The main material, or none for void and caves.
    std::optional<std::uint8_t> read(const Stack& stack, std::int32_t x, std::int32_t y,
                                     std::int32_t z) const {
        const Voxel voxel = voxel_at(stack.columns.column(x, z), stack.palette, y);
        double hollow = 0;
        Share main;
        for (const Share& share : voxel.shares()) {
            const MaterialKind kind = definition_.materials[share.material].kind;
            const bool is_hollow = kind == MaterialKind::void_ || kind == MaterialKind::cave;
            hollow += is_hollow ? share.concentration : 0;
            main = share.concentration > main.concentration ? share : main;
        }
        return hollow >= 0.5 ? std::nullopt
                             : std::optional(static_cast<std::uint8_t>(main.material));
    }

    /// Every face of the stack's solid voxels from the ground up.
    void add_faces(Faces& faces, const Stack& stack, std::int32_t top) const {
        const ColumnPos corner = first_column_of(stack.position, stack.side);
        for (std::int32_t z = 0; z < stack.side; ++z) {
            for (std::int32_t x = 0; x < stack.side; ++x) {
                for (std::int32_t y = -1; y < top; ++y) {
                    const auto material = read(stack, x, y, z);
                    for (int side = 0; material && side < 6; ++side) {
                        std::array<std::int32_t, 3> next = {x, y, z};
                        const int sign = side % 2 == 0 ? -1 : 1;
                        next[static_cast<std::size_t>(side / 2)] += sign;
                        if (next[1] >= -1 && !read(stack, next[0], next[1], next[2])) {
                            faces[{.voxel = {corner.x + x, y, corner.z + z},
                                   .axis = side / 2,
                                   .sign = sign}] = *material;
                        }
                    }
                }
            }
        }
    }

  private:
    const WorldDefinition& definition_;
};

std::string difference(const Faces& made, const Faces& expected) {
    std::string text;
    int told = 0;
    const auto tell = [&](const char* what, const auto& face) {
        if (++told <= 5) {
            text += std::string(what) + " voxel " + std::to_string(face.first.voxel[0]) + ", " +
                    std::to_string(face.first.voxel[1]) + ", " +
                    std::to_string(face.first.voxel[2]) + " axis " +
                    std::to_string(face.first.axis * face.first.sign) + " material " +
                    std::to_string(face.second) + "\n";
        }
    };
    for (const auto& face : made) {
        const auto found = expected.find(face.first);
        if (found == expected.end() || found->second != face.second) {
            tell("made", face);
        }
    }
    for (const auto& face : expected) {
        const auto found = made.find(face.first);
        if (found == made.end() || found->second != face.second) {
            tell("expected", face);
        }
    }
    return text;
}

std::int32_t top_of(const Stack& stack) {
    std::int32_t top256 = 0;
    for (const Limit& limit : stack.columns.limits) {
        top256 = std::max(top256, limit.y256);
    }
    return top256 / kUnitsPerVoxel + 2;
}

/// The faces of all chunks of a stack, those under the ground and above the top too.
void add_chunks(Faces& faces, BlockyMesher& mesher, const Stack& stack, std::int32_t height) {
    const ColumnPos corner = first_column_of(stack.position, stack.side);
    Mesh mesh;
    for (std::int32_t y = -2; (y - 1) * height <= top_of(stack); ++y) {
        mesher.mesh(mesh, stack, y, height);
        EXPECT_TRUE(y >= 0 || mesh.indices.empty());
        for (const glm::i32vec3& p : mesh.positions256) {
            EXPECT_GE(p.y, 0);
            EXPECT_LE(p.y, height * 256);
        }
        add_faces(faces, mesh, {corner.x, std::int64_t{y} * height, corner.z});
    }
}

TEST(Blocky, OneVoxelIsSixSquares) {
    const Letters letters("aV.");
    const Stack stack = stack_of_columns({}, 3, letters.palette(), [&](ColumnPos at) {
        return letters.column(at.x == 1 && at.z == 1 ? "a..V" : "a");
    });
    BlockyMesher mesher(letters.definition());
    Mesh mesh;
    mesher.mesh(mesh, stack, 1, 2);
    EXPECT_EQ(mesh.vertex_count(), 24U);
    Faces faces;
    add_faces(faces, mesh, {0, 2, 0});
    EXPECT_EQ(faces.size(), 6U);
    const std::uint8_t vein = static_cast<std::uint8_t>(letters.id('V'));
    for (const auto& [face, material] : faces) {
        EXPECT_EQ(face.voxel, (std::array<std::int64_t, 3>{1, 3, 1}));
        EXPECT_EQ(material, vein);
    }
    const LinearColor color = linear_colors_of(letters.definition())[vein];
    EXPECT_NEAR(mesh.colors[0].x, color.r * 255, 0.5);
    EXPECT_NEAR(mesh.colors[0].y, color.g * 255, 0.5);
    EXPECT_NEAR(mesh.colors[0].z, color.b * 255, 0.5);
}

TEST(Blocky, AFlatFloorIsOneRectangleAndTwoMaterialsAreTwo) {
    const Letters letters("ab.");
    BlockyMesher mesher(letters.definition());
    Mesh mesh;
    mesher.mesh(mesh, stack_of_cut(letters, {"aaaaaaaa", "aaaaaaaa"}), 0, 8);
    EXPECT_EQ(mesh.triangle_count(), 2U);
    mesher.mesh(mesh, stack_of_cut(letters, {"aaabbbbb", "aaaaaaaa"}), 0, 8);
    EXPECT_EQ(mesh.triangle_count(), 4U);
}

TEST(Blocky, AStepIsMergedAcrossLayersAndColumns) {
    const Letters letters("a.");
    BlockyMesher mesher(letters.definition());
    Mesh mesh;
    mesher.mesh(mesh,
                stack_of_cut(letters, {"aaaa....", "aaaa....", "aaaa....", "aaaa....", "aaaaaaaa"}),
                0, 8);
    EXPECT_EQ(mesh.triangle_count(), 6U) << "two floors and the wall between them";
}

TEST(Blocky, AVoxelIsSolidWhereItsCentreIs) {
    const Letters letters("a.");
    for (const std::int32_t top256 : {256 + 127, 256 + 128, 256 + 129, 512 + 128}) {
        const Stack stack = stack_of_columns({}, 2, letters.palette(), [&](ColumnPos) {
            return std::vector<Limit>{{.y256 = 0, .palette_id = 0, .flow = {}},
                                      {.y256 = top256, .palette_id = 0, .flow = {}},
                                      {.y256 = top256, .palette_id = 1, .flow = {}}};
        });
        BlockyMesher mesher(letters.definition());
        Mesh mesh;
        mesher.mesh(mesh, stack, 0, 8);
        ASSERT_EQ(mesh.vertex_count(), 4U);
        EXPECT_EQ(mesh.positions256[0].y, top256 <= 256 + 128 ? 256 : 512) << top256;
    }
}

TEST(Blocky, TheGroundsTopsBelongToTheChunkOnTheGround) {
    const Letters letters("a.");
    const Stack stack = stack_of_columns({}, 4, letters.palette(), [&](ColumnPos at) {
        const std::int32_t top256 = at.x == 1 ? 100 : 300;
        return std::vector<Limit>{{.y256 = 0, .palette_id = 0, .flow = {}},
                                  {.y256 = top256, .palette_id = 0, .flow = {}},
                                  {.y256 = top256, .palette_id = 1, .flow = {}}};
    });
    BlockyMesher mesher(letters.definition());
    Faces made;
    add_chunks(made, mesher, stack, 4);
    Faces expected;
    VoxelReader(letters.definition()).add_faces(expected, stack, top_of(stack));
    EXPECT_EQ(made.size(), 16U + 8U);
    EXPECT_EQ(difference(made, expected), "");
}

TEST(Blocky, MadeUpColumnsHaveTheFacesOfTheirVoxels) {
    const Letters letters("abc.o");
    const VoxelReader reader(letters.definition());
    BlockyMesher mesher(letters.definition());
    using Columns = std::vector<Limit> (*)(const Letters&, std::uint64_t, ColumnPos);
    for (const Columns world : {&hills, &caves, &rubble, &depths}) {
        for (const std::int32_t side : {4, 17, 64}) {
            if (world == &depths && side > 4) {
                continue;  // 900 voxels high
            }
            const Stack stack =
                stack_of_columns({.lod = 0, .x = -1, .z = 2}, side, letters.palette(),
                                 [&](ColumnPos at) { return world(letters, 11, at); });
            Faces expected;
            reader.add_faces(expected, stack, top_of(stack));
            for (const std::int32_t height : {4, 32}) {
                Faces made;
                add_chunks(made, mesher, stack, height);
                EXPECT_GT(made.size(), 16U);
                EXPECT_EQ(difference(made, expected), "") << side << " by " << height;
            }
        }
    }
}

TEST(Blocky, TallColumnsHaveTheFacesOfTheirVoxels) {
    const Letters letters("ab.o");
    const Stack stack = stack_of_columns({}, 5, letters.palette(), [&](ColumnPos at) {
        std::vector<Limit> column;
        std::int32_t y256 = 0;
        for (std::int32_t i = 0; i < 16; ++i) {
            const std::uint16_t id = letters.id(i % 3 == 1 ? 'o' : i % 2 == 0 ? 'a' : 'b');
            column.push_back({.y256 = y256, .palette_id = id, .flow = {}});
            y256 += 256 + drawn(static_cast<std::uint64_t>(i), at.x / 2, at.z, 40 * 256);
            column.push_back({.y256 = y256, .palette_id = id, .flow = {}});
        }
        column.push_back({.y256 = y256, .palette_id = letters.id('.'), .flow = {}});
        return column;
    });
    BlockyMesher mesher(letters.definition());
    Mesh mesh;
    mesher.mesh(mesh, stack, HeightRange{.first = 0, .last = 1000});
    Faces made;
    add_faces(made, mesh, {0, 0, 0});
    Faces expected;
    VoxelReader(letters.definition()).add_faces(expected, stack, top_of(stack));
    EXPECT_GT(made.size(), 4000U);
    EXPECT_EQ(difference(made, expected), "");
}

/// Area by material and direction, in unit squares.
std::map<std::array<int, 3>, std::size_t> areas_of(const Faces& faces) {
    std::map<std::array<int, 3>, std::size_t> areas;
    for (const auto& [face, material] : faces) {
        ++areas[{material, face.axis, face.sign}];
    }
    return areas;
}

TEST(Blocky, GeneratedChunksHaveEachFaceOfTheirVoxelsOnce) {
    for (const char* name : {"paper-B3-seed42", "dense-seed43", "edge-dense", "edge-pinch",
                             "edge-picky", "edge-one"}) {
        const auto world = load_test_world(name);
        ASSERT_NE(world, nullptr);
        StackGenerator generator(*world);
        const VoxelReader reader(world->definition);
        BlockyMesher mesher(world->definition);
        Faces made;
        Faces expected;
        for (std::int32_t i = 0; i < 4; ++i) {
            Stack stack;
            ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = i % 2 - 1, .z = i / 2 + 3}));
            add_chunks(made, mesher, stack, world->definition.grid.height);
            reader.add_faces(expected, stack, top_of(stack));
        }
        EXPECT_GT(made.size(), 300U) << name;
        EXPECT_EQ(areas_of(made), areas_of(expected)) << name;
        EXPECT_EQ(difference(made, expected), "") << name;
    }
}

TEST(Blocky, UsedAgainItMakesTheSameMesh) {
    const auto world = load_test_world("edge-dense");
    ASSERT_NE(world, nullptr);
    StackGenerator generator(*world);
    Stack stack;
    Stack other;
    ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = 0, .z = 0}));
    ASSERT_TRUE(generator.generate(other, {.lod = 0, .x = 7, .z = -3}));
    BlockyMesher fresh(world->definition);
    BlockyMesher used(world->definition);
    const HeightRange all{.first = 0, .last = top_of(stack)};
    Mesh expected;
    fresh.mesh(expected, stack, all);
    Mesh mesh;
    used.mesh(mesh, other, all);
    used.mesh(mesh, stack, all);
    EXPECT_EQ(mesh.positions256, expected.positions256);
    EXPECT_EQ(mesh.material_ids, expected.material_ids);
    EXPECT_EQ(mesh.indices, expected.indices);
}

TEST(Blocky, DracoGivesBackEveryFace) {
    const auto world = load_test_world("edge-dense");
    ASSERT_NE(world, nullptr);
    const Grid& grid = world->definition.grid;
    StackGenerator generator(*world);
    Stack stack;
    ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = 0, .z = 0}));
    BlockyMesher mesher(world->definition);
    Mesh mesh;
    int full = 0;
    for (std::int32_t y = 0; y * grid.height <= top_of(stack); ++y) {
        mesher.mesh(mesh, stack, y, grid.height);
        if (mesh.triangle_count() == 0) {
            continue;
        }
        const auto bytes =
            encode_draco(mesh, {.side = grid.side, .height_voxels = grid.height + 1});
        ASSERT_TRUE(bytes) << bytes.error().message;
        const auto decoded = decode_draco(*bytes);
        ASSERT_TRUE(decoded) << decoded.error().message;
        ASSERT_EQ(decoded->triangle_count(), mesh.triangle_count());
        // Draco orders triangles anew, so their corners are compared, sorted.
        const auto corners_of = [](const Mesh& of) {
            std::vector<std::array<int, 10>> corners;
            for (const std::uint32_t i : of.indices) {
                const glm::i32vec3 p = of.positions256[i];
                const glm::vec3 n = of.normals[i];
                const glm::u8vec3 c = of.colors[i];
                corners.push_back({p.x, p.y, p.z, static_cast<int>(std::lround(n.x)),
                                   static_cast<int>(std::lround(n.y)),
                                   static_cast<int>(std::lround(n.z)), c.x, c.y, c.z,
                                   of.material_ids[i]});
            }
            std::ranges::sort(corners);
            return corners;
        };
        EXPECT_EQ(corners_of(*decoded), corners_of(mesh));
        ++full;
    }
    EXPECT_GT(full, 0);
}

}  // namespace
}  // namespace terrane
