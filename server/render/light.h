// What a hit point looks like: sun with soft shadows, light of the sky as far as it is not hidden,
// haze with distance, and the sky itself. Everything in linear light.
#pragma once

#include "server/render/trace.h"

#include <glm/glm.hpp>

namespace terrane {

struct Light {
    glm::dvec3 to_sun{};     ///< of length 1
    double haze_voxels = 0;  ///< distance after which 1 - 1/e of the light is haze; 0 for none
};

/// Scene light before `develop`.
glm::dvec3 sky_light(const Light& light, glm::dvec3 direction);

/// The last point whose view of the sky was worked out; the other rays of a pixel share it.
struct SkyMemory {
    glm::dvec3 point{1e18, 0, 0};
    glm::dvec3 normal{};
    double seen = 0;
};

/// Light that comes back along `ray` from `hit`.
glm::dvec3 surface_light(SceneReader& reader, const Light& light, const Ray& ray, const Hit& hit,
                         SkyMemory& memory);

/// From scene light to 0..1, highlights rolled off as film does.
LinearColor develop(glm::dvec3 light);

}  // namespace terrane
