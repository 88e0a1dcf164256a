// Everything a picture can show: tiles of columns around the eye, each made when a ray first needs
// it, coarser with distance as in a quadtree. Places are in voxels from the centre of the scene's
// origin, a column next to the eye, so that pictures far out are as sharp as at (0, 0).
#pragma once

#include "generator/landscape/river_map.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "protocol/base/coords.h"
#include "server/render/scene_tile.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

namespace terrane {

/// Columns x_first <= x < x_end, likewise z: a block cut out of the terrain.
struct ColumnBlock {
    std::int64_t x_first = 0;
    std::int64_t z_first = 0;
    std::int64_t x_end = 0;
    std::int64_t z_end = 0;
};

inline constexpr std::int64_t kBlockSideMax = 1024;  ///< columns
inline constexpr double kSightMax = 24576;           ///< voxels: nothing is drawn beyond

/// The sides of a ColumnBlock in the scene: half a voxel around its outermost columns.
struct SceneBox {
    double x0 = 0;
    double z0 = 0;
    double x1 = 0;
    double z1 = 0;
};

/// A tile and where it lies.
struct PlacedTile {
    const SceneTile* tile = nullptr;  ///< null where nothing is drawn
    double x0 = 0;                    ///< of the tile's column (0, 0)
    double z0 = 0;
    double step = 1;  ///< voxels a cell

    TilePoint local(glm::dvec3 point) const {
        return {.u = (point.x - x0) / step, .v = (point.z - z0) / step, .y = point.y};
    }
};

/// Shared by all threads that draw a picture; `world` must outlive it.
class Scene {
  public:
    /// With a block, nothing else is drawn and all of it is level 0.
    Scene(const World& world, ColumnPos origin, std::optional<ColumnBlock> block);

    /// The tile over a point, by the caller's generator and rivers if it is not there yet. Any
    /// thread.
    PlacedTile tile_at(double x, double z, StackGenerator& generator, RiverMap& rivers) const;

    const World& world() const { return *world_; }

    ColumnPos origin() const { return origin_; }

    const std::optional<SceneBox>& box() const { return box_; }

    double height_bound() const { return height_bound_; }

    /// Of the world's water; black if it has none.
    LinearColor water_color() const { return water_color_; }

  private:
    struct Slot {
        std::once_flag once;
        std::unique_ptr<const SceneTile> tile;
    };

    /// A level's tiles around the origin.
    struct Level {
        std::int64_t x_first = 0;
        std::int64_t z_first = 0;
        std::int64_t width = 0;
        std::int64_t length = 0;
        std::unique_ptr<Slot[]> slots;
    };

    void add_level(std::int64_t x_first, std::int64_t z_first, std::int64_t width,
                   std::int64_t length);

    const World* world_;
    ColumnPos origin_;
    std::optional<SceneBox> box_;
    double height_bound_;
    LinearColor water_color_;
    std::vector<Level> levels_;
};

/// One thread's eyes on a scene.
class SceneReader {
  public:
    explicit SceneReader(const Scene& scene);

    const Scene& scene() const { return *scene_; }

    const PlacedTile& tile_at(double x, double z);
    /// As of scene_tile.h; void beyond sight. Rays see to it that nothing outside a block is drawn.
    double density_at(glm::dvec3 point);
    /// kNoHeight where nothing is drawn: outside the block, beyond sight.
    double top_at(double x, double z);
    LinearColor color_near(glm::dvec3 point);

  private:
    const Scene* scene_;
    StackGenerator generator_;
    RiverMap rivers_;
    PlacedTile last_;
};

}  // namespace terrane
