#include "generator/terrain/element_shape.h"

#include "generator/terrain/element.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/random.h"
#include "protocol/base/coords.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace terrane {
namespace {

struct Point {
    double x = 0;
    double z = 0;
};

/// The polygon while it grows: eq. 5 displaces less at each of five subdivisions.
struct Outline {
    RandomStream random;
    double smoothness = 1;
    std::array<Point, kOutlinePoints> points{};
    std::size_t count = 0;
};

constexpr int kSubdivisions = 5;
constexpr double kRadiusMin = 0.15;  ///< keeps the polygon around its middle

void subdivide(Outline& outline, Point a, Point b, double displacement, int depth) {
    if (depth == kSubdivisions) {
        outline.points[outline.count++] = b;
        return;
    }
    const double d = (displacement / outline.smoothness) / 2;  // eq. (5)
    const double t = 0.25 + 0.5 * outline.random.unit();
    Point p{.x = a.x + t * (b.x - a.x), .z = a.z + t * (b.z - a.z)};
    const double radius = std::sqrt(p.x * p.x + p.z * p.z);
    const double moved = std::max(kRadiusMin, radius + (2 * outline.random.unit() - 1) * d);
    const double factor = moved / radius;
    p.x *= factor;
    p.z *= factor;
    subdivide(outline, a, p, d, depth + 1);
    subdivide(outline, p, b, d, depth + 1);
}

Outline draw_outline(const Element& element) {
    const double displacement = 0.25 + 0.35 * element.roughness;
    Outline outline{.random = RandomStream(key(element.id, Tag::shape)),
                    .smoothness = 1.25 - 0.25 * element.roughness};
    std::array<Point, 4> corners = {{{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}};
    for (Point& corner : corners) {
        const double factor = 1 + (2 * outline.random.unit() - 1) * displacement;
        corner.x *= factor;
        corner.z *= factor;
    }
    for (std::size_t i = 0; i < corners.size(); ++i) {
        subdivide(outline, corners[i], corners[(i + 1) % corners.size()], displacement, 0);
    }
    return outline;
}

/// The first index 0..count whose coordinate, first + index * step, is not below `edge`.
std::int32_t index_at_or_after(float edge, std::int64_t first, std::int64_t step,
                               std::int32_t count) {
    const std::int64_t distance = static_cast<std::int64_t>(std::ceil(edge)) - first;
    return static_cast<std::int32_t>(
        std::clamp<std::int64_t>(floor_div(distance + step - 1, step), 0, count));
}

/// Rows of a rectangle that a segment crosses: az <= z < bz or the other way round.
void add_crossings(const ElementShape& shape, std::size_t point, const LocalRectangle& rectangle,
                   RasterBuffers& buffers) {
    const std::size_t next = (point + 1) % kOutlinePoints;
    const float az = shape.z[point];
    const float bz = shape.z[next];
    const std::int32_t begin =
        index_at_or_after(std::min(az, bz), rectangle.z0, rectangle.step, rectangle.length);
    const std::int32_t end =
        index_at_or_after(std::max(az, bz), rectangle.z0, rectangle.step, rectangle.length);
    if (begin >= end) {
        return;
    }
    const float slope = (shape.x[next] - shape.x[point]) / (bz - az);
    for (std::int32_t i = begin; i < end; ++i) {
        const auto row = static_cast<std::size_t>(i);
        const std::int64_t z = rectangle.z0 + i * rectangle.step;
        const auto at = static_cast<std::size_t>(buffers.crossing_counts[row]++);
        buffers.crossings[row * kOutlinePoints + at] =
            shape.x[point] + (static_cast<float>(z) - az) * slope;
    }
}

/// Marks the columns between each pair of crossings of a row: ceil(x0) <= x < ceil(x1).
void mark_inside(std::uint8_t* inside, float* crossings, std::size_t count,
                 const LocalRectangle& rectangle) {
    std::sort(crossings, crossings + count);
    const auto to_column = [&rectangle](float x) {
        return index_at_or_after(x, rectangle.x0, rectangle.step, rectangle.width);
    };
    for (std::size_t i = 0; i + 1 < count; i += 2) {
        const std::int32_t begin = to_column(crossings[i]);
        const std::int32_t end = to_column(crossings[i + 1]);
        if (begin < end) {
            std::fill(inside + begin, inside + end, std::uint8_t{1});
        }
    }
}

/// A tile's place in a rectangle, and how much of it lies there.
struct Tile {
    std::int32_t column = 0;
    std::int32_t row = 0;
    std::int32_t columns = 0;
    std::int32_t rows = 0;
};

bool any_inside(const std::uint8_t* inside, std::int32_t width, const Tile& tile) {
    unsigned any = 0;
    for (std::int32_t z = tile.row; z < tile.row + tile.rows; ++z) {
        for (std::int32_t x = tile.column; x < tile.column + tile.columns; ++x) {
            any |= inside[z * width + x];
        }
    }
    return any != 0;
}

}  // namespace

ElementShape make_shape(const Element& element) {
    const Outline outline = draw_outline(element);
    Point low = outline.points[0];
    Point high = outline.points[0];
    for (const Point& p : outline.points) {
        low = {.x = std::min(low.x, p.x), .z = std::min(low.z, p.z)};
        high = {.x = std::max(high.x, p.x), .z = std::max(high.z, p.z)};
    }
    const double scale = element.side / std::max(high.x - low.x, high.z - low.z);
    const Point middle{.x = 0.5 * (low.x + high.x), .z = 0.5 * (low.z + high.z)};
    ElementShape shape;
    for (std::size_t i = 0; i < kOutlinePoints; ++i) {
        const Point& p = outline.points[i];
        shape.x[i] = static_cast<float>((p.x - middle.x) * scale + element.center_x);
        shape.z[i] = static_cast<float>((p.z - middle.z) * scale + element.center_z);
    }
    SegmentTable& segments = shape.segments;
    for (std::size_t i = 0; i < kOutlinePoints; ++i) {
        const std::size_t next = (i + 1) % kOutlinePoints;
        const std::size_t at = i % kSegmentsPerGroup * kSegmentGroups + i / kSegmentsPerGroup;
        segments.ax[at] = shape.x[i];
        segments.az[at] = shape.z[i];
        segments.ex[at] = shape.x[next] - shape.x[i];
        segments.ez[at] = shape.z[next] - shape.z[i];
        const float square = segments.ex[at] * segments.ex[at] + segments.ez[at] * segments.ez[at];
        segments.inverse_square[at] = square > 0 ? 1.0F / square : 0.0F;
    }
    return shape;
}

void raster_element(float* out, std::int32_t stride, const Element& element,
                    const ElementShape& shape, const LocalRectangle& rectangle,
                    const RowKernels& kernels, RasterBuffers& buffers) {
    const auto rows = static_cast<std::size_t>(rectangle.length);
    const auto width = static_cast<std::size_t>(rectangle.width);
    buffers.crossing_counts.assign(rows, 0);
    buffers.crossings.resize(std::max(buffers.crossings.size(), rows * kOutlinePoints));
    buffers.inside.assign(rows * width, 0);
    for (std::size_t i = 0; i < kOutlinePoints; ++i) {
        add_crossings(shape, i, rectangle, buffers);
    }
    for (std::size_t row = 0; row < rows; ++row) {
        mark_inside(buffers.inside.data() + row * width,
                    buffers.crossings.data() + row * kOutlinePoints,
                    static_cast<std::size_t>(buffers.crossing_counts[row]), rectangle);
        std::fill_n(out + row * static_cast<std::size_t>(stride), width, 0.0F);
    }
    const float inverse_half_side = 2.0F / element.side;
    std::array<float, std::size_t{kTileSide} * kTileSide> values{};
    for (Tile tile; tile.row < rectangle.length; tile.row += kTileSide) {
        tile.rows = std::min(kTileSide, rectangle.length - tile.row);
        for (tile.column = 0; tile.column < rectangle.width; tile.column += kTileSide) {
            tile.columns = std::min(kTileSide, rectangle.width - tile.column);
            if (!any_inside(buffers.inside.data(), rectangle.width, tile)) {
                continue;
            }
            kernels.element_tile(values.data(),
                                 static_cast<float>(rectangle.x0 + tile.column * rectangle.step),
                                 static_cast<float>(rectangle.z0 + tile.row * rectangle.step),
                                 static_cast<float>(rectangle.step), shape.segments,
                                 inverse_half_side, element.thickness);
            const float* from = values.data();
            for (std::int32_t z = tile.row; z < tile.row + tile.rows; ++z, from += kTileSide) {
                const auto row = static_cast<std::size_t>(z);
                const auto column = static_cast<std::size_t>(tile.column);
                const std::uint8_t* const inside = buffers.inside.data() + row * width + column;
                float* const to = out + row * static_cast<std::size_t>(stride) + column;
                for (std::int32_t x = 0; x < tile.columns; ++x) {
                    if (inside[x] != 0) {
                        to[x] = from[x];
                    }
                }
            }
        }
    }
}

}  // namespace terrane
