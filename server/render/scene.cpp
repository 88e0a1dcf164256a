#include "server/render/scene.h"

#include "generator/landscape/river_map.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "generator/volume/color.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"
#include "server/render/scene_tile.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>

namespace terrane {
namespace {

// Level l >= 1 begins kNear * 2^(l-1) voxels from the eye, where its cells are about four pixels.
constexpr double kNear = 512;
constexpr std::int32_t kLevels = 6;
// Tiles from the origin to where the next level has surely begun.
constexpr std::int64_t kWindow = 12;

double tile_side(std::int32_t lod) {
    return static_cast<double>(kTileCells) * static_cast<double>(std::int64_t{1} << lod);
}

std::int64_t tile_index(double at, std::int32_t lod) {
    return static_cast<std::int64_t>(std::floor(at / tile_side(lod)));
}

/// How far the tile's nearest point is from the origin, by the larger of x and z.
double tile_distance(std::int64_t x, std::int64_t z, std::int32_t lod) {
    const auto away = [side = tile_side(lod)](std::int64_t i) {
        const double first = static_cast<double>(i) * side;
        return std::max({0.0, first, -(first + side)});
    };
    return std::max(away(x), away(z));
}

double begin_of(std::int32_t lod) {
    return lod == 0 ? 0 : kNear * static_cast<double>(std::int64_t{1} << (lod - 1));
}

}  // namespace

Scene::Scene(const World& world, ColumnPos origin, std::optional<ColumnBlock> block)
    : world_(&world), origin_(origin), height_bound_(world.stack.height_bound + 2) {
    for (const Material& material : world.definition.materials) {
        if (material.kind == MaterialKind::water) {
            water_color_ = linear_from_srgb(material.color);
        }
    }
    if (block) {
        box_ = SceneBox{.x0 = static_cast<double>(block->x_first - origin.x) - 0.5,
                        .z0 = static_cast<double>(block->z_first - origin.z) - 0.5,
                        .x1 = static_cast<double>(block->x_end - origin.x) - 0.5,
                        .z1 = static_cast<double>(block->z_end - origin.z) - 0.5};
        const std::int64_t x = tile_index(box_->x0, 0) - 1;
        const std::int64_t z = tile_index(box_->z0, 0) - 1;
        add_level(x, z, tile_index(box_->x1, 0) + 2 - x, tile_index(box_->z1, 0) + 2 - z);
        return;
    }
    for (std::int32_t lod = 0; lod < kLevels; ++lod) {
        add_level(-kWindow, -kWindow, 2 * kWindow, 2 * kWindow);
    }
}

void Scene::add_level(std::int64_t x_first, std::int64_t z_first, std::int64_t width,
                      std::int64_t length) {
    levels_.push_back({.x_first = x_first,
                       .z_first = z_first,
                       .width = width,
                       .length = length,
                       .slots = std::make_unique<Slot[]>(static_cast<std::size_t>(width) *
                                                         static_cast<std::size_t>(length))});
}

PlacedTile Scene::tile_at(double x, double z, StackGenerator& generator, RiverMap& rivers) const {
    // The coarsest tile over the point that begins far enough out: all rays agree on it.
    auto lod = static_cast<std::int32_t>(levels_.size()) - 1;
    while (lod > 0 && tile_distance(tile_index(x, lod), tile_index(z, lod), lod) < begin_of(lod)) {
        --lod;
    }
    const Level& level = levels_[static_cast<std::size_t>(lod)];
    const std::int64_t tile_x = tile_index(x, lod);
    const std::int64_t tile_z = tile_index(z, lod);
    const std::int64_t i = tile_x - level.x_first;
    const std::int64_t j = tile_z - level.z_first;
    const double side = tile_side(lod);
    PlacedTile placed{.tile = nullptr,
                      .x0 = static_cast<double>(tile_x) * side,
                      .z0 = static_cast<double>(tile_z) * side,
                      .step = side / kTileCells};
    if (i < 0 || j < 0 || i >= level.width || j >= level.length) {
        return placed;
    }
    Slot& slot = level.slots[static_cast<std::size_t>(j * level.width + i)];
    std::call_once(slot.once, [&] {
        const std::int64_t columns = std::int64_t{kTileCells} << lod;
        slot.tile = std::make_unique<const SceneTile>(make_scene_tile(
            *world_, generator, rivers,
            {.x = origin_.x + tile_x * columns, .z = origin_.z + tile_z * columns}, lod));
    });
    placed.tile = slot.tile.get();
    return placed;
}

SceneReader::SceneReader(const Scene& scene)
    : scene_(&scene), generator_(scene.world()), rivers_(scene.world()) {}

const PlacedTile& SceneReader::tile_at(double x, double z) {
    const double side = last_.step * kTileCells;
    if (last_.tile == nullptr || x < last_.x0 || z < last_.z0 || x >= last_.x0 + side ||
        z >= last_.z0 + side) {
        last_ = scene_->tile_at(x, z, generator_, rivers_);
    }
    return last_;
}

double SceneReader::density_at(glm::dvec3 point) {
    const PlacedTile& placed = tile_at(point.x, point.z);
    return placed.tile == nullptr ? -1 : terrane::density_at(*placed.tile, placed.local(point));
}

double SceneReader::top_at(double x, double z) {
    if (const auto& box = scene_->box();
        box && (x < box->x0 || x > box->x1 || z < box->z0 || z > box->z1)) {
        return static_cast<double>(kNoHeight);
    }
    const PlacedTile& placed = tile_at(x, z);
    return placed.tile == nullptr ? static_cast<double>(kNoHeight)
                                  : terrane::top_at(*placed.tile, placed.local({x, 0, z}));
}

LinearColor SceneReader::color_near(glm::dvec3 point) {
    const PlacedTile& placed = tile_at(point.x, point.z);
    return placed.tile == nullptr ? LinearColor{}
                                  : terrane::color_near(*placed.tile, placed.local(point));
}

}  // namespace terrane
