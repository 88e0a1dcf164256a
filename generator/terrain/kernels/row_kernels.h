// The inner loops, compiled once per instruction set and chosen at run time.
//
// Every set gives the same bits: only + - * / sqrt, comparison and conversions, no contraction, and
// no sum whose order depends on the vector width. The environment variable TERRANE_SIMD
// (scalar, sse2, avx2, avx512; elsewhere scalar, native) forces a set; tests hash them all.
//
// This header is also included by code compiled for newer processors than the one at hand, so it
// holds plain data and declarations only.
#pragma once

#include <cstdint>

namespace terrane {

/// Kernels work in blocks of this many columns and may write so many values past a row's end.
inline constexpr std::int32_t kVectorPad = 16;
/// Widest rectangle: a 64-column stack, the paper's 50-column plots and pictures' tiles fit, with
/// the wider aprons of landscapes.
inline constexpr std::int32_t kRectangleSideMax = 144;

constexpr std::int32_t padded_width(std::int32_t width) {
    return (width + kVectorPad - 1) / kVectorPad * kVectorPad;
}

/// One octave of noise over a rectangle, prepared: positions split into lattice cell and fraction.
/// Only lattice columns and rows next to a position are there; a position's cell lies between entry
/// `*_cell` and the one after it.
struct NoiseRows {
    const float* fraction_x = nullptr;          ///< per column, padded
    const float* fade_x = nullptr;              ///< per column, padded
    const std::int32_t* column_cell = nullptr;  ///< per column, padded
    const std::int32_t* cell_begin = nullptr;   ///< wide cells: first column of each; then the end
    const float* fraction_z = nullptr;          ///< per row
    const std::int32_t* row_cell = nullptr;     ///< per row
    const float* gradient_x = nullptr;          ///< lattice rows x lattice_columns
    const float* gradient_z = nullptr;
    std::int32_t lattice_columns = 0;
    float amplitude = 0;
    bool wide_cells = false;  ///< cells are wide enough to go cell by cell
};

/// A layer's constants in eq. 4.
struct HeightConstants {
    float below = 0;       ///< N0
    float similarity = 0;  ///< s
    float roughness = 0;   ///< r
    float top = 0;         ///< A
};

/// Segments of an element's outline, in kSegmentGroups runs of neighbours. Segment j of run g lies
/// at [j * kSegmentGroups + g], so that one vector holds the same segment of every run.
inline constexpr std::int32_t kSegmentGroups = 16;
inline constexpr std::int32_t kSegmentsPerGroup = 8;
inline constexpr std::int32_t kSegments = kSegmentGroups * kSegmentsPerGroup;

struct SegmentTable {
    float ax[kSegments];
    float az[kSegments];
    float ex[kSegments];  ///< towards the next point
    float ez[kSegments];
    float inverse_square[kSegments];  ///< 1 / |e|^2, or 0
};

/// Elements are rastered in squares of kTileSide columns.
inline constexpr std::int32_t kTileSide = 4;

/// What the columns of a plain row are made from: planes of a region, see region.h.
struct PlainRow {
    const std::int32_t* y256 = nullptr;    ///< layer 0's row; layer k's lies k * plane further
    const std::int32_t* middle = nullptr;  ///< likewise: where the layer's blend ends
    const std::int32_t* flow = nullptr;    ///< likewise, or null: no flow
    std::int64_t plane = 0;
    std::int64_t flow_plane = 0;
    std::int32_t layers = 0;
};

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

/// A layer that may lean out over a row of columns, see generator/landscape/overhangs.h.
struct LedgeRow {
    std::uint32_t* lean = nullptr;  ///< gets `bit` where it may
    const float* highest = nullptr;
    const float* raw = nullptr;
    const float* moved = nullptr;
    const float* raw_top = nullptr;
    const float* top = nullptr;
    const float* bottom = nullptr;
    std::uint32_t bit = 0;
    float thick_least = 0;
    std::int32_t count = 0;
};

/// Not 0 where some column has it.
struct LedgeSeen {
    std::uint32_t leans = 0;
    std::uint32_t is_lower = 0;  ///< some lip is as high as the layer's top
};

struct RowKernels {
    /// Gradients of `count` lattice points of one lattice row, from the hashes of their columns:
    /// the top four bits of mix(hash ^ row_value) number the sixteen unit vectors. Whole blocks.
    void (*gradients)(float* x, float* z, const std::uint64_t* column_hash, std::uint64_t row_value,
                      std::int32_t count);
    /// out[row * stride + column], padded rows: sum of the octaves, in order, from 0.
    void (*noise)(float* out, std::int32_t stride, std::int32_t width, std::int32_t length,
                  const NoiseRows* octaves, std::int32_t octave_count);
    /// Eq. 4 over `count` values (a multiple of kVectorPad): height = max(S, ((S-N0)*s + n*r) + A);
    /// S = height.
    void (*heights)(float* height, float* stacked, const float* noise, std::int32_t count,
                    HeightConstants constants);
    /// packed[i] = x | y << 8 | z << 16 of a row's flow; `height` points at the row's first column
    /// and its neighbours lie at -1, +1, -stride and +stride, `half_per_step` = 1 / (2 * their
    /// distance in voxels). `count` is a multiple of kVectorPad.
    void (*flow)(std::int32_t* packed, const float* noise, const float* height, std::int32_t stride,
                 std::int32_t count, float half_per_step);
    /// y256[i] = the height in 1/256 voxel.
    void (*quantise)(std::int32_t* y256, const float* height, std::int32_t count);
    /// middle[i] = where the blend of the layer between `bottom` and `top` ends, in 1/256 voxel;
    /// irregular[i] |= 1 where the layer is not there or its blend reaches its top.
    void (*blends)(std::int32_t* middle, std::uint8_t* irregular, const std::int32_t* bottom,
                   const std::int32_t* top, std::int32_t blend, std::int32_t count);
    /// Limits of `count` columns whose layers all stand and blend regularly: 2 * layers + 1 each,
    /// in memory as 12 bytes: y256, palette id | flow << 16.
    void (*plain_columns)(void* limits, const PlainRow& row, std::int32_t first,
                          std::int32_t count);
    /// thickness of an element in a tile whose first column is (x, z): kTileSide rows of kTileSide,
    /// `step` voxels apart. As if the whole plane were inside the outline.
    void (*element_tile)(float* thickness, float x, float z, float step,
                         const SegmentTable& segments, float inverse_half_side, float thick);
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
    /// Lowers floors and raises lids to what a piece of a tube hollows out.
    void (*tube)(const TubeRow& row, const TubePiece& piece);
};

namespace kernels_scalar {
extern const RowKernels kKernels;
}

namespace kernels_sse2 {
extern const RowKernels kKernels;
}

namespace kernels_avx2 {
extern const RowKernels kKernels;
}

namespace kernels_avx512 {
extern const RowKernels kKernels;
}

namespace kernels_native {
extern const RowKernels kKernels;
}

}  // namespace terrane
