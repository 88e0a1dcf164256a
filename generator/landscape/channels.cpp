#include "generator/landscape/channels.h"

#include "generator/landscape/numbers.h"
#include "generator/landscape/relief.h"
#include "generator/landscape/river_graph.h"
#include "generator/terrain/kernels/landscape_kernels.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/kernels/vector_pad.h"
#include "generator/terrain/noise.h"
#include "generator/world/world_definition.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {
namespace {

constexpr float kMeets = 3.0F;       ///< half widths: how far a river's level counts for others
constexpr float kLakeWidths = 2.5F;  ///< a sink's lake, in half widths of its river
constexpr float kFreeboard = 1.4F;   ///< voxels from the banks down to the water
constexpr float kFar = 1e9F;

float half_width_of(const ChannelConstants& constants, const Reach& reach, float along) {
    const float width = 0.15F + constants.rivers * (reach.measure + reach.measure_change * along);
    return reach.is_sink ? kLakeWidths * width + 2.0F : width;
}

bool is_wet(const ChannelConstants& constants, const Reach& reach) {
    if (reach.is_sink && (reach.measure <= 0 || reach.level < constants.sea)) {
        return false;
    }
    return std::max(half_width_of(constants, reach, 0), half_width_of(constants, reach, 1)) >=
           kDryWidth;
}

float out_of(float half_width) {
    return 5.0F * half_width + 2.0F;
}

/// How far columns of a region look aside for their river, least and most.
struct Wander {
    float x_min = kFar;
    float x_max = -kFar;
    float z_min = kFar;
    float z_max = -kFar;
};

Wander wander_of(const ReliefRasters& relief, const RectangleShape& shape) {
    Wander wander;
    for (std::int32_t row = 0; row < shape.length; ++row) {
        for (std::int32_t column = 0; column < shape.width; ++column) {
            const std::size_t i = shape.index(column, row);
            const float x = relief.wander_x[i];
            const float z = relief.wander_z[i];
            wander = {.x_min = std::min(wander.x_min, x),
                      .x_max = std::max(wander.x_max, x),
                      .z_min = std::min(wander.z_min, z),
                      .z_max = std::max(wander.z_max, z)};
        }
    }
    return wander;
}

/// The columns, or rows, from `first` to before `end` that may look at low..high, in columns from
/// the region's first one.
struct Lookers {
    std::int32_t first = 0;
    std::int32_t end = 0;
};

Lookers lookers(float low, float high, float wander_min, float wander_max, std::int64_t step,
                std::int32_t count) {
    const float inverse = 1.0F / static_cast<float>(step);
    const auto most = static_cast<float>(count);
    // A column of slack for float rounding on each side.
    const float first = std::floor((low - wander_max - 1.0F) * inverse);
    const float end = std::floor((high - wander_min + 1.0F) * inverse) + 2.0F;
    return {.first = static_cast<std::int32_t>(std::clamp(first, 0.0F, most)),
            .end = static_cast<std::int32_t>(std::clamp(end, 0.0F, most))};
}

float channel_height(const NearReach& near, float ground) {
    const float d = near.distance;
    const float w = near.half_width;
    if (d < w) {
        return near.level - 1.0F - std::min(0.8F + 0.5F * w, w) * (1.0F - d * d / (w * w));
    }
    return near.level - 1.0F +
           (ground - near.level + 1.0F) * smooth_step(0, 1, (d - w) / (out_of(w) - w));
}

}  // namespace

void find_near(std::vector<NearReach>& found, const ChannelConstants& constants,
               const ReliefRasters& relief, const RiverGraph& rivers, const RectangleShape& shape,
               const RowKernels& kernels, float beyond) {
    found.clear();
    const Wander wander = wander_of(relief, shape);
    for (const Reach& reach : rivers.reaches()) {
        if (!is_wet(constants, reach)) {
            continue;
        }
        const float widest =
            std::max(half_width_of(constants, reach, 0), half_width_of(constants, reach, 1));
        const float out = std::max(out_of(widest), kWetWidths * widest + beyond);
        const auto x0 = static_cast<float>(reach.x - shape.x0);
        const auto z0 = static_cast<float>(reach.z - shape.z0);
        const Lookers columns = lookers(x0 + reach.x_min - out, x0 + reach.x_max + out,
                                        wander.x_min, wander.x_max, shape.step, shape.width);
        const Lookers rows = lookers(z0 + reach.z_min - out, z0 + reach.z_max + out, wander.z_min,
                                     wander.z_max, shape.step, shape.length);
        if (columns.first >= columns.end) {
            continue;
        }
        const ReachShape shape_of = shape_of_reach(reach);
        std::array<float, kRectangleSideMax + kVectorPad> square;
        std::array<float, kRectangleSideMax + kVectorPad> along;
        for (std::int32_t row = rows.first; row < rows.end; ++row) {
            const std::size_t first = shape.index(columns.first, row);
            const std::int32_t count = columns.end - columns.first;
            // From the reach, not from the region: the same bits for every region.
            kernels.landscape->near_reach(
                {.square = square.data(),
                 .along = along.data(),
                 .wander_x = relief.wander_x.data() + first,
                 .wander_z = relief.wander_z.data() + first,
                 .x = static_cast<float>(shape.x0 + columns.first * shape.step - reach.x),
                 .z = static_cast<float>(shape.z0 + row * shape.step - reach.z),
                 .step = static_cast<float>(shape.step),
                 .count = count},
                shape_of);
            for (std::size_t n = 0; n < static_cast<std::size_t>(count); ++n) {
                if (square[n] >= out * out) {
                    continue;
                }
                const float half_width = half_width_of(constants, reach, along[n]);
                const float reach_out =
                    std::max(out_of(half_width), kWetWidths * half_width + beyond);
                if (half_width < kDryWidth || square[n] >= reach_out * reach_out) {
                    continue;
                }
                found.push_back({.column = first + n,
                                 .distance = std::sqrt(square[n]),
                                 .half_width = half_width,
                                 .level = reach.level + reach.level_change * along[n]});
            }
        }
    }
}

ChannelConstants::ChannelConstants(const WorldDefinition& definition)
    : rivers(static_cast<float>(definition.relief.rivers)) {
    if (definition.relief.sea_level) {
        sea = static_cast<float>(*definition.relief.sea_level);
    }
}

void cut_channels(float* ground, ChannelRasters& out, const ChannelConstants& constants,
                  const ReliefRasters& relief, const RiverGraph& rivers,
                  const RectangleShape& shape, const RowKernels& kernels) {
    const std::size_t size = shape.padded_size();
    out.water.assign(size, kNoWater);
    out.nearness.assign(size, kFar);
    out.weight.assign(size, 0);
    out.near.clear();
    if (relief.is_smooth && constants.rivers > 0) {
        find_near(out.near, constants, relief, rivers, shape, kernels, 0);
        for (const NearReach& near : out.near) {
            const std::size_t i = near.column;
            const float nearness = near.distance / near.half_width;
            out.nearness[i] = std::min(out.nearness[i], nearness);
            if (nearness < kMeets) {
                // Where rivers meet, a mean that passes from one level to the other without a step:
                // over more than their width, or it would be a weir.
                const float weight = (kMeets - nearness) * (kMeets - nearness);
                out.water[i] =
                    (out.weight[i] > 0 ? out.water[i] : 0.0F) + weight * (near.level - kFreeboard);
                out.weight[i] += weight;
            }
        }
        for (const NearReach& near : out.near) {
            const std::size_t i = near.column;
            ground[i] = std::min(ground[i], channel_height(near, ground[i]));
        }
    }
    if (out.near.empty() && constants.sea == kNoWater) {
        out.is_wet = false;
        return;
    }
    std::int32_t wet = 0;
    for (std::size_t i = 0; i < size; ++i) {
        const float river = out.nearness[i] < kWetWidths ? out.water[i] / out.weight[i] : kNoWater;
        const float water = std::max(river, constants.sea);
        wet |= static_cast<std::int32_t>(water > ground[i]);
        out.water[i] = water > ground[i] ? water : kNoWater;
    }
    out.is_wet = wet != 0;
}

}  // namespace terrane
