#include "generator/mesh/surface_nets.h"
#include "tests/support/ascii_cut.h"
#include "tests/support/drawn_worlds.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

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

}  // namespace
}  // namespace terrane
