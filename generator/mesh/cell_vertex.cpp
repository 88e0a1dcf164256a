#include "generator/mesh/cell_vertex.h"

namespace terrane {
namespace {

/// The clamped distance to the nearest end at a height; `above` is the first interval, if any,
/// whose top is not below it.
struct Sample {
    std::int32_t distance = 0;
    bool is_solid = false;
};

Sample sample_at(const SolidInterval* above, bool has_above, bool has_below, std::int32_t y256) {
    std::int32_t distance = kDistanceMax256;
    if (has_above && above->bottom256 < y256) {
        distance = std::min(distance, std::min(above->top256 - y256, y256 - above->bottom256));
        return {.distance = distance, .is_solid = true};
    }
    if (has_above) {
        distance = std::min(distance, above->bottom256 - y256);
    }
    if (has_below) {
        distance = std::min(distance, y256 - above[-1].top256);
    }
    return {.distance = -distance, .is_solid = false};
}

}  // namespace

CaveCell cave_cell(const SolidColumns& columns, const std::array<std::size_t, 4>& at,
                   std::int32_t floor256) {
    CaveCell cell;
    const std::int32_t ceiling256 = floor256 + kUnitsPerVoxel;
    for (std::size_t lane = 0; lane < 4; ++lane) {
        const auto column = columns.column(at[lane]);
        const SolidInterval* const begin = column.data();
        const SolidInterval* const end = begin + column.size();
        const SolidInterval* low = begin;
        while (low != end && low->top256 < floor256) {
            ++low;
        }
        const SolidInterval* high = low;
        while (high != end && high->top256 < ceiling256) {
            ++high;
        }
        const Sample at_floor = sample_at(low, low != end, low != begin, floor256);
        const Sample at_ceiling = sample_at(high, high != end, high != begin, ceiling256);
        cell.corners.low[lane] = at_floor.distance;
        cell.corners.high[lane] = at_ceiling.distance;
        cell.corners.solid_low[lane] = at_floor.is_solid ? -1 : 0;
        cell.corners.solid_high[lane] = at_ceiling.is_solid ? -1 : 0;
        if (at_floor.is_solid != at_ceiling.is_solid) {  // at the lowest end of the right kind
            cell.corners.crossing[lane] =
                (at_floor.is_solid ? low->top256 : low->bottom256) - floor256;
            cell.crossing_ids[lane] = at_floor.is_solid ? low->top_id : low->bottom_id;
        }
    }
    return cell;
}

}  // namespace terrane
