#include "generator/landscape/overhangs.h"

#include "generator/landscape/numbers.h"
#include "generator/terrain/random.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace terrane {
namespace {

constexpr float kHard = 1.3F;
constexpr float kSoft = 0.9F;
constexpr float kThickLeast = 4;    ///< voxels
constexpr float kGapLeast = 1.25F;  ///< voxels
constexpr float kNothing = -1e9F;

/// highest[i] = the greatest of `values` within `reach` columns either way, in a square.
void dilate(std::vector<float>& highest, std::vector<float>& rows, const std::vector<float>& values,
            const RectangleShape& shape, std::int32_t reach) {
    rows.assign(values.size(), kNothing);
    highest.assign(values.size(), kNothing);
    const std::int32_t stride = shape.stride();
    const auto raise = [](float* __restrict to, const float* __restrict from, std::int32_t count) {
        for (std::int32_t i = 0; i < count; ++i) {
            to[i] = to[i] < from[i] ? from[i] : to[i];
        }
    };
    for (std::int32_t z = 0; z < shape.length; ++z) {
        const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(z) * stride;
        for (std::int32_t d = -reach; d <= reach; ++d) {
            const std::int32_t first = std::max(0, -d);
            raise(rows.data() + row + first, values.data() + row + first + d,
                  std::min(shape.width, shape.width - d) - first);
        }
    }
    for (std::int32_t z = 0; z < shape.length; ++z) {
        for (std::int32_t d = std::max(-reach, -z); d <= std::min(reach, shape.length - 1 - z);
             ++d) {
            raise(highest.data() + static_cast<std::ptrdiff_t>(z) * stride,
                  rows.data() + static_cast<std::ptrdiff_t>(z + d) * stride, shape.width);
        }
    }
}

/// The nearest lip of a layer's top at `raw_top` around a column, as a share of what that lip
/// reaches; 1 if there is none so near. Rows and columns from the middle outwards, as far as they
/// can come nearer still: a lip never reaches farther than `farthest`.
struct LipSearch {
    const float* over;
    const float* row_highest;  ///< of `over` in the row within `reach` columns
    const float* moved;
    const float* reaches;
    std::ptrdiff_t stride;
    std::int32_t reach;
    float farthest;

    float nearest(std::ptrdiff_t center, float raw_top) const {
        float e = 1;
        for (std::int32_t dz = 0; dz <= reach; ++dz) {
            if (static_cast<float>(dz) / farthest >= e) {
                break;
            }
            e = nearest_in_row(e, center, dz, raw_top);
            if (dz > 0) {
                e = nearest_in_row(e, center, -dz, raw_top);
            }
        }
        return e;
    }

  private:
    float nearest_in_row(float e, std::ptrdiff_t center, std::int32_t dz, float raw_top) const {
        const std::ptrdiff_t row = center + dz * stride;
        if (row_highest[row] < raw_top) {
            return e;
        }
        for (std::int32_t dx = 0; dx <= reach; ++dx) {
            const float distance = std::sqrt(static_cast<float>(dx * dx + dz * dz));
            if (distance / farthest >= e) {
                break;
            }
            for (const std::ptrdiff_t j : {row - dx, row + dx}) {
                if (over[j] >= raw_top && std::abs(moved[j] - moved[center]) <= 0.4F * distance) {
                    e = std::min(e, distance / reaches[j]);
                }
            }
        }
        return e;
    }
};

}  // namespace

OverhangConstants::OverhangConstants(const WorldDefinition& definition,
                                     const ResistanceConstants& resistance)
    : reach(definition.relief.height > 0 ? definition.relief.overhang : 0),
      noise(Noise::make(key(definition.seed, LandscapeTag::soil, 1), 40, 2)) {
    for (std::size_t k = 1; k < resistance.layers.size(); ++k) {
        if (resistance.layers[k].resistance > kHard &&
            resistance.layers[k - 1].resistance < kSoft) {
            ledges.push_back(k);
        }
    }
}

/// A ledge leans out where its top is above the column's own raw height, but not above every lip.
void OverhangField::find_ledges(const OverhangConstants& constants,
                                const ResistanceConstants& resistance, const OverhangInput& input,
                                const RectangleShape& shape, const LayerHeights& layers) {
    const RectangleShape& field = input.field;
    const auto margin_x = static_cast<std::int32_t>(shape.x0 - field.x0);
    const auto margin_z = static_cast<std::int32_t>(shape.z0 - field.z0);
    raw_tops_.resize(constants.ledges.size() * layers.plane);
    lean_.assign(shape.padded_size(), 0);
    for (std::int32_t z = 0; z < shape.length; ++z) {
        const auto first = static_cast<std::size_t>(z * shape.stride());
        const auto center = static_cast<std::size_t>((z + margin_z) * field.stride() + margin_x);
        std::array<float, kRectangleSideMax> raw_top{};
        std::uint32_t* __restrict const lean = lean_.data() + first;
        const float* const highest = highest_.data() + center;
        const float* const raw = input.raw + center;
        const float* const moved = input.moved + center;
        std::size_t k = 0;
        for (std::size_t l = 0; l < constants.ledges.size(); ++l) {
            const std::size_t ledge = constants.ledges[l];
            const float* top = layers.first + k * layers.plane + first;
            for (; k <= ledge; ++k, top += layers.plane) {
                const float cost = resistance.layers[k].cost;
                float* __restrict const to = raw_top.data();
                for (std::int32_t x = 0; x < shape.width; ++x) {
                    const float thickness = k > 0 ? top[x] - (top - layers.plane)[x] : top[x];
                    to[x] += thickness * cost;
                }
            }
            top -= layers.plane;
            std::uint32_t any = 0;
            for (std::int32_t x = 0; x < shape.width; ++x) {
                const float thickness = top[x] - (top - layers.plane)[x];
                const bool leans = raw_top[static_cast<std::size_t>(x)] > raw[x] - moved[x] &&
                                   raw_top[static_cast<std::size_t>(x)] <= highest[x] &&
                                   thickness > kThickLeast;
                const std::uint32_t bit = leans ? std::uint32_t{1} << l : 0;
                lean[x] |= bit;
                any |= bit;
            }
            if (any != 0) {
                std::copy_n(raw_top.data(), shape.width,
                            raw_tops_.data() + l * layers.plane + first);
            }
        }
    }
}

void OverhangField::build(const OverhangConstants& constants, const ResistanceConstants& resistance,
                          const OverhangInput& input, const RectangleShape& shape,
                          const LayerHeights& layers, const float* ground,
                          const RowKernels& kernels, NoiseBuffers& buffers) {
    overhangs_.clear();
    if (constants.reach == 0 || constants.ledges.empty() || shape.step != 1) {
        return;
    }
    const RectangleShape& field = input.field;
    const std::size_t size = field.padded_size();
    reach_.resize(size);
    over_.resize(size);
    noise_rectangle(reach_.data(), constants.noise, field, kernels, buffers);
    const auto most = static_cast<float>(constants.reach);
    for (std::size_t i = 0; i < size; ++i) {
        reach_[i] = most * clamp01(0.6F + 1.6F * reach_[i]) + 0.5F;
        // A column that can be no lip is as if it had no rock.
        over_[i] = input.crest[i] >= 0.27F && input.fine[i] >= -1.0F ? input.raw[i] - input.moved[i]
                                                                     : kNothing;
    }
    dilate(highest_, row_highest_, over_, field, constants.reach);
    find_ledges(constants, resistance, input, shape, layers);
    const LipSearch lips{.over = over_.data(),
                         .row_highest = row_highest_.data(),
                         .moved = input.moved,
                         .reaches = reach_.data(),
                         .stride = field.stride(),
                         .reach = constants.reach,
                         .farthest = most + 0.5F};
    overhangs_.assign(shape.padded_size(), {});
    const auto margin_x = static_cast<std::int32_t>(shape.x0 - field.x0);
    const auto margin_z = static_cast<std::int32_t>(shape.z0 - field.z0);
    for (std::int32_t z = 0; z < shape.length; ++z) {
        for (std::int32_t x = 0; x < shape.width; ++x) {
            const auto i = static_cast<std::size_t>(z * shape.stride() + x);
            const auto center =
                static_cast<std::size_t>((z + margin_z) * field.stride() + x + margin_x);
            if (lean_[i] == 0) {
                continue;
            }
            for (std::size_t l = 0; l < constants.ledges.size(); ++l) {
                if ((lean_[i] >> l & 1U) == 0) {
                    continue;
                }
                const std::size_t ledge = constants.ledges[l];
                const float raw_top = raw_tops_[l * layers.plane + i];
                const float* const top = layers.first + ledge * layers.plane + i;
                const float thickness = *top - *(top - layers.plane);
                const float e = lips.nearest(static_cast<std::ptrdiff_t>(center), raw_top);
                const float lip = *top + input.moved[center] - 1.5F * e;
                const float bottom = lip - (0.45F * thickness * (1.0F - e * e) + 1.2F);
                if (e < 1 && lip > ground[i] + kGapLeast) {
                    overhangs_[i] = {.bottom = bottom < ground[i] + kGapLeast ? ground[i] : bottom,
                                     .top = lip,
                                     .layer = static_cast<std::int32_t>(ledge)};
                    break;
                }
            }
        }
    }
}

}  // namespace terrane
