#include "generator/baseline/row_perlin.h"

#include "generator/terrain/random.h"
#include "protocol/base/clones.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {
namespace {

// The twelve edges of a cube, four of them twice: Perlin's improved gradients.
constexpr std::array<std::array<float, 3>, 16> kGradients = {{{1, 1, 0},
                                                              {-1, 1, 0},
                                                              {1, -1, 0},
                                                              {-1, -1, 0},
                                                              {1, 0, 1},
                                                              {-1, 0, 1},
                                                              {1, 0, -1},
                                                              {-1, 0, -1},
                                                              {0, 1, 1},
                                                              {0, -1, 1},
                                                              {0, 1, -1},
                                                              {0, -1, -1},
                                                              {1, 1, 0},
                                                              {-1, 1, 0},
                                                              {0, -1, 1},
                                                              {0, -1, -1}}};

/// One cell's part of a row: from the line at its left to the line at its right.
struct CellPart {
    float slope_left = 0;
    float value_left = 0;
    float slope_right = 0;
    float value_right = 0;
};

TERRANE_CLONES
void fill_cell(float* out, const float* fraction, const float* fade, std::int32_t count,
               CellPart part) {
    for (std::int32_t i = 0; i < count; ++i) {
        const float left = part.value_left + part.slope_left * fraction[i];
        const float right = part.value_right + part.slope_right * (fraction[i] - 1.0F);
        out[i] = left + fade[i] * (right - left);
    }
}

}  // namespace

RowPerlin::RowPerlin(std::uint64_t seed, float period) : seed_(seed), period_(period) {}

void RowPerlin::fill_axis(Axis& axis, std::int64_t first, std::int32_t count) const {
    const auto size = static_cast<std::size_t>(count);
    axis.cell.resize(size);
    axis.fraction.resize(size);
    axis.fade.resize(size);
    for (std::size_t i = 0; i < size; ++i) {
        const double at = static_cast<double>(first + static_cast<std::int64_t>(i)) /
                          static_cast<double>(period_);
        const double cell = std::floor(at);
        if (i == 0) {
            axis.cell_first = static_cast<std::int64_t>(cell);
        }
        const auto t = static_cast<float>(at - cell);
        axis.cell[i] = static_cast<std::int32_t>(static_cast<std::int64_t>(cell) - axis.cell_first);
        axis.fraction[i] = t;
        axis.fade[i] = t * t * t * (t * (t * 6 - 15) + 10);
    }
    axis.cells = axis.cell.back() + 1;
}

void RowPerlin::hash_lattice() {
    gradients_.clear();
    for (std::int64_t z = z_.cell_first; z <= z_.cell_first + z_.cells; ++z) {
        for (std::int64_t y = y_.cell_first; y <= y_.cell_first + y_.cells; ++y) {
            for (std::int64_t x = x_.cell_first; x <= x_.cell_first + x_.cells; ++x) {
                const auto& gradient = kGradients[key(seed_, x, y, z) >> 60U];
                gradients_.insert(gradients_.end(), gradient.begin(), gradient.end());
            }
        }
    }
}

void RowPerlin::fold_row(std::int32_t y, std::int32_t z) {
    const auto j = static_cast<std::size_t>(y);
    const auto k = static_cast<std::size_t>(z);
    const float fy = y_.fraction[j];
    const float fz = z_.fraction[k];
    const float v = y_.fade[j];
    const float w = z_.fade[k];
    const auto columns = static_cast<std::size_t>(x_.cells) + 1;
    const auto rows = static_cast<std::size_t>(y_.cells) + 1;
    const auto at = [&](std::size_t x, int dy, int dz) {
        const std::size_t row = static_cast<std::size_t>(y_.cell[j]) + static_cast<std::size_t>(dy);
        const std::size_t plane =
            static_cast<std::size_t>(z_.cell[k]) + static_cast<std::size_t>(dz);
        return &gradients_[3 * ((plane * rows + row) * columns + x)];
    };
    const std::array<float, 4> weight = {(1 - v) * (1 - w), v * (1 - w), (1 - v) * w, v * w};
    for (std::size_t x = 0; x < columns; ++x) {
        float slope = 0;
        float value = 0;
        for (int corner = 0; corner < 4; ++corner) {
            const int dy = corner & 1;
            const int dz = corner >> 1;
            const float* g = at(x, dy, dz);
            const float part = weight[static_cast<std::size_t>(corner)];
            slope += part * g[0];
            value += part *
                     (g[1] * (fy - static_cast<float>(dy)) + g[2] * (fz - static_cast<float>(dz)));
        }
        lines_[2 * x] = slope;
        lines_[2 * x + 1] = value;
    }
}

void RowPerlin::fill(float* out, const VoxelBox& box) {
    fill_axis(x_, box.x0, box.width);
    fill_axis(y_, box.y0, box.height);
    fill_axis(z_, box.z0, box.length);
    hash_lattice();
    lines_.resize(2 * (static_cast<std::size_t>(x_.cells) + 1));
    std::vector<std::int32_t> begin(static_cast<std::size_t>(x_.cells) + 1, box.width);
    for (std::int32_t i = box.width - 1; i >= 0; --i) {
        begin[static_cast<std::size_t>(x_.cell[static_cast<std::size_t>(i)])] = i;
    }
    for (std::int32_t z = 0; z < box.length; ++z) {
        for (std::int32_t y = 0; y < box.height; ++y) {
            fold_row(y, z);
            for (std::size_t cell = 0; cell + 1 < begin.size(); ++cell) {
                fill_cell(out + begin[cell], x_.fraction.data() + begin[cell],
                          x_.fade.data() + begin[cell], begin[cell + 1] - begin[cell],
                          {.slope_left = lines_[2 * cell],
                           .value_left = lines_[2 * cell + 1],
                           .slope_right = lines_[2 * cell + 2],
                           .value_right = lines_[2 * cell + 3]});
            }
            out += box.width;
        }
    }
}

}  // namespace terrane
