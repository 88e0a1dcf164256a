// From a region's rasters to limits: walks every column from the bottom to the top.
// Source: the paper, section 3 (limits) and 4.3 (blends between consecutive layers).
#pragma once

#include "generator/terrain/region.h"
#include "generator/terrain/world.h"
#include "generator/volume/limit.h"

#include <cstdint>
#include <vector>

namespace terrane {

/// What writing a layer's limits takes, made once per generator.
struct LayerRules {
    std::int32_t blend = 0;           ///< share of the thickness that blends, 1/256; 0 is sharp
    std::int32_t blend_on_below = 0;  ///< the same, 0 if it never blends into the layer right below
    bool alone = false;
};

struct ColumnRules {
    std::vector<LayerRules> layers;
    bool any_alone = false;

    explicit ColumnRules(const World& world);
};

/// Which columns to write: the region's inner ones (apron 0), or those around them too (apron 1;
/// these have no flow).
struct ColumnWriterOutput {
    ColumnGrid& grid;
    Palette& palette;                         ///< layers, void, then the elements that own a limit
    std::int32_t& highest_y256;               ///< of the inner columns
    std::vector<std::uint16_t>& element_ids;  ///< scratch
};

void write_columns(const ColumnWriterOutput& out, const Region& region, const World& world,
                   const ColumnRules& rules, std::int32_t apron);

}  // namespace terrane
