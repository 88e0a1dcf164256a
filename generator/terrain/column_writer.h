// From a region's rasters to limits: walks every column from the bottom to the top.
// Source: the paper, section 3 (limits) and 4.3 (blends between consecutive layers).
#pragma once

#include "generator/terrain/region.h"
#include "generator/terrain/world.h"
#include "generator/volume/limit.h"

#include <cstdint>
#include <vector>

namespace terrane {

/// No palette is so long.
inline constexpr std::uint16_t kNoPaletteId = 0xffff;

struct ColumnWriterOutput {
    ColumnGrid& grid;
    Palette& palette;                         ///< layers, void, then the elements that own a limit
    std::int32_t& highest_y256;               ///< of the inner columns
    std::vector<std::uint16_t>& element_ids;  ///< scratch, see number_elements
    std::vector<std::uint32_t>& element_limits;  ///< likewise
};

/// Writes the region's inner columns (apron 0), or those around them too (apron 1; these have no
/// flow). One thread.
void write_columns(const ColumnWriterOutput& out, const Region& region, const World& world,
                   const TerrainConstants& constants, std::int32_t apron,
                   const RowKernels& kernels);

/// Gives the elements that own limits the ids after the world's own entries, in their order, in the
/// limits and in the palette. `out.element_ids` says which do (not kNoPaletteId) and gets the ids;
/// `out.element_limits` are the numbers of their limits, whose ids are the elements' own numbers
/// behind the world's entries.
void number_elements(const ColumnWriterOutput& out, const Region& region, const World& world);

}  // namespace terrane
