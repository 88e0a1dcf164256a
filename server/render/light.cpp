#include "server/render/light.h"

#include "generator/terrain/random.h"
#include "generator/world/composition.h"
#include "server/render/scene.h"
#include "server/render/trace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace terrane {
namespace {

constexpr glm::dvec3 kSun = {2.75, 2.35, 1.8};
constexpr glm::dvec3 kSky = {0.33, 0.44, 0.66};     // from above
constexpr glm::dvec3 kGround = {0.20, 0.17, 0.14};  // thrown back from below
constexpr glm::dvec3 kZenith = {0.07, 0.22, 0.58};
constexpr glm::dvec3 kHorizon = {0.62, 0.79, 0.98};
constexpr glm::dvec3 kGlow = {1.0, 0.75, 0.45};
// Tangent of the half shadow's width: some six times the real sun's, which looks right at the size
// of a voxel.
constexpr double kPenumbra = 0.03;
constexpr double kSteep = 0.35;        // upright part of a normal: on a wall the land has no height
constexpr double kShadowSight = 1500;  // voxels; no hill throws a longer shadow that matters

/// A random number in 0..1 for each point of a lattice, smooth in between.
double grain(glm::dvec3 point) {
    const glm::dvec3 cell = glm::floor(point);
    const glm::dvec3 f = point - cell;
    const glm::dvec3 s = f * f * (3.0 - 2.0 * f);
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::dvec3 d(corner & 1, corner >> 1 & 1, corner >> 2);
        const glm::dvec3 w = (1.0 - d) * (1.0 - s) + d * s;
        const std::uint64_t hash =
            key(0x6772, static_cast<std::int64_t>(cell.x + d.x),
                static_cast<std::int64_t>(cell.y + d.y), static_cast<std::int64_t>(cell.z + d.z));
        sum += w.x * w.y * w.z * (static_cast<double>(hash >> 40U) * 0x1p-24);
    }
    return sum;
}

/// Rock and soil are never one colour: a factor around 1 that fades where a pixel hides it.
double mottle(glm::dvec3 point, double distance) {
    const auto octave = [&](double period) {
        const double seen = std::clamp(period * 300 / std::max(1.0, distance) - 0.5, 0.0, 1.0);
        return seen > 0 ? seen * (grain(point / period) - 0.5) : 0.0;
    };
    return 1 + 0.15 * octave(0.9) + 0.18 * octave(3.7) + 0.18 * octave(17) + 0.12 * octave(80);
}

/// How much of the sun is seen over the land around, for points on the top surface.
double sun_over_land(SceneReader& reader, glm::dvec3 from, glm::dvec3 to_sun, double step) {
    double seen = 1;
    const double bound = reader.scene().height_bound();
    double t = 0.6 * step;
    while (t < kShadowSight) {
        const glm::dvec3 at = from + to_sun * t;
        if (at.y > bound) {
            break;
        }
        const double half_shadow = kPenumbra * t + 0.05 * step;
        if (const double clear =
                clear_way(reader, {.origin = from, .direction = to_sun}, t, half_shadow);
            clear != 0) {
            t += std::max(clear, 0.01 * step);
            continue;
        }
        const double above = at.y - reader.top_at(at.x, at.z);
        seen = std::min(seen, 0.5 + 0.5 * above / half_shadow);
        if (seen <= 0) {
            return 0;
        }
        // Thin walls and needles are not to be stepped over.
        t += std::min(std::max(0.5 * above, 0.5 * step), step + 0.004 * t);
    }
    return seen * seen * (3 - 2 * seen);
}

double sun_seen(SceneReader& reader, const Light& light, const Hit& hit, double step) {
    if (glm::dot(hit.normal, light.to_sun) <= 0) {
        return 0;
    }
    const glm::dvec3 from = hit.point + hit.normal * (0.1 * step);
    if (!hit.cut && hit.normal.y > kSteep && from.y > reader.top_at(from.x, from.z) - 0.5) {
        return sun_over_land(reader, from, light.to_sun, step);
    }
    // Walls are uneven by a column, being made of columns: that casts no shadow.
    const glm::dvec3 before = hit.point + hit.normal * (1.5 * std::min(step, 2.0));
    const glm::dvec3 origin = hit.cut || reader.density_at(before) > 0 ? from : before;
    return trace(reader, {.origin = origin, .direction = light.to_sun}, kShadowSight) ? 0 : 1;
}

/// Share of the sky that is not hidden by the land around: the mean over directions of what the
/// horizon leaves.
double sky_seen(SceneReader& reader, const Hit& hit, double step) {
    constexpr int kDirections = 8;
    constexpr std::array<double, 5> kReach = {1.3, 3.5, 9, 24, 60};
    const glm::dvec3 from = hit.point + hit.normal * (0.3 * step);
    double seen = 0;
    for (int i = 0; i < kDirections; ++i) {
        const double angle = (i + 0.5) * 2 * std::numbers::pi / kDirections;
        double slope = 0;
        for (const double reach : kReach) {
            const double away = reach * step;
            const double top =
                reader.top_at(from.x + away * std::cos(angle), from.z + away * std::sin(angle));
            slope = std::max(slope, (top - from.y) / away);
        }
        seen += 1 - slope / std::sqrt(1 + slope * slope);
    }
    return seen / kDirections;
}

glm::dvec3 mix_light(glm::dvec3 a, glm::dvec3 b, double share) {
    return a + (b - a) * share;
}

}  // namespace

glm::dvec3 sky_light(const Light& light, glm::dvec3 direction) {
    const double up = std::max(0.0, direction.y);
    const double clear = 1 - std::pow(1 - up, 4.0);
    const double to_sun = std::max(0.0, glm::dot(direction, light.to_sun));
    const double glow = 0.22 * std::pow(to_sun, 6.0) + 0.5 * std::pow(to_sun, 64.0);
    return mix_light(kHorizon, kZenith, clear) + kGlow * glow;
}

namespace {

glm::dvec3 through_haze(const Light& light, const Ray& ray, double distance, glm::dvec3 seen) {
    if (light.haze_voxels <= 0) {
        return seen;
    }
    const double clear = std::exp(-std::pow(distance / light.haze_voxels, 1.25));
    const glm::dvec3 flat = glm::normalize(glm::dvec3(ray.direction.x, 0.02, ray.direction.z));
    return mix_light(sky_light(light, flat), seen, clear);
}

glm::dvec3 solid_light(SceneReader& reader, const Light& light, const Hit& hit, SkyMemory& memory);

/// A surface that mirrors the sky at flat angles, with the bed shining through where it is shallow.
glm::dvec3 water_light(SceneReader& reader, const Light& light, const Ray& ray, const Hit& hit,
                       SkyMemory& memory) {
    // Share of the light that a voxel of water takes, by colour.
    constexpr glm::dvec3 kMurk = {0.42, 0.20, 0.15};
    const double step = reader.tile_at(hit.point.x, hit.point.z).step;
    const LinearColor color = reader.scene().water_color();
    const glm::dvec3 deep = glm::dvec3(color.r, color.g, color.b) * 1.35;
    const double open = hit.cut ? 1 : sun_seen(reader, light, hit, step);
    const glm::dvec3 body = deep * (kSun * (0.10 + 0.22 * open * light.to_sun.y) + kSky * 0.55);
    if (hit.cut) {
        return body;
    }
    const double ripple = std::clamp(400 / std::max(1.0, hit.distance), 0.0, 1.0);
    const auto wave = [&](double period, glm::dvec3 away) {
        return grain((hit.point + away) / period) - 0.5;
    };
    const glm::dvec3 normal = glm::normalize(
        glm::dvec3(ripple * (0.05 * wave(1.3, {0, 0, 0}) + 0.05 * wave(4.1, {9, 0, 3})), 1,
                   ripple * (0.05 * wave(1.3, {40, 0, 0}) + 0.05 * wave(4.1, {70, 0, 3}))));
    const double facing = std::clamp(-glm::dot(ray.direction, normal), 0.0, 1.0);
    const double mirrored = 0.02 + 0.98 * std::pow(1 - facing, 5.0);
    glm::dvec3 up = glm::reflect(ray.direction, normal);
    up.y = std::abs(up.y);
    glm::dvec3 sky = sky_light(light, up);
    if (const auto shore =
            trace(reader, {.origin = hit.point + glm::dvec3(0, 0.05, 0), .direction = up}, 220)) {
        SkyMemory other;
        sky = solid_light(reader, light, *shore, other);
    } else {
        sky += kSun * open * 6.0 * std::pow(std::max(0.0, glm::dot(up, light.to_sun)), 700.0);
    }
    constexpr double kSeenDepth = 14;  // voxels
    const glm::dvec3 down = glm::normalize(glm::dvec3(
        ray.direction.x * 0.75, std::min(ray.direction.y, -0.35), ray.direction.z * 0.75));
    glm::dvec3 seen = body;
    if (const auto bed =
            trace(reader, {.origin = hit.point - glm::dvec3(0, 0.02, 0), .direction = down},
                  kSeenDepth)) {
        const glm::dvec3 clear = glm::exp(-kMurk * (1.6 * bed->distance + 0.15));
        seen = body + (solid_light(reader, light, *bed, memory) - body) * clear;
    }
    return mix_light(seen, sky, mirrored);
}

glm::dvec3 solid_light(SceneReader& reader, const Light& light, const Hit& hit, SkyMemory& memory) {
    const double step = reader.tile_at(hit.point.x, hit.point.z).step;
    const LinearColor color = reader.color_near(hit.point);
    const glm::dvec3 albedo =
        glm::dvec3(color.r, color.g, color.b) * mottle(hit.point, hit.distance);
    const double facing = std::max(0.0, glm::dot(hit.normal, light.to_sun));
    if (glm::length(hit.point - memory.point) > 0.3 * step + 0.002 * hit.distance ||
        glm::dot(hit.normal, memory.normal) < 0.95) {
        memory = {.point = hit.point, .normal = hit.normal, .seen = sky_seen(reader, hit, step)};
    }
    const double sky = memory.seen;
    const double upward = 0.5 + 0.5 * hit.normal.y;
    const glm::dvec3 seen = albedo * (kSun * facing * sun_seen(reader, light, hit, step) +
                                      kSky * (0.06 + 0.94 * sky) * (0.35 + 0.65 * upward) +
                                      kGround * (0.3 + 0.7 * sky) * (1 - 0.6 * upward));
    return seen;
}

}  // namespace

glm::dvec3 surface_light(SceneReader& reader, const Light& light, const Ray& ray, const Hit& hit,
                         SkyMemory& memory) {
    const glm::dvec3 seen = hit.water ? water_light(reader, light, ray, hit, memory)
                                      : solid_light(reader, light, hit, memory);
    return through_haze(light, ray, hit.distance, seen);
}

LinearColor develop(glm::dvec3 light) {
    // Hable-like shoulder by one exponential: straight in the shadows, never burnt out.
    const auto one = [](double v) {
        const double bright = std::max(0.0, v) * 0.85;
        return static_cast<float>(bright < 0.45 ? bright
                                                : 1 - 0.55 * std::exp((0.45 - bright) / 0.55));
    };
    return {.r = one(light.x), .g = one(light.y), .b = one(light.z)};
}

}  // namespace terrane
