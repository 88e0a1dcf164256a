#include "generator/mesh/surface_nets.h"
#include "generator/terrain/generate_stack.h"
#include "tests/support/ascii_cut.h"
#include "tests/support/drawn_worlds.h"
#include "tests/support/test_world.h"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace terrane {
namespace {

/// The largest angle between the normals of a wall and the wall's own, degrees. The wall is 40
/// voxels high, its line in plan goes `run` columns along z for each in x.
double worst_angle(const WorldDefinition& definition, std::int64_t run) {
    const Letters letters("a.");
    const Stack wall = stack_of_columns({}, 32, letters.palette(), [&](ColumnPos at) {
        const std::int32_t top = 256 * (at.x - 16 < floor_div(at.z - 16, run) ? 50 : 10);
        return std::vector<Limit>{
            {0, letters.id('a'), {}}, {top, letters.id('a'), {}}, {top, letters.id('.'), {}}};
    });
    SurfaceNetsMesher mesher(definition);
    Mesh mesh;
    mesher.mesh(mesh, wall, {.first = 20, .last = 40});
    const auto across = static_cast<float>(run);
    const glm::vec3 outward = glm::vec3(across, 0, -1) / std::sqrt(across * across + 1);
    double worst = 0;
    std::size_t checked = 0;
    for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
        const auto along = mesh.positions256[i].z / 256;
        if (along < 6 || along >= 26) {
            continue;  // the tile's sides: they know two columns
        }
        const glm::vec3& normal = mesh.normals[i];
        const float cosine = normal.x * outward.x + normal.y * outward.y + normal.z * outward.z;
        worst = std::max(worst, std::acos(std::min(1.0, static_cast<double>(cosine))));
        ++checked;
    }
    EXPECT_GT(checked, 300U);
    return worst * 180 / 3.14159265358979;
}

TEST(SteepNormals, FollowAWallThatIsAskewToTheLattice) {
    const auto landscape = load_shipped_world("canyon");
    ASSERT_NE(landscape, nullptr);
    for (const std::int64_t run : {2, 3, 5}) {
        // From two by two columns a step is seen as a diagonal.
        const double of_two = worst_angle(Letters("a.").definition(), run);
        EXPECT_GT(of_two, 18) << run;
        EXPECT_LT(worst_angle(landscape->definition, run), 0.5 * of_two) << run;
    }
}

double angle_between(const glm::vec3& a, const glm::vec3& b) {
    return std::acos(std::clamp(static_cast<double>(glm::dot(a, b)), -1.0, 1.0)) * 180 /
           3.14159265358979;
}

/// The face's normal if it is ground steeper than 60 degrees.
std::optional<glm::vec3> wall_normal(const Mesh& mesh, std::size_t first_index) {
    const std::uint32_t* const corners = mesh.indices.data() + first_index;
    const auto place = [&](std::size_t i) {
        return glm::vec3(mesh.positions256[corners[i]]) / 256.0F;
    };
    const glm::vec3 normal = glm::cross(place(1) - place(0), place(2) - place(0));
    const float length = glm::length(normal);
    if (mesh.part_of_triangle(first_index / 3) != MeshPart::ground || length < 1e-4F ||
        std::abs(normal.y) > 0.5F * length) {
        return std::nullopt;
    }
    return normal / length;
}

/// How far neighbouring faces of walls are turned from each other, degrees, ascending.
std::vector<double> turns_of_walls(const Mesh& mesh) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, glm::vec3> faces;
    std::vector<double> turns;
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
        const auto normal = wall_normal(mesh, i);
        for (std::size_t edge = 0; normal && edge < 3; ++edge) {
            const auto ends = std::minmax(mesh.indices[i + edge], mesh.indices[i + (edge + 1) % 3]);
            const auto [other, is_first] = faces.try_emplace({ends.first, ends.second}, *normal);
            if (!is_first) {
                turns.push_back(angle_between(*normal, other->second));
            }
        }
    }
    std::sort(turns.begin(), turns.end());
    return turns;
}

struct WallsCase {
    const char* world;
    double median_most;  ///< degrees; a tenth above what was measured
    double mean_most;
};

class Walls : public testing::TestWithParam<WallsCase> {};

// If every edge were crossed at its middle, walls would turn by a median of 6.2 to 8.7 degrees and
// a mean of 10.0 to 14.5.
TEST_P(Walls, TurnLittleFromFaceToFace) {
    const WallsCase& walls = GetParam();
    const auto world = load_shipped_world(walls.world);
    ASSERT_NE(world, nullptr);
    StackGenerator generator(*world);
    SurfaceNetsMesher mesher(world->definition);
    Stack stack;
    Mesh mesh;
    std::vector<double> turns;
    for (std::int32_t z = -6; z < 6; ++z) {
        for (std::int32_t x = -6; x < 6; ++x) {
            ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = x, .z = z}));
            mesher.mesh(mesh, stack, {.first = 0, .last = 400});
            const auto of_stack = turns_of_walls(mesh);
            turns.insert(turns.end(), of_stack.begin(), of_stack.end());
        }
    }
    ASSERT_GT(turns.size(), 10'000U);
    std::sort(turns.begin(), turns.end());
    double sum = 0;
    for (const double turn : turns) {
        sum += turn;
    }
    const double mean = sum / static_cast<double>(turns.size());
    const double median = turns[turns.size() / 2];
    std::printf("%s: %zu edges of walls, turned by a median of %.1f and a mean of %.1f degrees\n",
                walls.world, turns.size(), median, mean);
    EXPECT_LT(median, walls.median_most);
    EXPECT_LT(mean, walls.mean_most);
}

INSTANTIATE_TEST_SUITE_P(Worlds, Walls,
                         testing::Values(WallsCase{"canyon", 5.3, 10.1},
                                         WallsCase{"range", 2.0, 7.3},
                                         WallsCase{"fold", 2.6, 10.7}),
                         [](const auto& of) { return std::string(of.param.world); });

}  // namespace
}  // namespace terrane
