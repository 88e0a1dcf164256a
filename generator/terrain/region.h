// One rectangle of columns, start to end: noise, heights, elements and flow as rasters.
//
// Rasters have one value a column, an apron of one column around the rectangle included (flow needs
// the slope, meshes the neighbours); landscapes have a wider one. Every value is a function of
// (world, column) only.
#pragma once

#include "generator/terrain/element.h"
#include "generator/terrain/element_shape.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/plot_cache.h"
#include "generator/terrain/world.h"

#include <cstdint>
#include <vector>

namespace terrane {

/// `width` x `length` columns from (x0, z0) on, 2^lod voxels apart. Sides 1..kRectangleSideMax - 2
/// (of landscapes - 14, for what overhangs look at).
struct ColumnRectangle {
    std::int64_t x0 = 0;
    std::int64_t z0 = 0;
    std::int32_t width = 0;
    std::int32_t length = 0;
    std::int32_t lod = 0;

    std::int64_t step() const { return std::int64_t{1} << lod; }
};

/// An element that stands in the region, with its raster over the columns it may cover.
struct PlacedElement {
    PlottedElement* plotted = nullptr;  ///< owned by the plot cache
    std::int32_t column_first = 0;      ///< raster's place in the region's rasters
    std::int32_t row_first = 0;
    std::int32_t columns = 0;
    std::int32_t rows = 0;
    std::int32_t stride = 0;
    std::size_t raster = 0;  ///< index into Region::thickness

    const Element& element() const { return plotted->element; }
};

/// A bit of Region::irregular.
inline constexpr std::uint8_t kElementStands = 2;

/// A worker's rasters and buffers; refilled by build_region.
struct Region {
    ColumnRectangle inner;
    RectangleShape shape;    ///< inner and its apron
    std::int32_t apron = 1;  ///< columns
    std::int32_t flow_stride = 0;
    std::size_t layers_built = 0;  ///< planes of `heights` and `y256` that hold their layers
    bool elements_lift = true;     ///< veins and caves lift what is above them
    std::vector<float> stacked;    ///< S, the top of the stack so far
    std::vector<float> noise;
    std::vector<float> heights;            ///< K planes of shape.padded_size(): H_k
    std::vector<std::int32_t> y256;        ///< K planes, likewise: H_k in 1/256 voxel
    std::vector<std::int32_t> flow;        ///< K planes of the inner columns: x | y << 8 | z << 16
    std::vector<PlacedElement> elements;   ///< by gap, then in laying order
    std::vector<std::uint32_t> gap_begin;  ///< first element of each gap; K entries
    std::vector<float> thickness;          ///< the elements' rasters
    std::vector<std::uint64_t> gap_mask;   ///< per column of shape: bit g: an element in gap g
    /// K planes: where each layer's blend into the one right below ends, in 1/256 voxel.
    std::vector<std::int32_t> middle;
    /// Per column of shape: bit 0 where a layer pinches out or a blend reaches its layer's top,
    /// kElementStands where an element stands that does not just replace.
    std::vector<std::uint8_t> irregular;

    NoiseBuffers noise_buffers;
    RasterBuffers raster_buffers;

    std::size_t plane_size() const { return shape.padded_size(); }

    std::size_t flow_plane_size() const {
        return static_cast<std::size_t>(flow_stride) * static_cast<std::size_t>(inner.length) +
               kVectorPad;
    }
};

/// How a layer's limits are written.
struct LayerRules {
    std::int32_t blend = 0;           ///< share of the thickness that blends, 1/256; 0 is sharp
    std::int32_t blend_on_below = 0;  ///< the same, 0 if it never blends into the layer right below
    bool alone = false;
};

/// Noises and constants of a world's layers, made once per generator.
struct TerrainConstants {
    std::vector<Noise> height_noise;
    std::vector<Noise> flow_noise;
    std::vector<HeightConstants> heights;
    std::vector<LayerRules> rules;

    explicit TerrainConstants(const World& world);
};

/// Fills `region` for the rectangle. One thread; `plots` memoises and never changes results.
void build_region(Region& region, const World& world, const TerrainConstants& constants,
                  const ColumnRectangle& rectangle, PlotCache& plots, const RowKernels& kernels);

/// The same in steps, for landscapes, which cut much of the stack away and need no more than the
/// rest: begins with no layer, and with elements only if they lift what is above them.
void begin_region(Region& region, const World& world, const ColumnRectangle& rectangle,
                  std::int32_t apron, PlotCache& plots, const RowKernels& kernels);

/// Builds the layer above those that are there, without flow and blends.
void build_layer(Region& region, const TerrainConstants& constants, const RowKernels& kernels);

/// Fills one layer's plane of `region.middle` and marks irregular columns, once its heights are
/// there; not for the lowest layer.
void build_blends(Region& region, const TerrainConstants& constants, std::size_t layer,
                  const RowKernels& kernels);

/// Places elements that lift nothing, once the layers are there: those of gaps whose layer is
/// built, as far as their layer's top lies below `shown256` in some column of shape.
void place_elements(Region& region, const World& world, const std::int32_t* shown256,
                    PlotCache& plots, const RowKernels& kernels);

/// Fills one layer's plane of `region.flow`, once its heights are there.
void build_flow(Region& region, const TerrainConstants& constants, std::size_t layer,
                const RowKernels& kernels);

}  // namespace terrane
