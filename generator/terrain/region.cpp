#include "generator/terrain/region.h"

#include "generator/terrain/choose_composition.h"
#include "generator/terrain/element.h"
#include "generator/terrain/element_shape.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/kernels/vector_pad.h"
#include "generator/terrain/layer_stack.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/plot_cache.h"
#include "generator/terrain/random.h"
#include "generator/terrain/world.h"
#include "generator/world/world_definition.h"
#include "protocol/base/check.h"
#include "protocol/base/coords.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace terrane {
namespace {

template <typename T>
void grow(std::vector<T>& buffer, std::size_t size) {
    if (buffer.size() < size) {
        buffer.resize(size);
    }
}

/// Where an element's square meets the region, in the region's rasters; nothing if nowhere.
std::optional<PlacedElement> place(PlottedElement& plotted, const RectangleShape& shape,
                                   std::int32_t plot_side) {
    const Element& element = plotted.element;
    const std::int64_t x = element.plot.x * plot_side - shape.x0;
    const std::int64_t z = element.plot.z * plot_side - shape.z0;
    const float half = element.side * 0.5F + 1.0F;  // a voxel of slack for float rounding
    const auto index_after = [&shape](std::int64_t voxels, std::int32_t most) {
        const std::int64_t index = floor_div(voxels + shape.step - 1, shape.step);
        return static_cast<std::int32_t>(std::clamp<std::int64_t>(index, 0, most));
    };
    const auto voxels = [](float value) { return static_cast<std::int64_t>(std::floor(value)); };
    PlacedElement placed;
    placed.plotted = &plotted;
    placed.column_first = index_after(x + voxels(element.center_x - half), shape.width);
    placed.row_first = index_after(z + voxels(element.center_z - half), shape.length);
    placed.columns =
        index_after(x + voxels(element.center_x + half) + 1, shape.width) - placed.column_first;
    placed.rows =
        index_after(z + voxels(element.center_z + half) + 1, shape.length) - placed.row_first;
    if (placed.columns <= 0 || placed.rows <= 0) {
        return std::nullopt;
    }
    placed.stride = placed.columns;
    return placed;
}

/// Made when it is first asked for.
const ElementShape& shape_of(PlottedElement& plotted) {
    if (!plotted.shape) {
        plotted.shape = make_shape(plotted.element);
    }
    return *plotted.shape;
}

/// Every element of every plot near enough that `is_wanted`, rastered; in laying order.
template <typename Wanted>
void find_elements(Region& region, const World& world, PlotCache& plots, const RowKernels& kernels,
                   Wanted is_wanted) {
    region.elements.clear();
    region.gap_begin.assign(world.stack.layers.size(), 0);
    const TerrainParameters& terrain = world.definition.terrain;
    const double area = std::max(terrain.vein_area, terrain.cave_area);
    // A coarse level would sample an element too thinly, and meet thousands of plots.
    const bool too_coarse =
        region.shape.step > 1 && static_cast<double>(region.shape.step) > area / 8;
    if (world.stack.gap_count() == 0 || too_coarse) {
        return;
    }
    const std::int32_t side = world.definition.grid.plot;
    const auto reach = static_cast<std::int64_t>(area / 2) + 2;
    const RectangleShape& shape = region.shape;
    const PlotPos first{.x = floor_div(shape.x0 - reach, side),
                        .z = floor_div(shape.z0 - reach, side)};
    const PlotPos last{.x = floor_div(shape.x0 + (shape.width - 1) * shape.step + reach, side),
                       .z = floor_div(shape.z0 + (shape.length - 1) * shape.step + reach, side)};
    for (std::int64_t pz = first.z; pz <= last.z; ++pz) {
        for (std::int64_t px = first.x; px <= last.x; ++px) {
            for (PlottedElement& plotted : plots.get(world, {.x = px, .z = pz})) {
                const auto placed = place(plotted, shape, side);
                if (!placed || plotted.element.side <= 0 || !is_wanted(*placed)) {
                    continue;
                }
                region.elements.push_back(*placed);
            }
        }
    }
    std::sort(region.elements.begin(), region.elements.end(),
              [](const PlacedElement& a, const PlacedElement& b) {
                  return comes_before(a.element(), b.element());
              });
    std::size_t values = 0;
    for (PlacedElement& placed : region.elements) {
        placed.raster = values;
        values += static_cast<std::size_t>(placed.stride) * static_cast<std::size_t>(placed.rows);
    }
    grow(region.thickness, values);
    for (const PlacedElement& placed : region.elements) {
        const Element& element = placed.element();
        raster_element(region.thickness.data() + placed.raster, placed.stride, element,
                       shape_of(*placed.plotted),
                       {.x0 = shape.x0 + placed.column_first * shape.step - element.plot.x * side,
                        .z0 = shape.z0 + placed.row_first * shape.step - element.plot.z * side,
                        .width = placed.columns,
                        .length = placed.rows,
                        .step = shape.step},
                       kernels, region.raster_buffers);
    }
    std::size_t next = 0;
    for (std::size_t gap = 0; gap < region.gap_begin.size(); ++gap) {
        while (next < region.elements.size() &&
               static_cast<std::size_t>(region.elements[next].element().gap) < gap) {
            ++next;
        }
        region.gap_begin[gap] = static_cast<std::uint32_t>(next);
    }
}

/// Marks the columns of an element that stands on layer heights `height`, and raises S by it unless
/// it `replaces` what is above.
void lay_element(Region& region, const PlacedElement& placed, const float* height, bool replaces) {
    const std::uint64_t gap_bit = std::uint64_t{1} << static_cast<unsigned>(placed.element().gap);
    const std::uint8_t mark = replaces ? 0 : kElementStands;
    for (std::int32_t row = 0; row < placed.rows; ++row) {
        const std::size_t first = region.shape.index(placed.column_first, placed.row_first + row);
        const float* const thickness =
            region.thickness.data() + placed.raster +
            static_cast<std::size_t>(row) * static_cast<std::size_t>(placed.stride);
        for (std::size_t i = 0; i < static_cast<std::size_t>(placed.columns); ++i) {
            if (thickness[i] > 0) {
                region.gap_mask[first + i] |= gap_bit;
                region.irregular[first + i] |= mark;
                if (!replaces && region.elements_lift) {
                    region.stacked[first + i] =
                        std::max(region.stacked[first + i], height[first + i] + thickness[i]);
                }
            }
        }
    }
}

void allocate(Region& region, std::size_t layers) {
    const std::size_t plane = region.plane_size();
    grow(region.stacked, plane);
    // Flow of the last columns reads a little past the last plane's end.
    grow(region.noise, plane);
    grow(region.heights, plane * layers + 2 * std::size_t{kVectorPad});
    grow(region.y256, plane * layers);
    grow(region.flow, region.flow_plane_size() * layers);
    grow(region.middle, plane * layers);
    region.gap_mask.assign(plane, 0);
    region.irregular.assign(plane, 0);
}

}  // namespace

TerrainConstants::TerrainConstants(const World& world) {
    const TerrainParameters& terrain = world.definition.terrain;
    const std::uint64_t seed = world.definition.seed;
    for (std::size_t k = 0; k < world.stack.layers.size(); ++k) {
        const Layer& layer = world.stack.layers[k];
        height_noise.push_back(
            Noise::make(key(seed, Tag::noise, k), terrain.scale, terrain.octaves));
        flow_noise.push_back(Noise::make(key(seed, Tag::flow, k), 2 * terrain.scale, 1));
        heights.push_back(
            {.below = static_cast<float>(layer.bottom),
             .similarity = static_cast<float>(layer.similarity),
             .roughness = static_cast<float>(layer.roughness * (1 - layer.similarity)),
             .top = static_cast<float>(layer.top())});
        const std::int32_t blend = layer.alone ? 0 : blend256(layer.blend);
        const bool below_alone = k > 0 && world.stack.layers[k - 1].alone;
        rules.push_back(
            {.blend = blend, .blend_on_below = below_alone ? 0 : blend, .alone = layer.alone});
    }
}

void build_flow(Region& region, const TerrainConstants& constants, std::size_t layer,
                const RowKernels& kernels) {
    const RectangleShape inner{.x0 = region.inner.x0,
                               .z0 = region.inner.z0,
                               .width = region.inner.width,
                               .length = region.inner.length,
                               .step = region.shape.step};
    const float half_per_step = 0.5F / static_cast<float>(inner.step);
    noise_rectangle(region.noise.data(), constants.flow_noise[layer], inner, kernels,
                    region.noise_buffers);
    const std::int32_t stride = region.shape.stride();
    const float* const heights = region.heights.data() + layer * region.plane_size();
    std::int32_t* const flow = region.flow.data() + layer * region.flow_plane_size();
    for (std::int32_t row = 0; row < inner.length; ++row) {
        kernels.flow(
            flow + static_cast<std::ptrdiff_t>(row) * region.flow_stride,
            region.noise.data() + static_cast<std::ptrdiff_t>(row) * region.flow_stride,
            heights + static_cast<std::ptrdiff_t>(row + region.apron) * stride + region.apron,
            stride, region.flow_stride, half_per_step);
    }
}

void build_blends(Region& region, const TerrainConstants& constants, std::size_t layer,
                  const RowKernels& kernels) {
    const std::size_t plane = region.plane_size();
    const std::int32_t* const y256 = region.y256.data() + layer * plane;
    kernels.blends(region.middle.data() + layer * plane, region.irregular.data(), y256 - plane,
                   y256, constants.rules[layer].blend_on_below, static_cast<std::int32_t>(plane));
}

void begin_region(Region& region, const World& world, const ColumnRectangle& rectangle,
                  std::int32_t apron, PlotCache& plots, const RowKernels& kernels) {
    TERRANE_ASSERT(rectangle.width >= 1 && rectangle.width <= kRectangleSideMax - 2 * apron &&
                   rectangle.length >= 1 && rectangle.length <= kRectangleSideMax - 2 * apron);
    region.inner = rectangle;
    region.apron = apron;
    region.elements_lift = world.definition.structure.lift;
    region.shape = {.x0 = rectangle.x0 - apron * rectangle.step(),
                    .z0 = rectangle.z0 - apron * rectangle.step(),
                    .width = rectangle.width + 2 * apron,
                    .length = rectangle.length + 2 * apron,
                    .step = rectangle.step()};
    region.flow_stride = padded_width(rectangle.width);
    region.layers_built = 0;
    allocate(region, world.stack.layers.size());
    std::fill_n(region.stacked.begin(), region.plane_size(),
                1.0F);  // the base is never thinner than a voxel
    plots.trim();
    if (region.elements_lift || !world.definition.has_landscape()) {
        find_elements(region, world, plots, kernels, [](const PlacedElement&) { return true; });
    } else {
        region.elements.clear();
        region.gap_begin.assign(world.stack.layers.size(), 0);
    }
}

void build_layer(Region& region, const TerrainConstants& constants, const RowKernels& kernels) {
    const std::size_t layers = constants.rules.size();
    const std::size_t plane = region.plane_size();
    const auto values = static_cast<std::int32_t>(plane);
    const std::size_t k = region.layers_built++;
    noise_rectangle(region.noise.data(), constants.height_noise[k], region.shape, kernels,
                    region.noise_buffers);
    float* const heights = region.heights.data() + k * plane;
    kernels.heights(heights, region.stacked.data(), region.noise.data(), values,
                    constants.heights[k]);
    kernels.quantise(region.y256.data() + k * plane, heights, values);
    const std::size_t end = k + 1 < layers ? region.gap_begin[k + 1] : region.elements.size();
    for (std::size_t e = region.gap_begin[k]; e < end; ++e) {
        lay_element(region, region.elements[e], heights, false);
    }
}

void place_elements(Region& region, const World& world, const std::int32_t* shown256,
                    PlotCache& plots, const RowKernels& kernels) {
    if (region.elements_lift) {
        return;  // they are there already
    }
    const std::size_t plane = region.plane_size();
    find_elements(region, world, plots, kernels, [&](const PlacedElement& placed) {
        const auto gap = static_cast<std::size_t>(placed.element().gap);
        if (gap >= region.layers_built) {
            return false;
        }
        const std::int32_t* const base = region.y256.data() + gap * plane;
        bool shows = false;
        for (std::int32_t row = placed.row_first; row < placed.row_first + placed.rows; ++row) {
            const std::int32_t first = row * region.shape.stride() + placed.column_first;
            for (std::int32_t i = first; i < first + placed.columns; ++i) {
                shows = shows || base[i] < shown256[i];
            }
        }
        return shows;
    });
    for (const PlacedElement& placed : region.elements) {
        lay_element(region, placed,
                    region.heights.data() + static_cast<std::size_t>(placed.element().gap) * plane,
                    true);
    }
}

void build_region(Region& region, const World& world, const TerrainConstants& constants,
                  const ColumnRectangle& rectangle, PlotCache& plots, const RowKernels& kernels) {
    begin_region(region, world, rectangle, 1, plots, kernels);
    const std::size_t layers = world.stack.layers.size();
    const std::size_t plane = region.plane_size();
    std::fill_n(region.middle.begin(), plane, 0);
    for (std::size_t k = 0; k < layers; ++k) {
        build_layer(region, constants, kernels);
        if (k > 0) {
            build_blends(region, constants, k, kernels);
        }
        build_flow(region, constants, k, kernels);
    }
}

}  // namespace terrane
