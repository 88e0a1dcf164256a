// Channels: the rivers' beds, banks and water, cut at full resolution.
//
//     w = .15 + rivers * measure (half the width), d the distance, h the level, out = 5 w + 2
//     d < w:  h - 1 - min(.8 + .5 w, w) (1 - d^2/w^2)            the bed
//     else:   h - 1 + (ground - h + 1) step(0, 1, (d - w)/(out - w))
//     taken if lower: channels only cut, and where two are near, each cuts what the other left
//     water up to h - 1.4 where d < 1.3 w
//
// Reaches thinner than kDryWidth are dry. A sink that is not under the sea holds a lake. Levels
// whose relief is not smooth have no channels: they would be single wet columns.
#pragma once

#include "generator/landscape/relief.h"
#include "generator/landscape/river_graph.h"
#include "generator/terrain/noise.h"
#include "generator/world/world_definition.h"

#include <cstddef>
#include <vector>

namespace terrane {

inline constexpr float kDryWidth = 0.4F;   ///< half the width, columns
inline constexpr float kWetWidths = 1.3F;  ///< half widths of a river: where its water ends
inline constexpr float kNoWater = -1e9F;   ///< stands for a water level where there is none

struct ChannelConstants {
    float rivers = 0;
    float sea = kNoWater;

    explicit ChannelConstants(const WorldDefinition& definition);
};

/// A column and a reach that it is near to.
struct NearReach {
    std::size_t column = 0;
    float distance = 0;
    float half_width = 0;
    float level = 0;
};

/// Per column of a shape.
struct ChannelRasters {
    std::vector<float> water;     ///< level, or kNoWater
    std::vector<float> levels;    ///< where it would stand if arms of a river did not touch
    std::vector<float> nearness;  ///< distance to the nearest channel's middle in its half widths
    std::vector<float> weight;    ///< of the levels that `water` is made of
    std::vector<NearReach> near;  ///< scratch: reach by reach
    bool is_wet = false;          ///< water stands somewhere
};

/// Each column to which each reach that has water somewhere is near enough to shape its banks, or
/// within `beyond` columns of its water; reach by reach.
void find_near(std::vector<NearReach>& found, const ChannelConstants& constants,
               const ReliefRasters& relief, const RiverGraph& rivers, const RectangleShape& shape,
               const RowKernels& kernels, float beyond);

/// Cuts the channels into `ground` and says where water stands; the sea is part of it.
void cut_channels(float* ground, ChannelRasters& out, const ChannelConstants& constants,
                  const ReliefRasters& relief, const RiverGraph& rivers,
                  const RectangleShape& shape, const RowKernels& kernels);

}  // namespace terrane
