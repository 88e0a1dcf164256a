#include "generator/terrain/element_shape.h"

#include "generator/terrain/random.h"

#include <algorithm>
#include <cmath>

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

/// Rows of a rectangle that a segment crosses: az <= z < bz or the other way round.
void add_crossings(const ElementShape& shape, std::size_t segment, const LocalRectangle& rectangle,
                   RasterBuffers& buffers) {
    const std::size_t next = (segment + 1) % kOutlinePoints;
    const float az = shape.az[segment];
    const float bz = shape.az[next];
    const auto first_row = static_cast<std::int64_t>(std::ceil(std::min(az, bz)));
    const auto end_row = static_cast<std::int64_t>(std::ceil(std::max(az, bz)));
    const std::int64_t begin = std::max(first_row, rectangle.z0);
    const std::int64_t end = std::min(end_row, rectangle.z0 + rectangle.length);
    for (std::int64_t z = begin; z < end; ++z) {
        const auto row = static_cast<std::size_t>(z - rectangle.z0);
        const float x = shape.ax[segment] +
                        (static_cast<float>(z) - az) * (shape.ex[segment] / shape.ez[segment]);
        const auto at = static_cast<std::size_t>(buffers.crossing_counts[row]++);
        buffers.crossings[row * kOutlinePoints + at] = x;
    }
}

struct ColumnSpan {
    std::int32_t begin = 0;
    std::int32_t end = 0;
};

ColumnSpan clip(float x0, float x1, const LocalRectangle& rectangle) {
    const auto to_column = [&rectangle](float x) {
        const std::int64_t column = static_cast<std::int64_t>(std::ceil(x)) - rectangle.x0;
        return static_cast<std::int32_t>(std::clamp<std::int64_t>(column, 0, rectangle.width));
    };
    return {.begin = to_column(x0), .end = to_column(x1)};
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
        shape.ax[i] = static_cast<float>((p.x - middle.x) * scale + element.center_x);
        shape.az[i] = static_cast<float>((p.z - middle.z) * scale + element.center_z);
    }
    for (std::size_t i = 0; i < kOutlinePoints; ++i) {
        const std::size_t next = (i + 1) % kOutlinePoints;
        shape.ex[i] = shape.ax[next] - shape.ax[i];
        shape.ez[i] = shape.az[next] - shape.az[i];
        const float square = shape.ex[i] * shape.ex[i] + shape.ez[i] * shape.ez[i];
        shape.inverse_square[i] = square > 0 ? 1.0F / square : 0.0F;
    }
    return shape;
}

void raster_element(float* out, std::int32_t stride, const Element& element,
                    const ElementShape& shape, const LocalRectangle& rectangle,
                    const RowKernels& kernels, RasterBuffers& buffers) {
    const auto rows = static_cast<std::size_t>(rectangle.length);
    buffers.crossing_counts.assign(rows, 0);
    buffers.crossings.resize(std::max(buffers.crossings.size(), rows * kOutlinePoints));
    for (std::size_t i = 0; i < kOutlinePoints; ++i) {
        add_crossings(shape, i, rectangle, buffers);
    }
    const SegmentTable segments = shape.segments();
    const float inverse_half_side = 2.0F / element.side;
    for (std::size_t row = 0; row < rows; ++row) {
        float* const values = out + static_cast<std::ptrdiff_t>(row) * stride;
        float* const crossings = buffers.crossings.data() + row * kOutlinePoints;
        const auto count = static_cast<std::size_t>(buffers.crossing_counts[row]);
        std::sort(crossings, crossings + count);
        const float z = static_cast<float>(rectangle.z0 + static_cast<std::int64_t>(row));
        std::int32_t done = 0;
        for (std::size_t i = 0; i + 1 < count; i += 2) {
            const ColumnSpan span = clip(crossings[i], crossings[i + 1], rectangle);
            if (span.begin >= span.end) {
                continue;
            }
            std::fill(values + done, values + span.begin, 0.0F);
            kernels.element_row(values + span.begin, static_cast<float>(rectangle.x0 + span.begin),
                                z, span.end - span.begin, segments, inverse_half_side,
                                element.thickness);
            done = span.end;
        }
        std::fill(values + done, values + stride, 0.0F);
    }
}

}  // namespace terrane
