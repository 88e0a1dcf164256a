#include "server/render/scene_tile.h"

#include "generator/volume/color.h"
#include "generator/volume/voxel.h"

#include <algorithm>
#include <cmath>
#include <span>

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

void fill_highest(SceneTile& tile) {
    for (std::int32_t v = 0; v < kTileCells; v += kBlockCells) {
        for (std::int32_t u = 0; u < kTileCells; u += kBlockCells) {
            float highest = kNoHeight;
            for (std::int32_t i = 0; i <= kBlockCells; ++i) {
                for (std::int32_t j = 0; j <= kBlockCells; ++j) {
                    highest = std::max(highest, tile.covers[SceneTile::index_of(u + j, v + i)]);
                }
            }
            tile.block_highest[static_cast<std::size_t>(v / kBlockCells * kBlocksPerSide +
                                                        u / kBlockCells)] = highest;
            tile.highest = std::max(tile.highest, highest);
        }
    }
}

}  // namespace

SceneTile make_scene_tile(const World& world, StackGenerator& generator, ColumnPos first,
                          std::int32_t lod) {
    constexpr std::size_t kColumns = std::size_t{kTileCells + 1} * (kTileCells + 1);
    SceneTile tile;
    tile.lod = lod;
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
        return tile;
    }
    tile.colors = palette_colors(tile.set.palette, world.definition.materials);
    for (std::int32_t v = 0; v <= kTileCells; ++v) {
        for (std::int32_t u = 0; u <= kTileCells; ++u) {
            const std::size_t i = SceneTile::index_of(u, v);
            const std::span<const Limit> limits = tile.set.columns.column(u, v);
            tile.cave_begin.push_back(static_cast<std::uint32_t>(tile.caves.size()));
            const auto [cover, top] = add_caves(tile, limits);
            tile.covers[i] = cover;
            tile.tops[i] = top;
            const float under = std::max(0.0F, tile.tops[i] - 0.02F) * kUnitsPerVoxel;
            tile.top_colors[i] = color_at(limits, tile.colors, static_cast<std::int64_t>(under));
        }
    }
    tile.cave_begin.push_back(static_cast<std::uint32_t>(tile.caves.size()));
    fill_highest(tile);
    if (lod > 0) {
        tile.set = {};
        tile.covers = tile.tops;
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

LinearColor color_near(const SceneTile& tile, TilePoint point) {
    const CellWeights cell = weights_at(point);
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
