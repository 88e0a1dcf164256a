#include "generator/landscape/caves.h"
#include "generator/landscape/numbers.h"

#include <algorithm>
#include <cmath>

namespace terrane {
namespace {

constexpr float kFlatFloor = 0.62F;
constexpr float kCeiling = 0.95F;
constexpr float kFunnel = 9;  ///< columns around a doline's shaft, and its depth in voxels
constexpr float kSky = 1e6F;

/// A piece of a tube, prepared.
struct Piece {
    TubePoint from;
    float ex = 0;
    float ez = 0;
    float inverse_square = 0;
    float dy = 0;
    float dr = 0;
    float steep = 1;  ///< sqrt(1 + slope^2)
    float y_min = 0;
    float y_max = 0;
};

std::array<Piece, kTubePoints - 1> pieces_of(const Tube& tube) {
    std::array<Piece, kTubePoints - 1> pieces;
    for (std::size_t p = 0; p + 1 < kTubePoints; ++p) {
        const TubePoint& a = tube.points[p];
        const TubePoint& b = tube.points[p + 1];
        Piece& piece = pieces[p];
        piece = {.from = a,
                 .ex = b.x - a.x,
                 .ez = b.z - a.z,
                 .dy = b.y - a.y,
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
            pool_.resize(2 * pool_used_ * kCavesPerColumnMax);
        }
    }
    pool_[places_[i] * kCavesPerColumnMax + counts_[i]++] = gap;
}

void CaveField::add_tube(const Tube& tube, const RectangleShape& shape) {
    const Touched columns = touched(tube.x, tube.x_min, tube.x_max, shape.x0, shape.width);
    const Touched rows = touched(tube.z, tube.z_min, tube.z_max, shape.z0, shape.length);
    if (columns.first >= columns.end || rows.first >= rows.end) {
        return;
    }
    for (const Piece& piece : pieces_of(tube)) {
        const float most = 1.45F * std::max(piece.from.radius, piece.from.radius + piece.dr) + 1.0F;
        const float x_end = piece.from.x + piece.ex;
        const float z_end = piece.from.z + piece.ez;
        const Touched own_columns =
            touched(tube.x, std::min(piece.from.x, x_end) - most,
                    std::max(piece.from.x, x_end) + most, shape.x0, shape.width);
        const Touched own_rows =
            touched(tube.z, std::min(piece.from.z, z_end) - most,
                    std::max(piece.from.z, z_end) + most, shape.z0, shape.length);
        for (std::int32_t row = own_rows.first; row < own_rows.end; ++row) {
            const float az = static_cast<float>(shape.z0 + row - tube.z) - piece.from.z;
            for (std::int32_t column = own_columns.first; column < own_columns.end; ++column) {
                const auto i = static_cast<std::size_t>(row * shape.stride() + column);
                const float ax = static_cast<float>(shape.x0 + column - tube.x) - piece.from.x;
                const float t = clamp01((ax * piece.ex + az * piece.ez) * piece.inverse_square);
                const float qx = ax - t * piece.ex;
                const float qz = az - t * piece.ez;
                const float r = (piece.from.radius + t * piece.dr) *
                                (1.0F + 0.25F * rough_[i] + 0.15F * ragged_[i]);
                const float rest = r * r - (qx * qx + qz * qz);
                if (rest <= 0) {
                    continue;
                }
                const float hh = std::sqrt(rest);
                const float up = kCeiling * (1.0F + 0.5F * ragged_[i]);
                const float y = piece.from.y + t * piece.dy;
                const float reach = hh * piece.steep;
                CaveGap& gap = tube_[i];
                gap.lid = std::max(gap.lid, std::min(y + up * reach, piece.y_max + up * hh));
                gap.floor = std::min(
                    gap.floor, std::max(y - kFlatFloor * reach, piece.y_min - kFlatFloor * hh));
            }
        }
    }
    for (std::int32_t row = rows.first; row < rows.end; ++row) {
        for (std::int32_t column = columns.first; column < columns.end; ++column) {
            const auto i = static_cast<std::size_t>(row * shape.stride() + column);
            if (tube_[i].lid > tube_[i].floor) {
                add(i, tube_[i]);
            }
            tube_[i] = {.floor = kSky, .lid = -kSky};
        }
    }
}

void CaveField::build(const CaveConstants& constants, const CaveGraph& graph,
                      const RectangleShape& shape, const RowKernels& kernels,
                      NoiseBuffers& buffers) {
    counts_.clear();
    pool_used_ = 0;
    if (shape.step != 1 || (graph.tubes().empty() && graph.dolines().empty())) {
        return;
    }
    const std::size_t size = shape.padded_size();
    counts_.assign(size, 0);
    places_.assign(size, 0);
    rough_.resize(size);
    ragged_.resize(size);
    noise_rectangle(rough_.data(), constants.rough, shape, kernels, buffers);
    noise_rectangle(ragged_.data(), constants.ragged, shape, kernels, buffers);
    tube_.assign(size, {.floor = kSky, .lid = -kSky});
    for (const Tube& tube : graph.tubes()) {
        add_tube(tube, shape);
    }
    for (const Doline& doline : graph.dolines()) {
        const float most = 1.45F * doline.radius + 1.0F;
        const Touched columns = touched(doline.x, -most, most, shape.x0, shape.width);
        const Touched rows = touched(doline.z, -most, most, shape.z0, shape.length);
        for (std::int32_t row = rows.first; row < rows.end; ++row) {
            for (std::int32_t column = columns.first; column < columns.end; ++column) {
                const auto i = static_cast<std::size_t>(row * shape.stride() + column);
                const auto x = static_cast<float>(shape.x0 + column - doline.x);
                const auto z = static_cast<float>(shape.z0 + row - doline.z);
                const float r = doline.radius * (1.0F + 0.25F * rough_[i] + 0.15F * ragged_[i]);
                if (x * x + z * z < r * r) {
                    add(i, {.floor = doline.y, .lid = kSky});
                }
            }
        }
    }
}

void cut_funnels(float* ground, const float* allowed, const CaveGraph& graph,
                 const RectangleShape& shape) {
    for (const Doline& doline : graph.dolines()) {
        const float most = doline.radius + kFunnel + 1.0F;
        const Touched columns = touched(doline.x, -most, most, shape.x0, shape.width);
        const Touched rows = touched(doline.z, -most, most, shape.z0, shape.length);
        for (std::int32_t row = rows.first; row < rows.end; ++row) {
            for (std::int32_t column = columns.first; column < columns.end; ++column) {
                const auto i = static_cast<std::size_t>(row * shape.stride() + column);
                const auto x = static_cast<float>(shape.x0 + column - doline.x);
                const auto z = static_cast<float>(shape.z0 + row - doline.z);
                const float out = std::sqrt(x * x + z * z) - doline.radius;
                const float down = 1.0F - smooth_step(0, kFunnel, out);
                ground[i] -= kFunnel * down * allowed[i];
            }
        }
    }
}

}  // namespace terrane
