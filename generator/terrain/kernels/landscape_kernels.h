// What kernels of landscapes take, and which there are. Plain data and declarations only, see
// row_kernels.h.
#pragma once

#include "generator/terrain/kernels/vector_pad.h"

#include <cstdint>

namespace terrane {

/// How near one random point can be to a block of columns in a row.
struct ErosionBound {
    float square_x = 0;  ///< least distance^2 along x
    float z_min = 0;     ///< where the point lies
    float z_max = 0;
};

/// One octave of a landscape's erosion filter over a row of columns, see
/// generator/landscape/erosion.h.
struct ErosionRow {
    float* slope_x = nullptr;  ///< voxels a column; all of these have `count` values
    float* slope_z = nullptr;
    float* mask = nullptr;
    float* fade = nullptr;
    float* sum = nullptr;
    const float* fraction_x = nullptr;  ///< of the octave's cell, 0..1
    /// The random points of the 3 x 3 cells around each column's, from its own cell's corner:
    /// kErosionPoints planes of x, then of z, `plane` values each.
    const float* points = nullptr;
    std::int64_t plane = 0;
    const ErosionBound* bounds = nullptr;  ///< kErosionPoints for each block
    float fraction_z = 0;
    float amplitude = 0;     ///< voxels
    float steepening = 0;    ///< what a stripe adds to the slope
    std::int32_t count = 0;  ///< a multiple of kVectorPad
    bool is_last = false;    ///< of the octaves: slopes and mask may stay as they are
};

inline constexpr std::int32_t kErosionPoints = 9;

/// A reach of a river, see generator/landscape/river_graph.h; columns.
inline constexpr std::int32_t kReachSegments = 4;

struct ReachShape {
    float x = 0;  ///< its node, whole columns from the places' origin
    float z = 0;
    float px[kReachSegments + 1] = {};  ///< from the node
    float pz[kReachSegments + 1] = {};
    float inverse_square[kReachSegments] = {};  ///< 1 / length^2 of each piece, or 0
    float level = 0;
    float level_change = 0;
};

/// kVectorPad places and what valleys are made with, see generator/landscape/relief.h.
struct ValleyPlaces {
    float x[kVectorPad];  ///< whole columns from an origin
    float z[kVectorPad];
    float x_rest[kVectorPad];  ///< of a column
    float z_rest[kVectorPad];
    float river[kVectorPad];   ///< results: hr, where weight is not 0
    float crest[kVectorPad];   ///< pf
    float weight[kVectorPad];  ///< sum w
};

struct ValleyConstants {
    float inverse_reach_square = 0;  ///< 1 / R^2
    float e2 = 0;
    float half_valley = 0;
    float plateau = 0;
};

/// Shares of the four lattice points around a cell of columns, see generator/landscape/relief.h.
inline constexpr std::int32_t kSplineCell = 8;

struct SplineShares {
    float of[4][kSplineCell];
};

/// Columns side by side that look for a reach, moved by how rivers wind; whole blocks are written.
struct ReachRow {
    float* square = nullptr;  ///< of the distance to the reach, columns^2
    float* along = nullptr;   ///< where on it, 0 at its node and 1 at its end
    const float* wander_x = nullptr;
    const float* wander_z = nullptr;
    float x = 0;  ///< of the first column, whole columns from the reach's node
    float z = 0;
    float step = 1;
    std::int32_t count = 0;
};

/// A straight piece of a cave's tube, see generator/landscape/caves.h; columns from the tube's
/// origin, voxels.
struct TubePiece {
    float x = 0;
    float z = 0;
    float ex = 0;  ///< to the piece's end, likewise the other changes
    float ez = 0;
    float inverse_square = 0;  ///< 1 / |e|^2, or 0
    float y = 0;
    float dy = 0;
    float radius = 0;
    float dr = 0;
    float steep = 1;  ///< sqrt(1 + slope^2)
    float y_min = 0;
    float y_max = 0;
};

/// Columns side by side; whole blocks of the arrays can be written, though `count` values are.
struct TubeRow {
    float* floor = nullptr;
    float* lid = nullptr;
    const float* rough = nullptr;  ///< noise of walls
    const float* ragged = nullptr;
    float x = 0;  ///< of the first column, from the tube's origin
    float z = 0;
    std::int32_t count = 0;
};

/// What a layer does to slopes, see generator/landscape/resistance.h.
struct LayerResistance {
    float cost = 1;  ///< g: raw height of a voxel
    float inverse_cost = 1;
    float resistance = 1;  ///< rho
    float concave = 0;     ///< e
};

/// Where lips are looked for, see generator/landscape/overhangs.h; places are the first column of
/// those within `reach` in the middle's own row.
struct LipPlace {
    const float* over = nullptr;
    const float* row_highest = nullptr;  ///< of the row, at its middle
    const float* moved = nullptr;
    const float* inverse_reaches = nullptr;
    const float* distances = nullptr;  ///< kVectorPad for each row from the middle's on, far ones
                                       ///< where nothing is looked for
    std::int64_t stride = 0;
    std::int32_t reach = 0;  ///< columns, at most (kVectorPad - 1) / 2
    float raw_top = 0;
    float moved_here = 0;
};

/// A layer that may lean out over a row of columns, see generator/landscape/overhangs.h.
struct LedgeRow {
    std::uint32_t* lean = nullptr;  ///< gets `bit` where it may
    const float* highest = nullptr;
    const float* raw = nullptr;
    const float* moved = nullptr;
    const float* crest = nullptr;
    const float* raw_top = nullptr;
    const float* top = nullptr;
    const float* bottom = nullptr;
    std::uint32_t bit = 0;
    float crest_least = 0;
    float thick_least = 0;
    std::int32_t count = 0;
};

/// Not 0 where some column has it.
struct LedgeSeen {
    std::uint32_t leans = 0;
    std::uint32_t is_lower = 0;  ///< some lip is as high as the layer's top
};

struct LandscapeKernels {
    /// Stripes down the slopes of a row, and what they make of its slopes.
    void (*erode)(const ErosionRow& row);
    /// Level and crest of the places from all reaches that come nearer than R to any of them, in
    /// order.
    void (*valleys)(ValleyPlaces& places, const ReachShape* reaches, std::int32_t count,
                    const ValleyConstants& constants);
    /// Columns of `cells` cells next to each other, from the cells + 3 points around them.
    void (*mix_cells)(float* out, const float* values, const SplineShares& shares,
                      std::int32_t cells);
    /// How far a reach is from each column.
    void (*near_reach)(const ReachRow& row, const ReachShape& reach);
    /// Goes up through a layer of the resistance map, see generator/landscape/resistance.h, in
    /// whole blocks: `bottom` is null for the lowest layer. Whether some value is left.
    bool (*resist)(float* height, float* rest, const float* bottom, const float* top,
                   const LayerResistance& layer, std::int32_t count);
    /// raw_top[i] += raw height of a layer; `bottom` is null for the lowest one. Whole blocks.
    void (*raise_tops)(float* raw_top, const float* bottom, const float* top, float cost,
                       std::int32_t count);
    /// Where a layer may lean out.
    LedgeSeen (*ledge)(const LedgeRow& row);
    /// The nearest lip that is no lower than raw_top, as a share of what it reaches; at most 1.
    float (*nearest_lip)(const LipPlace& place);
    /// Lowers floors and raises lids to what a piece of a tube hollows out.
    void (*tube)(const TubeRow& row, const TubePiece& piece);
};

}  // namespace terrane
