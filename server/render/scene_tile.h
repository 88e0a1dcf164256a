// A square of columns as rays see it: smooth surfaces through the columns' limits.
//
// Columns are samples of a solid: a top surface with caves under it. Between the centres of four
// columns the heights of the top and of each cave's floor and lid are interpolated, a cave that
// ends there closing to nothing, so that tops, floors, lids and walls are smooth and meet without
// steps. Tiles above level 0 know only their top surface.
#pragma once

#include "generator/landscape/river_map.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "generator/volume/limit.h"
#include "generator/world/composition.h"

#include <array>
#include <cstdint>
#include <vector>

namespace terrane {

inline constexpr std::int32_t kTileCells = 64;
inline constexpr std::int32_t kBlockCells = 8;  ///< cells of a block: skipped as one if below a ray
inline constexpr std::int32_t kBlocksPerSide = kTileCells / kBlockCells;
inline constexpr float kNoHeight = -1e9F;

/// A cave in one column; heights in voxels.
struct CaveInterval {
    std::uint16_t palette_id = 0;
    float floor = 0;
    float lid = 0;
};

/// Water in one column; heights in voxels.
struct WaterInterval {
    float bed = 0;
    float surface = 0;
};

/// A point of a tile, in cells from its column (0, 0): 0 <= u, v <= kTileCells. `y` in voxels.
struct TilePoint {
    double u = 0;
    double v = 0;
    double y = 0;
};

/// kTileCells cells a side between (kTileCells + 1)^2 columns; row by row, u runs fastest.
struct SceneTile {
    std::int32_t lod = 0;
    float highest = kNoHeight;
    std::array<float, std::size_t{kBlocksPerSide} * kBlocksPerSide> block_highest{};
    /// Each column's highest point that is not void: solid or, where nothing covers it, a cave's
    /// lid.
    std::vector<float> covers;
    std::vector<float> tops;  ///< each column's highest solid point
    std::vector<LinearColor> top_colors;
    /// Level 0 only: caves, bottom first, one column behind the other.
    std::vector<std::uint32_t> cave_begin;
    std::vector<CaveInterval> caves;
    ColumnSet set;
    std::vector<LinearColor> colors;  ///< of set.palette
    /// Worlds with a landscape: caves are many and of one kind, so columns are compared by where
    /// their solid begins and ends, bottom first (the ground's top, then pairs).
    bool is_landscape = false;
    std::vector<std::uint32_t> end_begin;
    std::vector<float> ends;
    std::vector<std::uint32_t> water_begin;
    std::vector<WaterInterval> waters;

    static constexpr std::size_t index_of(std::int32_t u, std::int32_t v) {
        return static_cast<std::size_t>(v) * (kTileCells + 1) + static_cast<std::size_t>(u);
    }

    /// Of block (u, v) in `block_highest`.
    static constexpr std::size_t block_index(std::int32_t u, std::int32_t v) {
        return static_cast<std::size_t>(v) * kBlocksPerSide + static_cast<std::size_t>(u);
    }
};

/// Makes the tile whose column (0, 0) is `first`. A tile beyond the world's edge is empty:
/// kNoHeight everywhere. Above level 0, the land within half a cell of a river has its colour.
SceneTile make_scene_tile(const World& world, StackGenerator& generator, RiverMap& rivers,
                          ColumnPos first, std::int32_t lod);

/// Above 0 inside the solid; the vertical distance to the nearest surface, in voxels.
double density_at(const SceneTile& tile, TilePoint point);

/// Where one cell's water surfaces lie; a surface slopes down to the ground of columns without it.
struct WaterSurface {
    std::array<float, 4> heights{};  ///< of the cell's columns (0, 0), (1, 0), (0, 1), (1, 1)

    double at(double a, double b) const {
        return (1 - b) * ((1 - a) * static_cast<double>(heights[0]) +
                          a * static_cast<double>(heights[1])) +
               b * ((1 - a) * static_cast<double>(heights[2]) +
                    a * static_cast<double>(heights[3]));
    }
};

inline constexpr std::size_t kWaterSurfacesMax = 4;

/// The surfaces over cell (u, v); at most kWaterSurfacesMax are looked at.
std::size_t water_surfaces(std::array<WaterSurface, kWaterSurfacesMax>& out, const SceneTile& tile,
                           std::int32_t u, std::int32_t v);

/// Whether the point is in the water of the column next to it.
bool in_water(const SceneTile& tile, TilePoint point);

/// Height of the highest solid point; `y` is ignored.
double top_at(const SceneTile& tile, TilePoint point);

/// Colour of the solid at or next to the point.
LinearColor color_near(const SceneTile& tile, TilePoint point);

}  // namespace terrane
