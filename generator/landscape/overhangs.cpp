#include "generator/landscape/overhangs.h"

#include "generator/landscape/numbers.h"
#include "generator/terrain/random.h"

#include <algorithm>
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
    for (std::int32_t z = 0; z < shape.length; ++z) {
        for (std::int32_t d = -reach; d <= reach; ++d) {
            for (std::int32_t x = std::max(0, -d); x < std::min(shape.width, shape.width - d);
                 ++x) {
                const auto i = static_cast<std::size_t>(z * stride + x);
                rows[i] = std::max(rows[i], values[static_cast<std::size_t>(z * stride + x + d)]);
            }
        }
    }
    for (std::int32_t z = 0; z < shape.length; ++z) {
        for (std::int32_t d = std::max(-reach, -z); d <= std::min(reach, shape.length - 1 - z);
             ++d) {
            for (std::int32_t x = 0; x < shape.width; ++x) {
                const auto i = static_cast<std::size_t>(z * stride + x);
                highest[i] =
                    std::max(highest[i], rows[static_cast<std::size_t>((z + d) * stride + x)]);
            }
        }
    }
}

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
    overhangs_.assign(shape.padded_size(), {});
    const auto margin_x = static_cast<std::int32_t>(shape.x0 - field.x0);
    const auto margin_z = static_cast<std::int32_t>(shape.z0 - field.z0);
    for (std::int32_t z = 0; z < shape.length; ++z) {
        for (std::int32_t x = 0; x < shape.width; ++x) {
            const auto i = static_cast<std::size_t>(z * shape.stride() + x);
            const auto center =
                static_cast<std::size_t>((z + margin_z) * field.stride() + x + margin_x);
            const float over = input.raw[center] - input.moved[center];
            if (highest_[center] <= over) {
                continue;
            }
            float raw_top = 0;
            std::size_t k = 0;
            for (const std::size_t ledge : constants.ledges) {
                for (; k <= ledge; ++k) {
                    const float* const top = layers.first + k * layers.plane + i;
                    const float thickness = k > 0 ? *top - *(top - layers.plane) : *top;
                    raw_top += thickness * resistance.layers[k].cost;
                }
                const float* const top = layers.first + ledge * layers.plane + i;
                const float thickness = *top - *(top - layers.plane);
                if (raw_top > highest_[center]) {
                    break;  // higher layers have no lip either
                }
                if (raw_top <= over || thickness <= kThickLeast) {
                    continue;
                }
                float e = 1;
                for (std::int32_t dz = -constants.reach; dz <= constants.reach; ++dz) {
                    for (std::int32_t dx = -constants.reach; dx <= constants.reach; ++dx) {
                        const auto j = static_cast<std::size_t>(
                            static_cast<std::ptrdiff_t>(center) + dz * field.stride() + dx);
                        if (over_[j] < raw_top) {
                            continue;
                        }
                        const float distance = std::sqrt(static_cast<float>(dx * dx + dz * dz));
                        if (std::abs(input.moved[j] - input.moved[center]) <= 0.4F * distance) {
                            e = std::min(e, distance / reach_[j]);
                        }
                    }
                }
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
