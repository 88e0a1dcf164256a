// What replaces the layers of a column: lenses, the fillings of fractures, caves and their water.
#include "generator/landscape/caves.h"
#include "generator/landscape/channels.h"
#include "generator/landscape/column_limits.h"
#include "generator/landscape/column_maker.h"
#include "generator/landscape/fractures.h"
#include "generator/terrain/element.h"
#include "generator/terrain/region.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace terrane {
namespace {

constexpr float kRoofUnderWater = 5;  ///< voxels of rock left between a cave and open water
constexpr float kRoofLeast = 1.6F;    ///< voxels: a thinner roof falls in
constexpr float kWallLeast = 1.5F;    ///< voxels: nearer caves become one
constexpr float kCaveLeast = 0.8F;    ///< voxels
constexpr float kSpillLeast = 0.5F;   ///< voxels: open water stands so much above ground beside it
constexpr float kCaveDeepest = 2;     ///< voxels above the bottom of the world

}  // namespace

void ColumnMaker::find_lenses(const Place& place, const Block& block) {
    const Region& region = sources_.region;
    std::uint64_t gaps = region.gap_mask[place.at];
    for (std::size_t gap = 0; gaps != 0; ++gap, gaps >>= 1U) {
        if ((gaps & 1U) == 0) {
            continue;
        }
        const std::int32_t base = region.y256[gap * region.plane_size() + place.at] + block.moved;
        if (base >= block.top) {
            break;  // higher gaps lie higher
        }
        const std::size_t end =
            gap + 1 < sources_.rules.size() ? region.gap_begin[gap + 1] : region.elements.size();
        for (std::size_t e = region.gap_begin[gap]; e < end; ++e) {
            const PlacedElement& element = region.elements[e];
            const std::int32_t x = place.column - element.column_first;
            const std::int32_t z = place.row - element.row_first;
            if (x < 0 || z < 0 || x >= element.columns || z >= element.rows) {
                continue;
            }
            const float thickness =
                region.thickness[element.raster + static_cast<std::size_t>(z * element.stride + x)];
            if (thickness > 0) {
                const bool is_cave = element.element().type == ElementType::cave;
                overlays_.add(
                    std::max(base, block.bottom), std::min(base + to_256(thickness), block.top),
                    tail_of(static_cast<std::uint16_t>(sources_.world.base_palette.size() + e),
                            is_cave ? 0 : place.flow_of(gap)));
            }
        }
    }
}

void ColumnMaker::find_sheets(const Place& place, std::span<const PlaneInColumn> planes) {
    const auto& fillings = sources_.constants.palette.fillings;
    if (fillings.empty()) {
        return;
    }
    for (const PlaneInColumn& plane : planes) {
        if (plane.half_sheet <= 0) {
            continue;
        }
        const std::int32_t low = std::max(0, to_256(plane.y - plane.half_sheet));
        const std::int32_t high = std::min(to_256(plane.y + plane.half_sheet), place.top256);
        if (low >= high) {
            continue;
        }
        const auto& filling = fillings[plane.filling % fillings.size()];
        const std::int32_t flow = place.flow_of(0);
        const std::int32_t rich_from = to_256(place.ground - kEnrichedDepth);
        overlays_.add(low, std::min(high, rich_from), tail_of(filling.primary, flow));
        overlays_.add(std::max(low, rich_from), high, tail_of(filling.enriched, flow));
    }
}

/// Whether open water stands in a column or beside it.
bool ColumnMaker::is_by_water(const Place& place) const {
    if (!sources_.channels.is_wet || sources_.region.shape.step != 1) {
        return false;
    }
    const std::int32_t stride = sources_.region.shape.stride();
    const float* const level = sources_.channels.levels.data() + place.at;
    float highest = kNoWater;
    for (std::int32_t z = -1; z <= 1; ++z) {
        for (std::int32_t x = -1; x <= 1; ++x) {
            highest = std::max(highest, level[z * stride + x]);
        }
    }
    return highest > kNoWater;
}

/// The lowest ground of a column and those around it, before banks were raised: those of the
/// region's outermost columns are not known.
float ColumnMaker::lowest_around(const Place& place) const {
    const std::int32_t stride = sources_.region.shape.stride();
    const float* const ground = sources_.ground.data() + place.at;
    float lowest = *ground;
    for (std::int32_t z = -1; z <= 1; ++z) {
        for (std::int32_t x = -1; x <= 1; ++x) {
            lowest = std::min(lowest, ground[z * stride + x]);
        }
    }
    return lowest;
}

std::int32_t ColumnMaker::find_caves(const Place& place) {
    const auto found = sources_.caves.gaps(place.at);
    if (found.empty()) {
        return place.top256;
    }
    std::array<CaveGap, kCavesPerColumnMax> gaps;
    std::size_t count = 0;
    const bool keeps_roof =
        sources_.channels.nearness[place.at] < kSandWidths || is_by_water(place);
    for (CaveGap gap : found) {
        gap.floor = std::max(gap.floor, kCaveDeepest);
        if (keeps_roof) {
            gap.lid = std::min(gap.lid, sources_.ground[place.at] - kRoofUnderWater);
        } else if (gap.lid > place.ground - kRoofLeast) {
            gap.lid = place.ground;
        }
        if (gap.lid - gap.floor >= kCaveLeast) {
            gaps[count++] = gap;
        }
    }
    std::sort(gaps.begin(), gaps.begin() + static_cast<std::ptrdiff_t>(count),
              [](const CaveGap& a, const CaveGap& b) {
                  return a.floor != b.floor ? a.floor < b.floor : a.lid < b.lid;
              });
    const LandscapeConstants& constants = sources_.constants;
    const float flooded =
        constants.has_relief
            ? std::max(sources_.river[place.at] - constants.water_table, constants.sea)
            : constants.sea;
    for (std::size_t i = 0; i < count;) {
        CaveGap gap = gaps[i++];
        while (i < count && gaps[i].floor - gap.lid < kWallLeast) {
            gap.lid = std::max(gap.lid, gaps[i++].lid);
        }
        if (gap.lid >= place.ground && flooded > gap.floor) {
            // Where it would spill over the ground beside it, the roof has not fallen in.
            const float lowest = lowest_around(place);
            if (std::min(flooded, place.ground) > lowest + kSpillLeast) {
                gap.lid = lowest - kRoofLeast;
            }
            if (gap.lid - gap.floor < kCaveLeast) {
                continue;
            }
        }
        const std::int32_t floor = to_256(gap.floor);
        const std::int32_t lid = gap.lid >= place.ground ? place.top256 : to_256(gap.lid);
        const bool has_water = constants.palette.water != LandscapePalette::kNoEntry;
        const std::int32_t wet_to =
            has_water && flooded > gap.floor ? std::min(lid, to_256(flooded)) : floor;
        overlays_.add(floor, wet_to, tail_of(constants.palette.water, 0));
        overlays_.add(std::max(floor, wet_to), lid, tail_of(constants.palette.cave_air, 0));
    }
    // What is open to the sky is no cave.
    if (!overlays_.is_empty()) {
        const Overlay& last = overlays_.all().back();
        if (last.high == place.top256 && palette_id_of(last.tail) == constants.palette.cave_air) {
            const std::int32_t top = last.low;
            overlays_.cut(top);
            return top;
        }
    }
    return place.top256;
}

}  // namespace terrane
