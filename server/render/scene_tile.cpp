#include "server/render/scene_tile.h"

#include "generator/landscape/river_map.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/world.h"
#include "generator/volume/color.h"
#include "generator/volume/limit.h"
#include "generator/volume/voxel.h"
#include "generator/volume/water.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {
namespace {

// Rock over a cave that is thinner than this, in voxels, is not drawn: where nothing covers a cave,
// cover and lid are equal but for rounding.
constexpr double kThinnest = 0.1;

/// The cell of a point and how much its four columns weigh there.
struct CellWeights {
    std::array<std::size_t, 4> column{};
    std::array<double, 4> weight{};
};

CellWeights weights_at(TilePoint point) {
    const std::int32_t u = std::clamp(static_cast<std::int32_t>(point.u), 0, kTileCells - 1);
    const std::int32_t v = std::clamp(static_cast<std::int32_t>(point.v), 0, kTileCells - 1);
    const double a = std::clamp(point.u - u, 0.0, 1.0);
    const double b = std::clamp(point.v - v, 0.0, 1.0);
    return {.column = {SceneTile::index_of(u, v), SceneTile::index_of(u + 1, v),
                       SceneTile::index_of(u, v + 1), SceneTile::index_of(u + 1, v + 1)},
            .weight = {(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b}};
}

double mix_of(const CellWeights& cell, const std::vector<float>& values) {
    double sum = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        sum += cell.weight[i] * static_cast<double>(values[cell.column[i]]);
    }
    return sum;
}

std::span<const CaveInterval> caves_of(const SceneTile& tile, std::size_t column) {
    return std::span(tile.caves)
        .subspan(tile.cave_begin[column], tile.cave_begin[column + 1] - tile.cave_begin[column]);
}

const CaveInterval* find_cave(std::span<const CaveInterval> caves, std::uint16_t palette_id) {
    const auto found = std::ranges::find(caves, palette_id, &CaveInterval::palette_id);
    return found == caves.end() ? nullptr : &*found;
}

/// Where a cave closes in a column that does not have it, seen from a column that has: at the cave
/// that it touches if that one goes on, so that no rock is left between the two.
float closing_height(const CaveInterval& cave, std::span<const CaveInterval> having,
                     std::span<const CaveInterval> lacking) {
    for (const CaveInterval& other : having) {
        const bool under = other.lid == cave.floor;
        if (!under && other.floor != cave.lid) {
            continue;
        }
        if (const CaveInterval* there = find_cave(lacking, other.palette_id)) {
            return under ? there->lid : there->floor;
        }
    }
    return cave.floor;
}

/// Vertical distance to one cave's surface, below 0 inside it.
double distance_to_cave(const SceneTile& tile, const CellWeights& cell, std::uint16_t palette_id,
                        double y) {
    std::array<const CaveInterval*, 4> corners{};
    for (std::size_t i = 0; i < 4; ++i) {
        corners[i] = find_cave(caves_of(tile, cell.column[i]), palette_id);
    }
    double floor = 0;
    double lid = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        float low = 0;
        float high = 0;
        if (corners[i] != nullptr) {
            low = corners[i]->floor;
            high = corners[i]->lid;
        } else {
            float having = 0;
            for (std::size_t j = 0; j < 4; ++j) {
                if (corners[j] != nullptr) {
                    low += closing_height(*corners[j], caves_of(tile, cell.column[j]),
                                          caves_of(tile, cell.column[i]));
                    having += 1;
                }
            }
            low /= having;
            high = low;
        }
        floor += cell.weight[i] * static_cast<double>(low);
        lid += cell.weight[i] * static_cast<double>(high);
    }
    return std::max(floor - y, y - (lid + kThinnest));
}

/// `y` moved out of the column's caves, into the nearest rock.
double solid_height(std::span<const CaveInterval> caves, double y) {
    constexpr double kSkin = 0.02;  // at the frontier itself the cave begins
    for (const CaveInterval& cave : caves) {
        const auto floor = static_cast<double>(cave.floor) - kSkin;
        const auto lid = static_cast<double>(cave.lid) + kSkin;
        if (y > floor && y < lid) {
            y = y - floor < lid - y ? floor : lid;
        }
    }
    return y;
}

/// Adds a column's caves to the tile, and gives its cover and its top.
std::array<float, 2> add_caves(SceneTile& tile, std::span<const Limit> limits) {
    float cover = 0;
    float top = 0;
    for (std::size_t i = 0; i + 1 < limits.size(); ++i) {
        const auto bottom_y = static_cast<float>(limits[i].y256) / kUnitsPerVoxel;
        const auto top_y = static_cast<float>(limits[i + 1].y256) / kUnitsPerVoxel;
        const PaletteEntry& content = tile.set.palette[limits[i].palette_id];
        if (top_y <= bottom_y || content.kind == PaletteKind::void_) {
            continue;
        }
        cover = top_y;
        if (content.is_solid()) {
            top = top_y;
        } else {
            tile.caves.push_back(
                {.palette_id = limits[i].palette_id, .floor = bottom_y, .lid = top_y});
        }
    }
    return {cover, top};
}

/// Adds a landscape column's ends and waters, and gives its cover and its top.
std::array<float, 2> add_ends(SceneTile& tile, std::span<const Limit> limits,
                              std::span<const Material> materials) {
    bool is_solid = true;
    float cover = 0;
    for (std::size_t i = 0; i < limits.size(); ++i) {
        const auto y = static_cast<float>(limits[i].y256) / kUnitsPerVoxel;
        const bool is_last = i + 1 == limits.size();
        if (!is_last && limits[i + 1].y256 <= limits[i].y256) {
            continue;
        }
        const PaletteEntry& content = tile.set.palette[limits[i].palette_id];
        const bool is_solid_above = !is_last && content.is_solid();
        if (is_solid_above != is_solid) {
            tile.ends.push_back(y);
            is_solid = is_solid_above;
        }
        if (!is_last) {
            const auto top = static_cast<float>(limits[i + 1].y256) / kUnitsPerVoxel;
            const bool wet = is_water(content, materials);
            cover = is_solid_above || wet ? top : cover;
            if (wet) {
                tile.waters.push_back({.bed = y, .surface = top});
            }
        }
    }
    return {cover, tile.ends.empty() ? cover : tile.ends.back()};
}

std::span<const float> ends_of(const SceneTile& tile, std::size_t column) {
    return std::span(tile.ends).subspan(tile.end_begin[column],
                                        tile.end_begin[column + 1] - tile.end_begin[column]);
}

std::span<const WaterInterval> waters_of(const SceneTile& tile, std::size_t column) {
    return std::span(tile.waters)
        .subspan(tile.water_begin[column], tile.water_begin[column + 1] - tile.water_begin[column]);
}

/// Height above (below 0: depth under) the nearest end, above 0 in the solid.
double depth_in(std::span<const float> ends, double y) {
    double distance = 1e9;
    bool is_solid = true;
    for (const float end : ends) {
        distance = std::min(distance, std::abs(y - static_cast<double>(end)));
        is_solid = static_cast<double>(end) > y ? is_solid : !is_solid;
    }
    return ends.empty() ? -distance : is_solid ? distance : -distance;
}

/// Steeper than so many voxels a column is a wall, and its top no longer matters.
constexpr double kWallVoxels = 6;

double landscape_density(const SceneTile& tile, const CellWeights& cell, double y) {
    double density = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        density += cell.weight[i] * std::clamp(depth_in(ends_of(tile, cell.column[i]), y),
                                               -kWallVoxels, kWallVoxels);
    }
    return density;
}

LinearColor landscape_color(const SceneTile& tile, const CellWeights& cell, double y) {
    // Below a gentle slope strata follow it; on a wall each column shows what it has at the height.
    constexpr double kGentle = 4;
    double highest = -1e9;
    double lowest = 1e9;
    for (const std::size_t column : cell.column) {
        highest = std::max(highest, static_cast<double>(tile.tops[column]));
        lowest = std::min(lowest, static_cast<double>(tile.tops[column]));
    }
    const double depth = mix_of(cell, tile.tops) - y;
    const bool follows = highest - lowest < kGentle && depth < kGentle;
    LinearColor color;
    float total = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        const std::size_t column = cell.column[i];
        const auto top = static_cast<double>(tile.tops[column]);
        double at = follows ? top - std::max(0.0, depth) - 0.02 : std::min(y, top - 0.02);
        auto weight = static_cast<float>(cell.weight[i]) + 1e-6F;
        LinearColor one = tile.top_colors[column];
        if (tile.lod == 0) {
            const auto ends = ends_of(tile, column);
            const double in = depth_in(ends, at);
            if (in < 0) {  // out of a hollow, into the rock next to it
                double nearest = 1e9;
                double moved = at;
                for (std::size_t e = 0; e < ends.size(); ++e) {
                    const auto end = static_cast<double>(ends[e]);
                    if (std::abs(end - at) < nearest) {
                        nearest = std::abs(end - at);
                        moved = end + (e % 2 == 0 ? -0.02 : 0.02);
                    }
                }
                at = moved;
                weight *= 0.2F;
            }
            const std::span<const Limit> limits =
                std::span(tile.set.columns.limits)
                    .subspan(
                        tile.set.columns.offsets[column],
                        tile.set.columns.offsets[column + 1] - tile.set.columns.offsets[column]);
            one =
                color_at(limits, tile.colors,
                         static_cast<std::int64_t>(std::floor(std::max(0.0, at) * kUnitsPerVoxel)));
        }
        color.r += weight * one.r;
        color.g += weight * one.g;
        color.b += weight * one.b;
        total += weight;
    }
    return {.r = color.r / total, .g = color.g / total, .b = color.b / total};
}

void fill_highest(SceneTile& tile) {
    for (std::int32_t v = 0; v < kTileCells; v += kBlockCells) {
        for (std::int32_t u = 0; u < kTileCells; u += kBlockCells) {
            float highest = kNoHeight;
            for (std::int32_t i = 0; i <= kBlockCells; ++i) {
                for (std::int32_t j = 0; j <= kBlockCells; ++j) {
                    highest = std::max(highest, tile.covers[SceneTile::index_of(u + j, v + i)]);
                }
            }
            tile.block_highest[SceneTile::block_index(u / kBlockCells, v / kBlockCells)] = highest;
            tile.highest = std::max(tile.highest, highest);
        }
    }
}

/// Rivers narrower than a cell would be dashes: what is within half a cell of a river is coloured.
void color_rivers(SceneTile& tile, RiverMap& rivers, ColumnPos first) {
    // What water reflects and what it is, seen from far and aslant.
    constexpr LinearColor kFarWater = {.r = 0.12F, .g = 0.21F, .b = 0.30F};
    const std::int64_t step = std::int64_t{1} << tile.lod;
    const auto half = static_cast<float>(step) * 0.5F;
    const RectangleShape shape{.x0 = first.x,
                               .z0 = first.z,
                               .width = kTileCells + 1,
                               .length = kTileCells + 1,
                               .step = step};
    const std::span<const float> distances = rivers.distances(shape, half);
    const auto stride = static_cast<std::size_t>(shape.stride());
    for (std::int32_t v = 0; v <= kTileCells; ++v) {
        for (std::int32_t u = 0; u <= kTileCells; ++u) {
            const std::size_t i = SceneTile::index_of(u, v);
            if (distances[static_cast<std::size_t>(v) * stride + static_cast<std::size_t>(u)] <
                    half &&
                waters_of(tile, i).empty()) {
                tile.top_colors[i] = kFarWater;
            }
        }
    }
}

}  // namespace

SceneTile make_scene_tile(const World& world, StackGenerator& generator, RiverMap& rivers,
                          ColumnPos first, std::int32_t lod) {
    constexpr std::size_t kColumns = std::size_t{kTileCells + 1} * (kTileCells + 1);
    SceneTile tile;
    tile.lod = lod;
    tile.is_landscape = world.definition.has_landscape();
    tile.covers.assign(kColumns, kNoHeight);
    tile.tops.assign(kColumns, kNoHeight);
    tile.top_colors.assign(kColumns, {});
    const auto made = generator.generate(tile.set, {.x0 = first.x,
                                                    .z0 = first.z,
                                                    .width = kTileCells + 1,
                                                    .length = kTileCells + 1,
                                                    .lod = lod});
    if (!made) {
        tile.lod = 1;  // beyond the edge there is no inside either
        tile.block_highest.fill(kNoHeight);
        tile.end_begin.assign(kColumns + 1, 0);
        tile.water_begin.assign(kColumns + 1, 0);
        return tile;
    }
    tile.colors = palette_colors(tile.set.palette, world.definition.materials);
    for (std::int32_t v = 0; v <= kTileCells; ++v) {
        for (std::int32_t u = 0; u <= kTileCells; ++u) {
            const std::size_t i = SceneTile::index_of(u, v);
            const std::span<const Limit> limits = tile.set.columns.column(u, v);
            tile.cave_begin.push_back(static_cast<std::uint32_t>(tile.caves.size()));
            tile.end_begin.push_back(static_cast<std::uint32_t>(tile.ends.size()));
            tile.water_begin.push_back(static_cast<std::uint32_t>(tile.waters.size()));
            const auto [cover, top] = tile.is_landscape
                                          ? add_ends(tile, limits, world.definition.materials)
                                          : add_caves(tile, limits);
            tile.covers[i] = cover;
            tile.tops[i] = top;
            const float under = std::max(0.0F, tile.tops[i] - 0.02F) * kUnitsPerVoxel;
            tile.top_colors[i] = color_at(limits, tile.colors, static_cast<std::int64_t>(under));
        }
    }
    tile.cave_begin.push_back(static_cast<std::uint32_t>(tile.caves.size()));
    tile.end_begin.push_back(static_cast<std::uint32_t>(tile.ends.size()));
    tile.water_begin.push_back(static_cast<std::uint32_t>(tile.waters.size()));
    fill_highest(tile);
    if (lod > 0) {
        color_rivers(tile, rivers, first);
        tile.set = {};
        if (!tile.is_landscape) {  // water covers the ground at every level
            tile.covers = tile.tops;
        }
        tile.caves = {};
        tile.cave_begin = {};
    }
    return tile;
}

double top_at(const SceneTile& tile, TilePoint point) {
    return mix_of(weights_at(point), tile.tops);
}

double density_at(const SceneTile& tile, TilePoint point) {
    const CellWeights cell = weights_at(point);
    if (tile.is_landscape) {
        return tile.lod > 0 ? mix_of(cell, tile.tops) - point.y
                            : landscape_density(tile, cell, point.y);
    }
    double density = mix_of(cell, tile.covers) - point.y;
    if (tile.lod > 0) {
        return density;
    }
    for (std::size_t i = 0; i < 4; ++i) {
        for (const CaveInterval& cave : caves_of(tile, cell.column[i])) {
            density = std::min(density, distance_to_cave(tile, cell, cave.palette_id, point.y));
        }
    }
    return density;
}

std::size_t water_surfaces(std::array<WaterSurface, kWaterSurfacesMax>& out, const SceneTile& tile,
                           std::int32_t u, std::int32_t v) {
    constexpr float kSame = 1.5F;  // voxels
    if (tile.waters.empty()) {
        return 0;
    }
    const std::array<std::size_t, 4> columns = {
        SceneTile::index_of(u, v), SceneTile::index_of(u + 1, v), SceneTile::index_of(u, v + 1),
        SceneTile::index_of(u + 1, v + 1)};
    const auto find = [&](std::size_t column, float level) -> const WaterInterval* {
        for (const WaterInterval& water : waters_of(tile, column)) {
            if (std::abs(water.surface - level) <= kSame) {
                return &water;
            }
        }
        return nullptr;
    };
    std::size_t count = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        for (const WaterInterval& water : waters_of(tile, columns[i])) {
            bool is_known = false;
            for (std::size_t before = 0; before < i; ++before) {
                is_known = is_known || find(columns[before], water.surface) != nullptr;
            }
            if (is_known || count == kWaterSurfacesMax) {
                continue;
            }
            WaterSurface& surface = out[count++];
            for (std::size_t j = 0; j < 4; ++j) {
                const WaterInterval* const there = find(columns[j], water.surface);
                surface.heights[j] = water.surface;
                if (there != nullptr) {
                    surface.heights[j] = there->surface;
                    continue;
                }
                // Down to the ground, unless that is higher.
                const auto ends = ends_of(tile, columns[j]);
                for (std::size_t e = 0; e < ends.size() && ends[e] <= water.surface; e += 2) {
                    const bool is_open = e + 1 == ends.size() || ends[e + 1] > water.surface;
                    surface.heights[j] = is_open ? ends[e] - 0.05F : surface.heights[j];
                }
            }
        }
    }
    return count;
}

bool in_water(const SceneTile& tile, TilePoint point) {
    if (tile.waters.empty()) {
        return false;
    }
    const auto u = std::clamp(static_cast<std::int32_t>(std::floor(point.u + 0.5)), 0, kTileCells);
    const auto v = std::clamp(static_cast<std::int32_t>(std::floor(point.v + 0.5)), 0, kTileCells);
    for (const WaterInterval& water : waters_of(tile, SceneTile::index_of(u, v))) {
        if (point.y > static_cast<double>(water.bed) &&
            point.y < static_cast<double>(water.surface)) {
            return true;
        }
    }
    return false;
}

LinearColor color_near(const SceneTile& tile, TilePoint point) {
    const CellWeights cell = weights_at(point);
    if (tile.is_landscape) {
        return landscape_color(tile, cell, point.y);
    }
    // Columns are compared at equal depths, so that strata follow the slope they lie under.
    const double depth = mix_of(cell, tile.covers) - point.y;
    LinearColor color;
    for (std::size_t i = 0; i < 4; ++i) {
        const std::size_t column = cell.column[i];
        LinearColor one = tile.top_colors[column];
        const double y = static_cast<double>(tile.covers[column]) - depth;
        if (tile.lod == 0 && y < static_cast<double>(tile.tops[column]) - 0.02) {
            const std::span<const Limit> limits =
                std::span(tile.set.columns.limits)
                    .subspan(
                        tile.set.columns.offsets[column],
                        tile.set.columns.offsets[column + 1] - tile.set.columns.offsets[column]);
            const double solid = solid_height(caves_of(tile, column), y);
            one = color_at(
                limits, tile.colors,
                static_cast<std::int64_t>(std::floor(std::max(0.0, solid) * kUnitsPerVoxel)));
        }
        const auto weight = static_cast<float>(cell.weight[i]);
        color.r += weight * one.r;
        color.g += weight * one.g;
        color.b += weight * one.b;
    }
    return color;
}

}  // namespace terrane
