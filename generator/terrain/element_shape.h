// The outline of a vein or cave, and how thick it is at each column inside.
// Source: the paper, 4.2.2: subdivision with displacement (eq. 5) and profile (eq. 6).
#pragma once

#include "generator/terrain/element.h"
#include "generator/terrain/kernels/row_kernels.h"

#include <array>
#include <cstdint>
#include <vector>

namespace terrane {

inline constexpr std::int32_t kOutlinePoints = kSegments;

/// A closed polygon, plot-local columns. Displacement is radial, so it never crosses itself.
/// Segment i runs from point i to point i + 1.
struct ElementShape {
    std::array<float, kOutlinePoints> x{};
    std::array<float, kOutlinePoints> z{};
    SegmentTable segments{};
};

ElementShape make_shape(const Element& element);

/// A rectangle of columns in plot-local coordinates.
struct LocalRectangle {
    std::int64_t x0 = 0;
    std::int64_t z0 = 0;
    std::int32_t width = 0;
    std::int32_t length = 0;
    std::int64_t step = 1;  ///< voxels from column to column
};

/// Memory of `raster_element`; one thread's.
struct RasterBuffers {
    std::vector<float> crossings;
    std::vector<std::int32_t> crossing_counts;
    std::vector<std::uint8_t> inside;
};

/// Thickness in voxels at each column of the rectangle, 0 outside the outline. `out` has
/// `length` rows of `stride` >= width values.
void raster_element(float* out, std::int32_t stride, const Element& element,
                    const ElementShape& shape, const LocalRectangle& rectangle,
                    const RowKernels& kernels, RasterBuffers& buffers);

}  // namespace terrane
