#include "server/render/trace.h"

#include "server/render/scene.h"
#include "server/render/scene_tile.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

namespace terrane {
namespace {

constexpr double kNowhere = std::numeric_limits<double>::infinity();
// Crossing a border, go on this far behind it.
constexpr double kNudge = 1e-5;
// No ray needs more: sight is 24576 voxels and most of it is crossed tile by tile.
constexpr int kStepsMax = 100000;

/// The part of a ray inside the block and under the height bound.
struct RaySpan {
    double begin = 0;
    double end = 0;
    glm::dvec3 entered{};  ///< normal of the block's side where it begins, or 0
};

/// Cuts the span to lo <= origin + t * direction <= hi along one axis.
void clip(RaySpan& span, double origin, double direction, double lo, double hi, glm::dvec3 normal) {
    if (direction == 0) {
        if (origin < lo || origin > hi) {
            span.end = -1;
        }
        return;
    }
    const double a = (lo - origin) / direction;
    const double b = (hi - origin) / direction;
    if (std::min(a, b) > span.begin) {
        span.begin = std::min(a, b);
        span.entered = direction > 0 ? -normal : normal;
    }
    span.end = std::min(span.end, std::max(a, b));
}

RaySpan span_of(const Scene& scene, const Ray& ray, double distance_max) {
    RaySpan span{.begin = 0, .end = distance_max};
    const auto& box = scene.box();
    clip(span, ray.origin.y, ray.direction.y, box ? 0 : -1e6, scene.height_bound(), {0, 1, 0});
    if (box) {
        clip(span, ray.origin.x, ray.direction.x, box->x0, box->x1, {1, 0, 0});
        clip(span, ray.origin.z, ray.direction.z, box->z0, box->z1, {0, 0, 1});
    }
    return span;
}

/// Where the ray leaves the square.
double exit_of(const Ray& ray, double x0, double z0, double side) {
    const auto one = [](double origin, double direction, double first, double length) {
        if (direction == 0) {
            return kNowhere;
        }
        return ((direction > 0 ? first + length : first) - origin) / direction;
    };
    return std::min(one(ray.origin.x, ray.direction.x, x0, side),
                    one(ray.origin.z, ray.direction.z, z0, side));
}

/// Least height of the ray between two distances.
double lowest(const Ray& ray, double begin, double end) {
    return ray.origin.y + ray.direction.y * (ray.direction.y < 0 ? end : begin);
}

/// Where the solid begins within [begin, end] of one cell, or kNowhere.
double hit_in_cell(const PlacedTile& placed, const Ray& ray, double begin, double end) {
    const auto density = [&](double t) {
        return density_at(*placed.tile, placed.local(ray.origin + ray.direction * t));
    };
    if (density(begin) > 0) {
        return begin;
    }
    const double stride = placed.tile->lod > 0         ? 0.3 * placed.step
                          : placed.tile->caves.empty() ? 0.4
                                                       : 0.2;
    const int steps = 1 + static_cast<int>(std::min(4096.0, (end - begin) / stride));
    double outside = begin;
    for (int i = 1; i <= steps; ++i) {
        double inside = begin + (end - begin) * i / steps;
        if (density(inside) <= 0) {
            outside = inside;
            continue;
        }
        for (int halving = 0; halving < 14; ++halving) {
            const double middle = 0.5 * (outside + inside);
            (density(middle) > 0 ? inside : outside) = middle;
        }
        return inside;
    }
    return kNowhere;
}

/// Where the ray comes down to a water surface within [begin, end] of cell (u, v), or kNowhere.
double water_in_cell(const PlacedTile& placed, const Ray& ray, std::int32_t u, std::int32_t v,
                     double begin, double end) {
    std::array<WaterSurface, kWaterSurfacesMax> surfaces;
    const std::size_t count = water_surfaces(surfaces, *placed.tile, u, v);
    double nearest = kNowhere;
    for (std::size_t i = 0; i < count; ++i) {
        const auto above = [&](double t) {
            const TilePoint point = placed.local(ray.origin + ray.direction * t);
            return point.y - surfaces[i].at(point.u - u, point.v - v);
        };
        double outside = begin;
        double inside = end;
        if (above(outside) <= 0 || above(inside) > 0) {
            continue;
        }
        for (int halving = 0; halving < 14; ++halving) {
            const double middle = 0.5 * (outside + inside);
            (above(middle) > 0 ? outside : inside) = middle;
        }
        nearest = std::min(nearest, inside);
    }
    return nearest;
}

/// A hit's distance, or kNowhere.
struct Found {
    double distance = kNowhere;
    bool water = false;
};

/// Goes on from `t` by as much as can be said at once. Gives what is hit, or nothing with `t`
/// moved.
Found advance(SceneReader& reader, const Ray& ray, double& t, double end, Sight sight) {
    const glm::dvec3 at = ray.origin + ray.direction * (t + kNudge);
    const PlacedTile& placed = reader.tile_at(at.x, at.z);
    const double side = placed.step * kTileCells;
    double exit = std::min(end, exit_of(ray, placed.x0, placed.z0, side));
    if (placed.tile == nullptr ||
        lowest(ray, t, exit) > static_cast<double>(placed.tile->highest)) {
        t = std::max(exit, t) + kNudge;
        return {};
    }
    const auto cell_u =
        std::clamp(static_cast<std::int32_t>((at.x - placed.x0) / placed.step), 0, kTileCells - 1);
    const auto cell_v =
        std::clamp(static_cast<std::int32_t>((at.z - placed.z0) / placed.step), 0, kTileCells - 1);
    const std::int32_t block_u = cell_u / kBlockCells;
    const std::int32_t block_v = cell_v / kBlockCells;
    exit = std::min(
        end, exit_of(ray, placed.x0 + placed.step * block_u * kBlockCells,
                     placed.z0 + placed.step * block_v * kBlockCells, placed.step * kBlockCells));
    if (lowest(ray, t, exit) >
        static_cast<double>(placed.tile->block_highest[SceneTile::block_index(block_u, block_v)])) {
        t = std::max(exit, t) + kNudge;
        return {};
    }
    exit = std::min(end, exit_of(ray, placed.x0 + placed.step * cell_u,
                                 placed.z0 + placed.step * cell_v, placed.step));
    const auto& covers = placed.tile->covers;
    const auto highest =
        static_cast<double>(std::max({covers[SceneTile::index_of(cell_u, cell_v)],
                                      covers[SceneTile::index_of(cell_u + 1, cell_v)],
                                      covers[SceneTile::index_of(cell_u, cell_v + 1)],
                                      covers[SceneTile::index_of(cell_u + 1, cell_v + 1)]}));
    double begin = t;
    if (ray.direction.y < 0) {
        // Nothing to look at above the cell's highest corner; level water is crossed from above it.
        constexpr double kAbove = 0.01;
        begin = std::max(begin, (highest + kAbove - ray.origin.y) / ray.direction.y);
    }
    t = std::max(exit, t) + kNudge;
    if (begin > exit || lowest(ray, begin, exit) > highest) {
        return {};
    }
    const double solid = hit_in_cell(placed, ray, begin, exit);
    if (sight == Sight::solid) {
        return {.distance = solid};
    }
    const double water = water_in_cell(placed, ray, cell_u, cell_v, begin, exit);
    return water < solid ? Found{.distance = water, .water = true} : Found{.distance = solid};
}

/// Against the gradient of the density, over one cell either way, so that it is as smooth as the
/// surface looks; not of unit length.
glm::dvec3 fall_at(SceneReader& reader, glm::dvec3 point, double step) {
    const auto slope = [&](glm::dvec3 d, double length) {
        return (reader.density_at(point - d * length) - reader.density_at(point + d * length)) /
               (2 * length);
    };
    return {slope({1, 0, 0}, step), slope({0, 1, 0}, 0.5), slope({0, 0, 1}, step)};
}

glm::dvec3 normal_at(SceneReader& reader, glm::dvec3 point) {
    const double step = reader.tile_at(point.x, point.z).step;
    const glm::dvec3 here = fall_at(reader, point, step);
    glm::dvec3 normal = here;
    // The columns of a wall stand in steps, and the nearest two show an axis or the diagonal: what
    // way it faces is seen over some more of them, but for those that see its other side.
    constexpr double kSteep = 0.35;  // of a unit normal's upright part
    if (std::abs(here.y) < kSteep * glm::length(here)) {
        for (const double x : {-2.0, 0.0, 2.0}) {
            for (const double z : {-2.0, 0.0, 2.0}) {
                const glm::dvec3 beside =
                    fall_at(reader, point + glm::dvec3(x * step, 0, z * step), step);
                normal += glm::dot(beside, here) > 0 ? beside : glm::dvec3(0);
            }
        }
    }
    const double length = glm::length(normal);
    return length > 1e-9 ? normal / length : glm::dvec3(0, 1, 0);
}

}  // namespace

double clear_way(SceneReader& reader, const Ray& ray, double t, double margin) {
    const glm::dvec3 at = ray.origin + ray.direction * t;
    const PlacedTile& placed = reader.tile_at(at.x, at.z);
    const double side = placed.step * kTileCells;
    if (placed.tile == nullptr || at.y - margin > static_cast<double>(placed.tile->highest)) {
        return std::max(0.0, exit_of(ray, placed.x0, placed.z0, side) - t) + kNudge;
    }
    const double block = placed.step * kBlockCells;
    const auto number = [&](double from) {
        return std::clamp(static_cast<std::int32_t>(from / block), 0, kBlocksPerSide - 1);
    };
    const std::int32_t u = number(at.x - placed.x0);
    const std::int32_t v = number(at.z - placed.z0);
    if (at.y - margin <=
        static_cast<double>(placed.tile->block_highest[SceneTile::block_index(u, v)])) {
        return 0;
    }
    return std::max(0.0, exit_of(ray, placed.x0 + block * u, placed.z0 + block * v, block) - t) +
           kNudge;
}

std::optional<Hit> trace(SceneReader& reader, const Ray& ray, double distance_max, Sight sight) {
    const RaySpan span = span_of(reader.scene(), ray, distance_max);
    if (span.begin >= span.end) {
        return std::nullopt;
    }
    if (sight == Sight::solid_and_water && (span.entered.x != 0 || span.entered.z != 0)) {
        const glm::dvec3 side = ray.origin + ray.direction * (span.begin + 2 * kNudge);
        const PlacedTile& placed = reader.tile_at(side.x, side.z);
        if (placed.tile != nullptr && in_water(*placed.tile, placed.local(side)) &&
            reader.density_at(side) <= 0) {
            return Hit{.distance = span.begin,
                       .point = side,
                       .normal = span.entered,
                       .cut = true,
                       .water = true};
        }
    }
    double t = span.begin;
    for (int step = 0; step < kStepsMax && t < span.end; ++step) {
        const Found found = advance(reader, ray, t, span.end, sight);
        if (found.distance == kNowhere) {
            if (ray.direction.y >= 0 &&
                ray.origin.y + ray.direction.y * t > reader.scene().height_bound()) {
                break;
            }
            continue;
        }
        Hit hit{.distance = found.distance,
                .point = ray.origin + ray.direction * found.distance,
                .water = found.water};
        if (hit.water) {
            hit.normal = {0, 1, 0};
            return hit;
        }
        hit.cut = reader.scene().box() && found.distance <= span.begin + 2 * kNudge &&
                  (span.entered.x != 0 || span.entered.y < 0 || span.entered.z != 0);
        hit.normal = hit.cut ? span.entered : normal_at(reader, hit.point);
        return hit;
    }
    return std::nullopt;
}

}  // namespace terrane
