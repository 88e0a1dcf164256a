// The inner loops, compiled once per instruction set and chosen at run time.
//
// Every set gives the same bits: only + - * / sqrt, comparison and conversions, no contraction, and
// no sum whose order depends on the vector width. The environment variable TERRANE_SIMD
// (scalar, sse2, avx2, avx512; elsewhere scalar, native) forces a set; tests hash them all.
//
// This header is also included by code compiled for newer processors than the one at hand, so it
// holds plain data and declarations only.
#pragma once

#include "generator/terrain/kernels/landscape_kernels.h"
#include "generator/terrain/kernels/vector_pad.h"

#include <cstdint>

namespace terrane {

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

struct MeshKernels;

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
    const LandscapeKernels* landscape;
    const MeshKernels* mesh;  ///< generator/mesh/kernels/mesh_kernels.h
};

namespace kernels_scalar {
extern const RowKernels kKernels;
extern const LandscapeKernels kLandscapeKernels;
extern const MeshKernels kMeshKernels;
}  // namespace kernels_scalar

namespace kernels_sse2 {
extern const RowKernels kKernels;
extern const LandscapeKernels kLandscapeKernels;
extern const MeshKernels kMeshKernels;
}  // namespace kernels_sse2

namespace kernels_avx2 {
extern const RowKernels kKernels;
extern const LandscapeKernels kLandscapeKernels;
extern const MeshKernels kMeshKernels;
}  // namespace kernels_avx2

namespace kernels_avx512 {
extern const RowKernels kKernels;
extern const LandscapeKernels kLandscapeKernels;
extern const MeshKernels kMeshKernels;
}  // namespace kernels_avx512

namespace kernels_native {
extern const RowKernels kKernels;
extern const LandscapeKernels kLandscapeKernels;
extern const MeshKernels kMeshKernels;
}  // namespace kernels_native

}  // namespace terrane
