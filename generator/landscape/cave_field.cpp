#include "generator/landscape/caves.h"
#include "generator/landscape/numbers.h"
#include "generator/terrain/kernels/landscape_kernels.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/kernels/vector_pad.h"
#include "generator/terrain/noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace terrane {
namespace {

constexpr float kFunnel = 9;  ///< columns around a doline's shaft, and its depth in voxels
constexpr float kSky = 1e6F;

std::array<TubePiece, kTubePoints - 1> pieces_of(const Tube& tube) {
    std::array<TubePiece, kTubePoints - 1> pieces;
    for (std::size_t p = 0; p + 1 < kTubePoints; ++p) {
        const TubePoint& a = tube.points[p];
        const TubePoint& b = tube.points[p + 1];
        TubePiece& piece = pieces[p];
        piece = {.x = a.x,
                 .z = a.z,
                 .ex = b.x - a.x,
                 .ez = b.z - a.z,
                 .y = a.y,
                 .dy = b.y - a.y,
                 .radius = a.radius,
                 .dr = b.radius - a.radius,
                 .y_min = std::min(a.y, b.y),
                 .y_max = std::max(a.y, b.y)};
        const float square = piece.ex * piece.ex + piece.ez * piece.ez;
        piece.inverse_square = square > 0 ? 1.0F / square : 0.0F;
        piece.steep = std::sqrt(1.0F + piece.dy * piece.dy / std::max(square, 0.01F));
    }
    return pieces;
}

/// Columns of a shape that a box touches, in the shape's own numbers.
struct Touched {
    std::int32_t first = 0;
    std::int32_t end = 0;
};

Touched touched(std::int64_t origin, float low, float high, std::int64_t start,
                std::int32_t count) {
    const auto from = origin + static_cast<std::int64_t>(std::floor(low)) - start;
    const auto to = origin + static_cast<std::int64_t>(std::floor(high)) + 2 - start;
    return {.first = static_cast<std::int32_t>(std::clamp<std::int64_t>(from, 0, count)),
            .end = static_cast<std::int32_t>(std::clamp<std::int64_t>(to, 0, count))};
}

}  // namespace

void CaveField::add(std::size_t i, CaveGap gap) {
    if (counts_[i] == kCavesPerColumnMax) {
        return;
    }
    if (counts_[i] == 0) {
        places_[i] = pool_used_++;
        if (pool_.size() < pool_used_ * kCavesPerColumnMax) {
            pool_.resize(std::size_t{2} * pool_used_ * kCavesPerColumnMax);
        }
    }
    pool_[places_[i] * kCavesPerColumnMax + counts_[i]++] = gap;
}

void CaveField::add_tube(const Tube& tube, const float* ground, const RectangleShape& shape,
                         const RowKernels& kernels) {
    std::array<Touched, kRectangleSideMax> reached;  // columns of each row
    const Touched rows = touched(tube.z, tube.z_min, tube.z_max, shape.z0, shape.length);
    for (std::int32_t row = rows.first; row < rows.end; ++row) {
        reached[static_cast<std::size_t>(row)] = {.first = shape.width, .end = 0};
    }
    for (const TubePiece& piece : pieces_of(tube)) {
        const float most = 1.45F * std::max(piece.radius, piece.radius + piece.dr) + 1.0F;
        const float x_end = piece.x + piece.ex;
        const float z_end = piece.z + piece.ez;
        const Touched own_columns = touched(tube.x, std::min(piece.x, x_end) - most,
                                            std::max(piece.x, x_end) + most, shape.x0, shape.width);
        const Touched own_rows = touched(tube.z, std::min(piece.z, z_end) - most,
                                         std::max(piece.z, z_end) + most, shape.z0, shape.length);
        if (own_columns.first >= own_columns.end) {
            continue;
        }
        for (std::int32_t row = own_rows.first; row < own_rows.end; ++row) {
            Touched& columns = reached[static_cast<std::size_t>(row)];
            columns.first = std::min(columns.first, own_columns.first);
            columns.end = std::max(columns.end, own_columns.end);
            const std::int32_t first = row * shape.stride() + own_columns.first;
            kernels.landscape->tube({.floor = tube_floor_.data() + first,
                                     .lid = tube_lid_.data() + first,
                                     .rough = rough_.data() + first,
                                     .ragged = ragged_.data() + first,
                                     .x = static_cast<float>(shape.x0 + own_columns.first - tube.x),
                                     .z = static_cast<float>(shape.z0 + row - tube.z),
                                     .count = own_columns.end - own_columns.first},
                                    piece);
        }
    }
    for (std::int32_t row = rows.first; row < rows.end; ++row) {
        const Touched columns = reached[static_cast<std::size_t>(row)];
        for (std::int32_t column = columns.first; column < columns.end; ++column) {
            const std::size_t i = shape.index(column, row);
            if (tube_lid_[i] > tube_floor_[i] && tube_floor_[i] < ground[i]) {
                add(i, {.floor = tube_floor_[i], .lid = tube_lid_[i]});
            }
            tube_floor_[i] = kSky;
            tube_lid_[i] = -kSky;
        }
    }
}

void CaveField::build(const CaveConstants& constants, const CaveGraph& graph, const float* ground,
                      const RectangleShape& shape, const RowKernels& kernels,
                      NoiseBuffers& buffers) {
    clear();
    pool_used_ = 0;
    if (shape.step != 1) {
        return;
    }
    float highest = 0;
    for (std::int32_t row = 0; row < shape.length; ++row) {
        const float* const first = ground + static_cast<std::ptrdiff_t>(row) * shape.stride();
        highest = std::max(highest, *std::max_element(first, first + shape.width));
    }
    bool is_ready = false;
    const auto make_ready = [&] {
        if (is_ready) {
            return;
        }
        is_ready = true;
        const std::size_t size = shape.padded_size();
        counts_.assign(size, 0);
        places_.resize(size);
        rough_.resize(size);
        ragged_.resize(size);
        noise_rectangle(rough_.data(), constants.rough, shape, kernels, buffers);
        noise_rectangle(ragged_.data(), constants.ragged, shape, kernels, buffers);
        tube_floor_.assign(size, kSky);
        tube_lid_.assign(size, -kSky);
    };
    const auto add_doline = [&](const Doline& doline) {
        const float most = 1.45F * doline.radius + 1.0F;
        const Touched columns = touched(doline.x, -most, most, shape.x0, shape.width);
        const Touched rows = touched(doline.z, -most, most, shape.z0, shape.length);
        if (columns.first >= columns.end || rows.first >= rows.end || doline.y >= highest) {
            return;
        }
        make_ready();
        for (std::int32_t row = rows.first; row < rows.end; ++row) {
            for (std::int32_t column = columns.first; column < columns.end; ++column) {
                const std::size_t i = shape.index(column, row);
                const auto x = static_cast<float>(shape.x0 + column - doline.x);
                const auto z = static_cast<float>(shape.z0 + row - doline.z);
                const float r = doline.radius * (1.0F + 0.25F * rough_[i] + 0.15F * ragged_[i]);
                if (x * x + z * z < r * r && doline.y < ground[i]) {
                    add(i, {.floor = doline.y, .lid = kSky});
                }
            }
        }
    };
    for (const CaveCell& cell : graph.cells()) {
        for (const Tube& tube : cell.tubes) {
            const Touched columns = touched(tube.x, tube.x_min, tube.x_max, shape.x0, shape.width);
            const Touched rows = touched(tube.z, tube.z_min, tube.z_max, shape.z0, shape.length);
            if (columns.first < columns.end && rows.first < rows.end && tube.y_min < highest) {
                make_ready();
                add_tube(tube, ground, shape, kernels);
            }
        }
    }
    for (const CaveCell& cell : graph.cells()) {
        for (const Doline& doline : cell.dolines) {
            add_doline(doline);
        }
    }
}

void cut_funnels(float* ground, const float* allowed, const CaveGraph& graph,
                 const RectangleShape& shape) {
    const auto cut = [&](const Doline& doline) {
        const float most = doline.radius + kFunnel + 1.0F;
        const Touched columns = touched(doline.x, -most, most, shape.x0, shape.width);
        const Touched rows = touched(doline.z, -most, most, shape.z0, shape.length);
        for (std::int32_t row = rows.first; row < rows.end; ++row) {
            for (std::int32_t column = columns.first; column < columns.end; ++column) {
                const std::size_t i = shape.index(column, row);
                const auto x = static_cast<float>(shape.x0 + column - doline.x);
                const auto z = static_cast<float>(shape.z0 + row - doline.z);
                const float out = std::sqrt(x * x + z * z) - doline.radius;
                const float down = 1.0F - smooth_step(0, kFunnel, out);
                ground[i] -= kFunnel * down * allowed[i];
            }
        }
    };
    for (const CaveCell& cell : graph.cells()) {
        std::for_each(cell.dolines.begin(), cell.dolines.end(), cut);
    }
}

}  // namespace terrane
