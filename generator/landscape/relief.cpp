#include "generator/landscape/relief.h"

#include "generator/landscape/numbers.h"
#include "generator/landscape/river_graph.h"
#include "generator/terrain/kernels/landscape_kernels.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/kernels/vector_pad.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/random.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {
namespace {

constexpr std::size_t kTilesTogether = 2;
constexpr std::size_t kValues = 6;  ///< of a lattice point: g, hr, pf, vm, and how it is moved

/// So many lattice points each way are weighed together, as far as there are so many.
struct TileSides {
    std::size_t x = 4;
    std::size_t z = 4;
};

/// The sides that need the fewest tiles; a tile has at most kVectorPad points.
TileSides tile_sides(std::size_t lines_x, std::size_t lines_z) {
    constexpr std::array<TileSides, 3> kShapes = {
        {{.x = 4, .z = 4}, {.x = 5, .z = 3}, {.x = 3, .z = 5}}};
    const auto tiles = [&](const TileSides& sides) {
        return ((lines_x + sides.x - 1) / sides.x) * ((lines_z + sides.z - 1) / sides.z);
    };
    TileSides best = kShapes[0];
    for (const TileSides& sides : kShapes) {
        best = tiles(sides) < tiles(best) ? sides : best;
    }
    return best;
}

/// Weights of the four lattice points around a place, and their slopes a column.
struct Taps {
    std::array<float, 4> weight{};
    std::array<float, 4> slope{};
};

/// The uniform cubic B-spline `eighths` of a step behind the second point.
Taps taps_at(std::int64_t eighths) {
    constexpr float kSixth = 1.0F / 6.0F;
    constexpr float kPerColumn = 0.5F / static_cast<float>(kLatticeStep);
    const float t = static_cast<float>(eighths) / static_cast<float>(kLatticeStep);
    const float s = 1.0F - t;
    return {.weight = {s * s * s * kSixth, (3.0F * t * t * t - 6.0F * t * t + 4.0F) * kSixth,
                       (3.0F * s * s * s - 6.0F * s * s + 4.0F) * kSixth, t * t * t * kSixth},
            .slope = {-s * s * kPerColumn, (3.0F * t * t - 4.0F * t) * kPerColumn,
                      (4.0F * s - 3.0F * s * s) * kPerColumn, t * t * kPerColumn}};
}

using AllTaps = std::array<Taps, kLatticeStep>;

static_assert(kSplineCell == kLatticeStep);

/// Shares of values, then of their slopes.
std::array<SplineShares, 2> shares_of(const AllTaps& taps) {
    std::array<SplineShares, 2> shares;
    for (std::size_t p = 0; p < 4; ++p) {
        for (std::size_t e = 0; e < kLatticeStep; ++e) {
            shares[0].of[p][e] = taps[e].weight[p];
            shares[1].of[p][e] = taps[e].slope[p];
        }
    }
    return shares;
}

/// A row of columns next to each other, from the values of its lattice columns: cell by cell, in
/// which the four points are the same. A last cell that is cut runs over into columns that come
/// later.
void mix_columns(float* out, const float* values, const SplineShares& shares,
                 std::int32_t first_eighth, std::int32_t width, const RowKernels& kernels) {
    std::int32_t column = 0;
    if (first_eighth > 0) {
        std::array<float, kSplineCell> cell;
        kernels.landscape->mix_cells(cell.data(), values++, shares, 1);
        column = kSplineCell - first_eighth;
        std::copy(cell.begin() + first_eighth, cell.end(), out);
    }
    if (column < width) {
        kernels.landscape->mix_cells(out + column, values, shares,
                                     (width - column + kSplineCell - 1) / kSplineCell);
    }
}

/// A place moved by the noise that makes rivers wind.
struct MovedPlace {
    std::int64_t x = 0;
    std::int64_t z = 0;
    float x_rest = 0;  ///< 0..1
    float z_rest = 0;
};

MovedPlace moved(std::int64_t x, std::int64_t z, float by_x, float by_z) {
    const float whole_x = std::floor(by_x);
    const float whole_z = std::floor(by_z);
    return {.x = x + static_cast<std::int64_t>(whole_x),
            .z = z + static_cast<std::int64_t>(whole_z),
            .x_rest = by_x - whole_x,
            .z_rest = by_z - whole_z};
}

/// What lies between two intervals.
float gap(float low, float high, float other_low, float other_high) {
    return std::max(0.0F, std::max(low - other_high, other_low - high));
}

/// Rivers farther away than this count for nothing; columns.
float reach_of(const ReliefConstants& constants) {
    return 1.1F * constants.valley;
}

float mountain_of(float noise) {
    return 0.1F + 0.9F * smooth_step(-0.2F, 0.3F, noise);
}

}  // namespace

/// The lattice lines that the columns of one axis need, and where each column finds its own.
struct ReliefBuilder::Axis {
    std::vector<std::int64_t> lines;   ///< columns of the lattice's lines, ascending
    std::vector<std::int32_t> first;   ///< per column: entry of its first point
    std::vector<std::uint8_t> eighth;  ///< per column: how far behind its second point
    std::size_t points = 4;            ///< of which a column's value is made: 1, 3 or 4

    std::size_t stride() const {
        return static_cast<std::size_t>(padded_width(static_cast<std::int32_t>(lines.size())));
    }

    Axis(std::int64_t start, std::int32_t count, std::int64_t step, bool is_smooth) {
        if (!is_smooth) {
            points = 1;
            for (std::int32_t i = 0; i < count; ++i) {
                lines.push_back(floor_div(start + i * step, kLatticeStep) * kLatticeStep);
            }
            return;
        }
        // Right on a line the fourth point weighs nothing.
        points = start % kLatticeStep == 0 && step % kLatticeStep == 0 ? 3 : 4;
        std::int64_t newest = 0;
        for (std::int32_t i = 0; i < count; ++i) {
            const std::int64_t at = start + i * step;
            const std::int64_t line = floor_div(at, kLatticeStep);
            eighth.push_back(static_cast<std::uint8_t>(at - line * kLatticeStep));
            const std::int64_t last = line + static_cast<std::int64_t>(points) - 2;
            if (i == 0) {
                newest = line - 2;
            }
            for (std::int64_t one = std::max(newest + 1, line - 1); one <= last; ++one) {
                lines.push_back(one * kLatticeStep);
                newest = one;
            }
            first.push_back(static_cast<std::int32_t>(static_cast<std::int64_t>(lines.size()) - 1 -
                                                      (newest - (line - 1))));
        }
    }
};

ReliefConstants::ReliefConstants(const WorldDefinition& definition)
    : rivers(definition),
      height(static_cast<float>(definition.relief.height)),
      valley(static_cast<float>(rivers.cell_x)),
      plateau(static_cast<float>(definition.relief.plateau)),
      mountains(Noise::make(key(definition.seed, LandscapeTag::mountains),
                            definition.relief.province, 2)) {}

void ReliefBuilder::find_rivers(const ReliefConstants& relief, const RectangleShape& shape) {
    const RiverConstants& constants = relief.rivers;
    if (shape.step > constants.cell_x) {
        return;  // nobody asks for them
    }
    const auto wander = static_cast<std::int64_t>(constants.wander) + 1;
    const std::int64_t margin = wander + 2 * kLatticeStep;
    const std::int64_t x1 = shape.x0 + (shape.width - 1) * shape.step;
    const std::int64_t z1 = shape.z0 + (shape.length - 1) * shape.step;
    const std::int64_t j0 = constants.row_of(shape.z0 - margin) - kRiverReachCells;
    const std::int64_t j1 = constants.row_of(z1 + margin) + kRiverReachCells;
    // Even rows begin earliest and odd ones latest.
    const std::int64_t i0 = constants.cell_of(shape.x0 - margin, 1) - kRiverReachCells;
    const std::int64_t i1 = constants.cell_of(x1 + margin, 0) + kRiverReachCells;
    rivers_.build(constants, {.first_i = i0, .last_i = i1, .first_j = j0, .last_j = j1});
}

/// Up to kTilesTogether x kTilesTogether tiles, and where their points are moved to.
struct ReliefBuilder::Tiles {
    struct Tile {
        ValleyPlaces places;
        std::array<MovedPlace, kVectorPad> moved_to;
        std::array<std::size_t, kVectorPad> at;
    };

    std::array<Tile, kTilesTogether * kTilesTogether> tiles;
    std::size_t count = 0;
    std::int64_t origin_x = 0;  ///< of their places
    std::int64_t origin_z = 0;
    std::int64_t x_min = INT64_MAX;  ///< of all places
    std::int64_t x_max = INT64_MIN;
    std::int64_t z_min = INT64_MAX;
    std::int64_t z_max = INT64_MIN;

    void add(Tile& tile, std::size_t n, const MovedPlace& place) {
        tile.moved_to[n] = place;
        tile.places.x[n] = static_cast<float>(place.x - origin_x);
        tile.places.z[n] = static_cast<float>(place.z - origin_z);
        tile.places.x_rest[n] = place.x_rest;
        tile.places.z_rest[n] = place.z_rest;
        x_min = std::min(x_min, place.x);
        x_max = std::max(x_max, place.x + 1);
        z_min = std::min(z_min, place.z);
        z_max = std::max(z_max, place.z + 1);
    }
};

ReliefBuilder::Tiles ReliefBuilder::place_tiles(const Axis& x, const Axis& z,
                                                const LatticeTile& first) const {
    const std::size_t stride = x.stride();
    const std::size_t plane = stride * z.lines.size() + kVectorPad;
    const float* const wander_x = lattice_.data() + 4 * plane;
    const float* const wander_z = wander_x + plane;
    Tiles tiles;
    tiles.origin_x = x.lines[first.first_x];
    tiles.origin_z = z.lines[first.first_z];
    for (std::size_t t = 0; t < tiles.tiles.size(); ++t) {
        const std::size_t tile_x = first.first_x + t % kTilesTogether * first.width;
        const std::size_t tile_z = first.first_z + t / kTilesTogether * first.length;
        if (tile_x >= x.lines.size() || tile_z >= z.lines.size()) {
            continue;
        }
        Tiles::Tile& tile = tiles.tiles[tiles.count++];
        for (std::size_t n = 0; n < kVectorPad; ++n) {
            // Beyond the tile's or the lattice's end, the last points once more.
            const std::size_t row = std::min(n / first.width, first.length - 1);
            const std::size_t line_x = std::min(tile_x + n % first.width, x.lines.size() - 1);
            const std::size_t line_z = std::min(tile_z + row, z.lines.size() - 1);
            const std::size_t at = line_z * stride + line_x;
            tile.at[n] = at;
            tiles.add(tile, n, moved(x.lines[line_x], z.lines[line_z], wander_x[at], wander_z[at]));
        }
    }
    return tiles;
}

/// Reaches that come near some of the tiles' places.
void ReliefBuilder::find_near(const ReliefConstants& constants, const Tiles& tiles) {
    const RiverConstants& rivers = constants.rivers;
    const float slack =
        reach_of(constants) + 1.0F;  // far above rounding errors: what is left out weighs 0
    const Reach& reference = rivers_.reaches().front();
    near_.clear();
    rivers_.for_each_meeting(
        {.first_i = rivers.cell_of(tiles.x_min, 1) - kRiverReachCells,
         .last_i = rivers.cell_of(tiles.x_max, 0) + kRiverReachCells,
         .first_j = rivers.row_of(tiles.z_min) - kRiverReachCells,
         .last_j = rivers.row_of(tiles.z_max) + kRiverReachCells},
        {.x_min = static_cast<float>(tiles.x_min - reference.x) - slack,
         .x_max = static_cast<float>(tiles.x_max - reference.x) + slack,
         .z_min = static_cast<float>(tiles.z_min - reference.z) - slack,
         .z_max = static_cast<float>(tiles.z_max - reference.z) + slack},
        [&](const Reach& one) {
            const auto x_of = static_cast<float>(one.x - tiles.origin_x);
            const auto z_of = static_cast<float>(one.z - tiles.origin_z);
            const float gap_x = gap(x_of + one.x_min, x_of + one.x_max,
                                    static_cast<float>(tiles.x_min - tiles.origin_x),
                                    static_cast<float>(tiles.x_max - tiles.origin_x));
            const float gap_z = gap(z_of + one.z_min, z_of + one.z_max,
                                    static_cast<float>(tiles.z_min - tiles.origin_z),
                                    static_cast<float>(tiles.z_max - tiles.origin_z));
            if (gap_x * gap_x + gap_z * gap_z < slack * slack) {
                ReachShape& shape = near_.emplace_back(shape_of_reach(one));
                shape.x = x_of;
                shape.z = z_of;
            }
        });
}

/// Near reaches are looked for once for all tiles.
void ReliefBuilder::fill_tiles(const ReliefConstants& constants, const Axis& x, const Axis& z,
                               const LatticeTile& first, const RowKernels& kernels) {
    const std::size_t plane = x.stride() * z.lines.size() + kVectorPad;
    Tiles tiles = place_tiles(x, z, first);
    find_near(constants, tiles);
    const float reach = reach_of(constants);
    for (std::size_t t = 0; t < tiles.count; ++t) {
        Tiles::Tile& tile = tiles.tiles[t];
        kernels.landscape->valleys(tile.places, near_.data(),
                                   static_cast<std::int32_t>(near_.size()),
                                   {.inverse_reach_square = 1.0F / (reach * reach),
                                    .e2 = 0.0025F * constants.valley * constants.valley,
                                    .half_valley = 0.5F * constants.valley,
                                    .plateau = constants.plateau});
        for (std::size_t n = 0; n < kVectorPad; ++n) {
            float* const value = lattice_.data() + tile.at[n];
            value[plane] = tile.places.weight[n] > 0 ? tile.places.river[n]
                                                     : constants.rivers.potential_at(
                                                           tile.moved_to[n].x, tile.moved_to[n].z);
            value[2 * plane] = tile.places.crest[n];
        }
    }
}

void ReliefBuilder::fill_lattice(const ReliefConstants& constants, const Axis& x, const Axis& z,
                                 const RowKernels& kernels, NoiseBuffers& buffers) {
    const std::size_t plane = x.stride() * z.lines.size() + kVectorPad;
    lattice_.resize(std::max(lattice_.size(), plane * kValues));
    float* const ground = lattice_.data();
    float* const river = ground + plane;
    float* const crest = river + plane;
    float* const mountain = crest + plane;
    noise_grid(mountain, constants.mountains, x.lines, z.lines, kernels, buffers);
    noise_grid(mountain + plane, constants.rivers.wander_x, x.lines, z.lines, kernels, buffers);
    noise_grid(mountain + 2 * plane, constants.rivers.wander_z, x.lines, z.lines, kernels, buffers);
    for (float* value = mountain + plane; value < mountain + 3 * plane; ++value) {
        *value *= constants.rivers.wander;
    }
    const TileSides sides = tile_sides(x.lines.size(), z.lines.size());
    for (std::size_t line_z = 0; line_z < z.lines.size(); line_z += kTilesTogether * sides.z) {
        for (std::size_t line_x = 0; line_x < x.lines.size(); line_x += kTilesTogether * sides.x) {
            fill_tiles(constants, x, z,
                       {.first_x = line_x, .first_z = line_z, .width = sides.x, .length = sides.z},
                       kernels);
        }
    }
    for (std::size_t line_z = 0; line_z < z.lines.size(); ++line_z) {
        for (std::size_t i = line_z * x.stride(); i < line_z * x.stride() + x.lines.size(); ++i) {
            mountain[i] = mountain_of(mountain[i]);
            ground[i] = river[i] + constants.height * mountain[i] * crest[i];
        }
    }
}

/// Half way between a river and a crest, without their shapes.
void ReliefBuilder::build_far(ReliefRasters& out, const ReliefConstants& constants,
                              const RectangleShape& shape, const RowKernels& kernels,
                              NoiseBuffers& buffers) {
    constexpr float kMeanCrest = 0.5F;
    noise_rectangle(out.mountain.data(), constants.mountains, shape, kernels, buffers);
    noise_rectangle(out.river.data(), constants.rivers.potential, shape, kernels, buffers);
    for (std::size_t i = 0; i < shape.padded_size(); ++i) {
        out.mountain[i] = mountain_of(out.mountain[i]);
        out.river[i] = constants.rivers.ground + 1.6F * constants.rivers.fall * out.river[i];
        out.crest[i] = kMeanCrest;
        out.ground[i] = out.river[i] + constants.height * out.mountain[i] * kMeanCrest;
    }
}

/// Lattice and columns are one, row by row of the same stride.
void ReliefBuilder::take_points(ReliefRasters& out, std::size_t plane, std::size_t size) const {
    const std::array<std::vector<float>*, kValues> to = {
        &out.ground, &out.river, &out.crest, &out.mountain, &out.wander_x, &out.wander_z};
    for (std::size_t v = 0; v < kValues; ++v) {
        std::copy_n(lattice_.data() + v * plane, size, to[v]->begin());
    }
}

/// Mixes the lattice along z for a row of columns: seven values a lattice column, g's slope along z
/// too.
void ReliefBuilder::mix_lattice_row(const Axis& x, const Axis& z, std::int32_t row) {
    const std::size_t lines = x.stride();
    const std::size_t plane = lines * z.lines.size() + kVectorPad;
    const Taps along_z = taps_at(z.eighth[static_cast<std::size_t>(row)]);
    const auto line_z = static_cast<std::size_t>(z.first[static_cast<std::size_t>(row)]);
    for (std::size_t v = 0; v <= kValues; ++v) {
        const float* const value = lattice_.data() + v % kValues * plane + line_z * lines;
        const std::array<float, 4>& weight = v < kValues ? along_z.weight : along_z.slope;
        float* const sum = mixed_.data() + v * lines;
        if (z.points == 4) {
            for (std::size_t line = 0; line < lines; ++line) {
                sum[line] = weight[0] * value[line] + weight[1] * value[lines + line] +
                            weight[2] * value[2 * lines + line] +
                            weight[3] * value[3 * lines + line];
            }
        } else {
            for (std::size_t line = 0; line < lines; ++line) {
                sum[line] = weight[0] * value[line] + weight[1] * value[lines + line] +
                            weight[2] * value[2 * lines + line];
            }
        }
    }
}

/// The B-spline, rows of the lattice first.
void ReliefBuilder::smooth(ReliefRasters& out, const Axis& x, const Axis& z,
                           const RectangleShape& shape, const RowKernels& kernels) {
    AllTaps taps;
    for (std::int64_t eighth = 0; eighth < kLatticeStep; ++eighth) {
        taps[static_cast<std::size_t>(eighth)] = taps_at(eighth);
    }
    const std::array<SplineShares, 2> shares = shares_of(taps);
    const std::size_t lines = x.stride();
    mixed_.resize(std::max(mixed_.size(), lines * (kValues + 1)));
    for (std::int32_t row = 0; row < shape.length; ++row) {
        mix_lattice_row(x, z, row);
        const std::size_t first = shape.index(0, row);
        const std::array<float*, kValues + 1> to = {
            out.ground.data() + first,   out.river.data() + first,    out.crest.data() + first,
            out.mountain.data() + first, out.wander_x.data() + first, out.wander_z.data() + first,
            out.slope_z.data() + first};
        if (shape.step == 1) {
            const std::int32_t eighth = x.eighth.front();
            for (std::size_t v = 0; v <= kValues; ++v) {
                mix_columns(to[v], mixed_.data() + v * lines, shares[0], eighth, shape.width,
                            kernels);
            }
            mix_columns(out.slope_x.data() + first, mixed_.data(), shares[1], eighth, shape.width,
                        kernels);
            continue;
        }
        for (std::int32_t column = 0; column < shape.width; ++column) {
            const Taps& along_x = taps[x.eighth[static_cast<std::size_t>(column)]];
            const float* value =
                mixed_.data() + static_cast<std::size_t>(x.first[static_cast<std::size_t>(column)]);
            std::array<float, kValues + 2> sum{};
            for (std::size_t p = 0; p < x.points; ++p, ++value) {
                for (std::size_t v = 0; v <= kValues; ++v) {
                    sum[v] += along_x.weight[p] * value[v * lines];
                }
                sum[kValues + 1] += along_x.slope[p] * value[0];
            }
            for (std::size_t v = 0; v <= kValues; ++v) {
                to[v][column] = sum[v];
            }
            out.slope_x[first + static_cast<std::size_t>(column)] = sum[kValues + 1];
        }
    }
}

void ReliefBuilder::build(ReliefRasters& out, const ReliefConstants& constants,
                          const RectangleShape& shape, const RowKernels& kernels,
                          NoiseBuffers& buffers) {
    const std::size_t size = shape.padded_size();
    for (std::vector<float>* raster : {&out.ground, &out.river, &out.crest, &out.mountain,
                                       &out.slope_x, &out.slope_z, &out.wander_x, &out.wander_z}) {
        raster->resize(size);
    }
    const bool is_far = shape.step > constants.rivers.cell_x;
    out.is_smooth = !is_far && is_smooth_step(constants, shape.step);
    if (!out.is_smooth) {
        std::fill(out.slope_x.begin(), out.slope_x.end(), 0.0F);
        std::fill(out.slope_z.begin(), out.slope_z.end(), 0.0F);
    }
    if (is_far) {
        build_far(out, constants, shape, kernels, buffers);
        return;
    }
    const Axis x(shape.x0, shape.width, shape.step, out.is_smooth);
    const Axis z(shape.z0, shape.length, shape.step, out.is_smooth);
    fill_lattice(constants, x, z, kernels, buffers);
    if (out.is_smooth) {
        smooth(out, x, z, shape, kernels);
    } else {
        take_points(out, x.stride() * z.lines.size() + kVectorPad, size);
    }
}

}  // namespace terrane
