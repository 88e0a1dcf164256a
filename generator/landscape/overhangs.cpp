#include "generator/landscape/overhangs.h"

#include "generator/landscape/numbers.h"
#include "generator/landscape/resistance.h"
#include "generator/terrain/kernels/landscape_kernels.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/kernels/vector_pad.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/random.h"
#include "generator/terrain/region.h"
#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr float kHard = 1.3F;
constexpr float kSoft = 0.9F;
constexpr float kThickLeast = 4;      ///< voxels
constexpr float kGapLeast = 1.25F;    ///< voxels
constexpr float kCrestLeast = 0.27F;  ///< lower down, the land goes over from the rock's shape
constexpr float kCutMost = 0.5F;      ///< voxels
constexpr float kNothing = -1e9F;

/// to[i] = the greatest of from[i], from[i + stride], ... from[i + 2 * reach * stride]: windows of
/// 1, 2, 4, ... values, then two that meet. `count` values each; both are memory of as many.
const float* slide(float* one, float* other, std::size_t count, std::size_t stride,
                   std::int32_t reach) {
    const std::size_t window = 2 * static_cast<std::size_t>(reach) + 1;
    const auto widen = [&](const float* __restrict from, float* __restrict to, std::size_t by) {
        const std::size_t offset = by * stride;
        const std::size_t end = count > offset ? count - offset : 0;
        for (std::size_t i = 0; i < end; ++i) {
            to[i] = from[i] < from[i + offset] ? from[i + offset] : from[i];
        }
        std::copy(from + end, from + count, to + end);
    };
    std::size_t width = 1;
    for (; 2 * width <= window; width *= 2) {
        widen(one, other, width);
        std::swap(one, other);
    }
    if (width < window) {
        widen(one, other, window - width);
        std::swap(one, other);
    }
    return one;
}

/// rows[i] = the greatest of `values` within `reach` columns in its row, highest[i] likewise of the
/// rows within `reach`, for what lies so far inside.
void dilate(std::vector<float>& highest, std::vector<float>& rows, std::vector<float>& memory,
            const std::vector<float>& values, const RectangleShape& shape, std::int32_t reach) {
    const std::size_t size = values.size();
    const auto dilate_by = [&](std::vector<float>& of, std::size_t stride) {
        memory.resize(size);
        if (slide(of.data(), memory.data(), size, stride, reach) != of.data()) {
            std::swap(of, memory);
        }
        const auto ahead = static_cast<std::ptrdiff_t>(static_cast<std::size_t>(reach) * stride);
        std::copy_backward(of.begin(), of.end() - ahead, of.end());
    };
    rows = values;
    dilate_by(rows, 1);  // one row after the other: their ends are not asked for
    highest = rows;
    dilate_by(highest, static_cast<std::size_t>(shape.stride()));
}

static_assert(2 * static_cast<std::int32_t>(kOverhangMax) < kVectorPad, "a row of lips is a block");

/// Distances to columns so far away, a block of them for each row from the middle's on.
std::vector<float> lip_distances(std::int32_t reach) {
    constexpr float kFar = 1e9F;
    std::vector<float> distances((static_cast<std::size_t>(reach) + 1) * kVectorPad, kFar);
    std::size_t row = 0;
    for (std::int32_t z = 0; z <= reach; ++z, row += kVectorPad) {
        std::size_t at = row;
        for (std::int32_t x = -reach; x <= reach; ++x, ++at) {
            distances[at] = std::sqrt(static_cast<float>(x * x + z * z));
        }
    }
    return distances;
}

}  // namespace

OverhangConstants::OverhangConstants(const WorldDefinition& definition,
                                     const ResistanceConstants& resistance)
    : reach(definition.relief.height > 0 ? definition.relief.overhang : 0),
      distances(lip_distances(reach)),
      noise(Noise::make(key(definition.seed, LandscapeTag::soil, 1), 40, 2)) {
    for (std::size_t k = 1; k < resistance.layers.size(); ++k) {
        if (resistance.layers[k].resistance > kHard &&
            resistance.layers[k - 1].resistance < kSoft) {
            ledges.push_back(k);
        }
    }
}

/// A ledge leans out where its top is above the column's own raw height, but not above every lip.
/// Whether any does.
bool OverhangField::find_ledges(const OverhangConstants& constants,
                                const ResistanceConstants& resistance, const OverhangInput& input,
                                Region& region, const TerrainConstants& terrain,
                                const RowKernels& kernels) {
    const RectangleShape& field = input.field;
    const RectangleShape& shape = region.shape;
    const std::size_t plane = region.plane_size();
    const auto margin_x = static_cast<std::int32_t>(shape.x0 - field.x0);
    const auto margin_z = static_cast<std::int32_t>(shape.z0 - field.z0);
    raw_tops_.resize(constants.ledges.size() * plane);
    raw_top_.assign(plane, 0);
    lean_.assign(shape.padded_size(), 0);
    std::uint32_t any = 0;
    std::size_t k = 0;
    for (std::size_t l = 0; l < constants.ledges.size(); ++l) {
        const std::size_t ledge = constants.ledges[l];
        for (; k <= ledge; ++k) {
            if (k == region.layers_built) {
                build_layer(region, terrain, kernels);
            }
            const float* const top = region.heights.data() + k * plane;
            kernels.landscape->raise_tops(raw_top_.data(), k == 0 ? nullptr : top - plane, top,
                                          resistance.layers[k].cost,
                                          static_cast<std::int32_t>(plane));
        }
        const float* const top = region.heights.data() + ledge * plane;
        std::uint32_t any_here = 0;
        std::uint32_t any_later = 0;  // some lip is higher: layers above may lean out
        for (std::int32_t z = 1; z + 1 < shape.length; ++z) {
            const std::size_t first = shape.index(0, z);
            const std::size_t center = field.index(margin_x, z + margin_z);
            const LedgeSeen seen =
                kernels.landscape->ledge({.lean = lean_.data() + first + 1,
                                          .highest = highest_.data() + center + 1,
                                          .raw = input.raw + center + 1,
                                          .moved = input.moved + center + 1,
                                          .crest = input.crest + center + 1,
                                          .raw_top = raw_top_.data() + first + 1,
                                          .top = top + first + 1,
                                          .bottom = top - plane + first + 1,
                                          .bit = std::uint32_t{1} << l,
                                          .crest_least = kCrestLeast,
                                          .thick_least = kThickLeast,
                                          .count = shape.width - 2});
            any_here |= seen.leans;
            any_later |= seen.is_lower;
        }
        if (any_here != 0) {
            std::copy_n(raw_top_.data(), plane, raw_tops_.data() + l * plane);
        }
        any |= any_here;
        if (any_later == 0) {
            break;
        }
    }
    return any != 0;
}

void OverhangField::build(const OverhangConstants& constants, const ResistanceConstants& resistance,
                          const OverhangInput& input, Region& region,
                          const TerrainConstants& terrain, const float* ground,
                          const RowKernels& kernels, NoiseBuffers& buffers) {
    const RectangleShape& shape = region.shape;
    overhangs_.clear();
    if (constants.reach == 0 || constants.ledges.empty() || shape.step != 1) {
        return;
    }
    const RectangleShape& field = input.field;
    const std::size_t size = field.padded_size();
    over_.resize(size);
    for (std::size_t i = 0; i < size; ++i) {
        // A column that can be no lip is as if it had no rock.
        const bool is_lip = (static_cast<int>(input.crest[i] >= kCrestLeast) &
                             static_cast<int>(input.fine[i] >= -1.0F)) != 0;
        const float over = input.raw[i] - input.moved[i];
        over_[i] = is_lip ? over : kNothing;
    }
    dilate(highest_, row_highest_, inverse_reach_, over_, field, constants.reach);
    if (!find_ledges(constants, resistance, input, region, terrain, kernels)) {
        return;
    }
    inverse_reach_.resize(size);
    noise_rectangle(inverse_reach_.data(), constants.noise, field, kernels, buffers);
    const auto most = static_cast<float>(constants.reach);
    for (std::size_t i = 0; i < size; ++i) {
        inverse_reach_[i] = 1.0F / (most * clamp01(0.6F + 1.6F * inverse_reach_[i]) + 0.5F);
    }
    const LayerHeights layers{.first = region.heights.data(), .plane = region.plane_size()};
    overhangs_.assign(shape.padded_size(), {});
    const auto margin_x = static_cast<std::int32_t>(shape.x0 - field.x0);
    const auto margin_z = static_cast<std::int32_t>(shape.z0 - field.z0);
    for (std::int32_t z = 1; z + 1 < shape.length; ++z) {
        for (std::int32_t x = 1; x + 1 < shape.width; ++x) {
            const std::size_t i = shape.index(x, z);
            const std::size_t center = field.index(x + margin_x, z + margin_z);
            for (std::uint32_t leans = lean_[i]; leans != 0; leans &= leans - 1) {
                const auto l = static_cast<std::size_t>(std::countr_zero(leans));
                const std::size_t ledge = constants.ledges[l];
                const float raw_top = raw_tops_[l * layers.plane + i];
                const float* const top = layers.first + ledge * layers.plane + i;
                const float thickness = *top - *(top - layers.plane);
                if (*top + input.moved[center] <= ground[i] + kGapLeast) {
                    continue;  // no lip of it would be high enough
                }
                const std::size_t begin = center - static_cast<std::size_t>(constants.reach);
                const float e = kernels.landscape->nearest_lip(
                    {.over = over_.data() + begin,
                     .row_highest = row_highest_.data() + center,
                     .moved = input.moved + begin,
                     .inverse_reaches = inverse_reach_.data() + begin,
                     .distances = constants.distances.data(),
                     .stride = field.stride(),
                     .reach = constants.reach,
                     .raw_top = raw_top,
                     .moved_here = input.moved[center]});
                const float lip = *top + input.moved[center] - 1.5F * e;
                const float bottom = lip - (0.45F * thickness * (1.0F - e * e) + 1.2F);
                if (e < 1 && lip > ground[i] + kGapLeast) {
                    overhangs_[i] = {.bottom = bottom,
                                     .top = lip,
                                     .ground = ground[i],
                                     .layer = static_cast<std::int32_t>(ledge)};
                    break;
                }
            }
        }
    }
}

void OverhangField::break_off(const float* ground) {
    for (std::size_t i = 0; i < overhangs_.size(); ++i) {
        Overhang& one = overhangs_[i];
        if (one.ground - ground[i] > kCutMost) {
            one.layer = -1;
        }
        one.bottom = one.bottom < ground[i] + kGapLeast ? ground[i] : one.bottom;
    }
}

}  // namespace terrane
