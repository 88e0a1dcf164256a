// What a piece of terrain is like, in numbers: the evidence for structure, interest and control.
#pragma once

#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "protocol/base/result.h"

#include <cstdint>
#include <vector>

namespace terrane {

inline constexpr std::int32_t kSurveySide = 100;  ///< columns

/// Heights in voxels, row by row.
struct Survey {
    std::vector<double> surface;
    std::vector<std::vector<double>> layer_tops;  ///< of each layer
    double vein_share = 0;                        ///< of columns
    double cave_share = 0;
    double vein_thickness = 0;  ///< mean, of the columns that have one
    double cave_thickness = 0;
    double vein_count = 0;  ///< of the plot (1, 0)
    double cave_count = 0;
    double layer_count = 0;
};

/// kSurveySide x kSurveySide columns from (1000, 1000) on: away from the origin plot.
Result<Survey> survey(const World& world);

/// What each voxel is made of most: a number a material, 0 for void and caves. x fastest, then y,
/// then z. `rectangle` of level 0.
Result<std::vector<std::uint16_t>> main_materials(const World& world,
                                                  const ColumnRectangle& rectangle,
                                                  std::int32_t height);

}  // namespace terrane
