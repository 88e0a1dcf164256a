// Rays through a scene: what they hit first.
//
// A ray goes from cell to cell of the columns' lattice. Tiles and blocks of cells whose highest
// point it stays above are crossed in one step; in the others it looks at the density several times
// a cell and closes in on the place where the solid begins.
#pragma once

#include "server/render/scene.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <optional>

namespace terrane {

struct Ray {
    glm::dvec3 origin{};
    glm::dvec3 direction{};  ///< of length 1
};

struct Hit {
    double distance = 0;  ///< voxels from the ray's origin
    glm::dvec3 point{};
    glm::dvec3 normal{};  ///< of length 1
    bool cut = false;     ///< on a side of the block
    bool water =
        false;  ///< the surface of water, seen from above, or the side of it where it is cut
};

/// What rays stop at.
enum class Sight : std::uint8_t { solid, solid_and_water };

/// The first solid point within `distance_max` voxels, or point of a water surface. Rays that begin
/// inside the solid hit at 0.
std::optional<Hit> trace(SceneReader& reader, const Ray& ray, double distance_max,
                         Sight sight = Sight::solid);

/// How far a ray that does not fall goes on from distance `t` over land that lies more than
/// `margin` voxels below it; 0 if that is not known.
double clear_way(SceneReader& reader, const Ray& ray, double t, double margin);

}  // namespace terrane
