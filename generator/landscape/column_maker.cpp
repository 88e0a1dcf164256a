#include "generator/landscape/column_maker.h"

#include "generator/landscape/numbers.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace terrane {
namespace {

constexpr float kRoofUnderWater = 5;    ///< voxels of rock left between a cave and open water
constexpr float kRoofLeast = 1.6F;      ///< voxels: a thinner roof falls in
constexpr float kWallLeast = 1.5F;      ///< voxels: nearer caves become one
constexpr float kCaveLeast = 0.8F;      ///< voxels
constexpr float kCaveDeepest = 2;       ///< voxels above the bottom of the world
constexpr float kSteepestSoil = 0.42F;  ///< slope^2 on which no soil lies
constexpr float kSteepestSnow = 1.1F;
constexpr float kSnow = 2.2F;         ///< voxels
constexpr float kSnowLineNoise = 22;  ///< voxels
constexpr float kLeastCover = 0.25F;  ///< voxels
constexpr float kSandWidths = 2.2F;   ///< half widths of a river
constexpr float kLeastSand = 1.2F;    ///< voxels
constexpr float kBeach = 1.5F;        ///< voxels around the sea's level

std::int32_t to_256(float voxels) {
    return static_cast<std::int32_t>(std::floor(voxels * 256.0F + 0.5F));
}

}  // namespace

/// Where a column's values lie.
struct ColumnMaker::Place {
    std::size_t at = 0;        ///< in the region's rasters
    std::size_t field_at = 0;  ///< in the field's
    std::int32_t column = 0;   ///< of the region's shape
    std::int32_t row = 0;
    float ground = 0;
    float water = kNoWater;
    std::int32_t top256 = 0;
    const std::int32_t* flow = nullptr;  ///< null: none
    std::ptrdiff_t flow_plane = 0;

    std::int32_t flow_of(std::size_t layer) const {
        return flow == nullptr ? 0 : flow[static_cast<std::ptrdiff_t>(layer) * flow_plane];
    }
};

void ColumnMaker::add_layers(const Place& place, std::int32_t moved256,
                             std::int32_t block_top) {
    const std::size_t plane = sources_.region.plane_size();
    const std::int32_t* y256 = sources_.region.y256.data() + place.at;
    const std::size_t layers = sources_.rules.size();
    std::int32_t bottom = runs_.top();
    const std::int32_t block_bottom = bottom;
    LimitTail below = 0;
    bool below_alone = true;
    for (std::size_t k = 0; k < layers && bottom < block_top; ++k, y256 += plane) {
        const std::int32_t top = *y256 + moved256;
        if (top <= bottom) {
            continue;
        }
        const LayerRules& rule = sources_.rules[k];
        const LimitTail tail = tail_of(static_cast<std::uint16_t>(k), place.flow_of(k));
        const bool blends = bottom > block_bottom && !below_alone && !rule.alone && rule.blend > 0;
        const std::int32_t blend =
            blends ? std::max(1, ((top - bottom) * rule.blend + 128) >> 8) : 0;
        const std::int32_t end = std::min(top, block_top);
        runs_.push({.bottom = bottom,
                  .top = end,
                  .middle = std::min(bottom + blend, end),
                  .tail = tail,
                  .from = below});
        bottom = end;
        below = tail;
        below_alone = rule.alone;
    }
    if (bottom < block_top) {  // the stack ends below the ground
        const std::uint16_t soil = sources_.constants.palette.soil;
        const auto last = static_cast<std::uint16_t>(layers - 1);
        runs_.push({.bottom = bottom,
                  .top = block_top,
                  .middle = bottom,
                  .tail = tail_of(soil != LandscapePalette::kNoEntry ? soil : last,
                                  place.flow_of(layers - 1)),
                  .from = 0});
    }
}

void ColumnMaker::add_lenses(const Place& place, std::int32_t moved256,
                             std::int32_t block_bottom) {
    const Region& region = sources_.region;
    std::uint64_t gaps = region.gap_mask[place.at];
    for (std::size_t gap = 0; gaps != 0; ++gap, gaps >>= 1U) {
        if ((gaps & 1U) == 0) {
            continue;
        }
        const std::int32_t base = region.y256[gap * region.plane_size() + place.at] + moved256;
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
                runs_.replace(
                    std::max(base, block_bottom), base + to_256(thickness),
                    tail_of(static_cast<std::uint16_t>(sources_.world.base_palette.size() + e),
                            is_cave ? 0 : place.flow_of(gap)));
            }
        }
    }
}

void ColumnMaker::add_blocks(const Place& place) {
    const auto planes = sources_.fractures.planes(place.field_at);
    const float fold = sources_.folds[place.field_at];
    std::array<float, kPlanesPerColumnMax + 1> tops{};
    std::size_t blocks = 0;
    for (const PlaneInColumn& plane : planes) {
        if (plane.half_throw > 0 && plane.y > 0 && plane.y < place.ground) {
            std::size_t place_of = blocks++;
            for (; place_of > 0 && tops[place_of - 1] > plane.y; --place_of) {
                tops[place_of] = tops[place_of - 1];
            }
            tops[place_of] = plane.y;
        }
    }
    tops[blocks++] = place.ground;
    float bottom = 0;
    for (std::size_t b = 0; b < blocks; ++b) {
        // A plane at the block's bottom lies below it.
        float moved = fold;
        for (const PlaneInColumn& plane : planes) {
            moved += plane.y <= bottom ? -plane.half_throw : plane.half_throw;
        }
        const std::int32_t block_bottom = runs_.top();
        const std::int32_t block_top =
            b + 1 == blocks ? place.top256 : std::min(to_256(tops[b]), place.top256);
        if (block_top > block_bottom) {
            add_layers(place, to_256(moved), block_top);
            add_lenses(place, to_256(moved), block_bottom);
        }
        bottom = tops[b];
    }
}

void ColumnMaker::add_sheets(const Place& place) {
    const auto& fillings = sources_.constants.palette.fillings;
    if (fillings.empty()) {
        return;
    }
    for (const PlaneInColumn& plane : sources_.fractures.planes(place.field_at)) {
        if (plane.half_sheet <= 0) {
            continue;
        }
        const std::int32_t low = to_256(plane.y - plane.half_sheet);
        const std::int32_t high = to_256(plane.y + plane.half_sheet);
        if (low >= place.top256 || high <= 0) {
            continue;
        }
        const auto& filling = fillings[plane.filling % fillings.size()];
        const std::int32_t flow = place.flow_of(0);
        const std::int32_t rich_from = to_256(place.ground - kEnrichedDepth);
        runs_.replace(low, std::min(high, rich_from), tail_of(filling.primary, flow));
        runs_.replace(std::max(low, rich_from), high, tail_of(filling.enriched, flow));
    }
}

/// What lies on the ground: where it begins, in 1/256 voxel, and its palette id.
struct ColumnMaker::Cover {
    std::int32_t soil_from = 0;  ///< or sand
    std::int32_t snow_from = 0;
    std::uint16_t soil = LandscapePalette::kNoEntry;  ///< kNoEntry: there is none
    std::uint16_t snow = LandscapePalette::kNoEntry;
};

/// Tops and covers of the columns of a row, side by side so that it goes by vectors.
void ColumnMaker::begin_row(std::int32_t z) {
    const LandscapeConstants& constants = sources_.constants;
    const RectangleShape& shape = sources_.region.shape;
    const std::ptrdiff_t stride = shape.stride();
    const std::ptrdiff_t first = (z + sources_.region.apron) * stride;
    const float* __restrict const banks = sources_.banks.data() + first;
    const std::int32_t count = shape.width;
    std::int32_t* __restrict const top256 = row_.top256.data();
    for (std::int32_t i = 0; i < count; ++i) {
        top256[i] = std::max(to_256(banks[i]), 2 * kUnitsPerVoxel);
    }
    if (!constants.has_relief) {
        return;
    }
    const float per_column = 0.5F / static_cast<float>(shape.step);
    const float* __restrict const ground = sources_.ground.data() + first;
    const float* __restrict const before = ground - stride;
    const float* __restrict const after = ground + stride;
    const float* __restrict const noise = sources_.soil.data() + first;
    const float* __restrict const crest = sources_.crest.data() + first;
    const float* __restrict const nearness = sources_.channels.nearness.data() + first;
    const float* __restrict const water = sources_.channels.water.data() + first;
    std::int32_t* __restrict const soil256 = row_.soil256.data();
    std::int32_t* __restrict const snow256 = row_.snow256.data();
    std::int32_t* __restrict const is_sand = row_.is_sand.data();
    const auto thickness256 = [](float thickness) {
        return thickness >= kLeastCover ? to_256(thickness) : 0;
    };
    const float most_soil = constants.soil;
    const float beach = constants.sea + kBeach;
    for (std::int32_t i = 1; i + 1 < count; ++i) {
        const float slope_x = (ground[i + 1] - ground[i - 1]) * per_column;
        const float slope_z = (after[i] - before[i]) * per_column;
        const float square = slope_x * slope_x + slope_z * slope_z;
        const float soil = most_soil * (1.0F - square / kSteepestSoil) *
                           (0.6F + 0.4F * clamp01(1.0F - crest[i])) * (1.0F + 0.6F * noise[i]);
        const auto by_water = static_cast<std::int32_t>(nearness[i] < kSandWidths) |
                              static_cast<std::int32_t>(banks[i] < beach);
        const std::int32_t sand = by_water & static_cast<std::int32_t>(square < kSteepestSnow);
        is_sand[i] = sand;
        soil256[i] = thickness256(sand != 0 ? std::max(kLeastSand, soil) : soil);
    }
    if (!constants.has_snow) {
        return;
    }
    const float snow_line = constants.snow_line;
    for (std::int32_t i = 1; i + 1 < count; ++i) {
        const float slope_x = (ground[i + 1] - ground[i - 1]) * per_column;
        const float slope_z = (after[i] - before[i]) * per_column;
        const float square = slope_x * slope_x + slope_z * slope_z;
        const float above = (banks[i] - snow_line + kSnowLineNoise * noise[i]) * (1.0F / 12.0F);
        const float snow = kSnow * clamp01(above) * (1.0F - square / kSteepestSnow);
        snow256[i] = water[i] == kNoWater ? thickness256(snow) : 0;
    }
}

ColumnMaker::Cover ColumnMaker::cover_of(const Place& place) const {
    const LandscapePalette& palette = sources_.constants.palette;
    const auto i = static_cast<std::size_t>(place.column);
    Cover cover;
    if (row_.soil256[i] > 0) {
        cover.soil = row_.is_sand[i] != 0 ? palette.sand : palette.soil;
        cover.soil_from = std::max(0, place.top256 - row_.soil256[i]);
    }
    if (sources_.constants.has_snow && row_.snow256[i] > 0) {
        cover.snow = palette.snow;
        cover.snow_from = std::max(0, place.top256 - row_.snow256[i]);
    }
    return cover;
}

void ColumnMaker::add_cover(const Place& place) {
    const Cover cover = cover_of(place);
    const LimitTail flow = runs_.last().tail & ~LimitTail{0xffff};
    if (cover.soil != LandscapePalette::kNoEntry) {
        runs_.replace(cover.soil_from, place.top256, flow | cover.soil);
    }
    if (cover.snow != LandscapePalette::kNoEntry) {
        runs_.replace(cover.snow_from, place.top256, flow | cover.snow);
    }
}

void ColumnMaker::add_caves(const Place& place) {
    const auto found = sources_.caves.gaps(place.at);
    if (found.empty()) {
        return;
    }
    std::array<CaveGap, kCavesPerColumnMax> gaps;
    std::size_t count = 0;
    const bool keeps_roof =
        place.water > kNoWater || sources_.channels.nearness[place.at] < kSandWidths;
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
        const std::int32_t floor = to_256(gap.floor);
        const std::int32_t lid = gap.lid >= place.ground ? place.top256 : to_256(gap.lid);
        runs_.replace(floor, lid, tail_of(constants.palette.cave_air, 0));
        if (constants.palette.water != LandscapePalette::kNoEntry && flooded > gap.floor) {
            runs_.replace(floor, std::min(lid, to_256(flooded)), tail_of(constants.palette.water, 0));
        }
    }
    // What is open to the sky is no cave.
    if (palette_id_of(runs_.last().tail) == constants.palette.cave_air) {
        runs_.cut(runs_.last().bottom);
    }
}

void ColumnMaker::add_overhang(const Place& place) {
    const Overhang* const overhang = sources_.overhangs.at(place.at);
    if (overhang == nullptr || place.water > kNoWater) {
        return;
    }
    const auto layer = static_cast<std::uint16_t>(overhang->layer);
    const LimitTail rock = tail_of(layer, place.flow_of(static_cast<std::size_t>(overhang->layer)));
    const std::int32_t ground = runs_.top();
    const std::int32_t top = to_256(overhang->top);
    const bool is_filled = overhang->bottom <= place.ground;
    const std::int32_t bottom = is_filled ? ground : to_256(overhang->bottom);
    if (top <= ground || bottom < ground) {
        return;
    }
    runs_.push({.bottom = ground,
              .top = bottom,
              .middle = ground,
              .tail = tail_of(sources_.constants.palette.open_air, 0),
              .from = 0});
    runs_.push({.bottom = bottom, .top = top, .middle = bottom, .tail = rock, .from = rock});
}

ColumnMaker::Place ColumnMaker::place_at(std::int32_t x, std::int32_t z, bool has_flow) const {
    const Region& region = sources_.region;
    Place place;
    place.column = x + region.apron;
    place.row = z + region.apron;
    place.at = static_cast<std::size_t>(place.row * region.shape.stride() + place.column);
    place.field_at = sources_.field_first + static_cast<std::size_t>(
                                                place.row * sources_.field.stride() + place.column);
    place.ground = sources_.banks[place.at];
    place.water = sources_.channels.water[place.at];
    place.top256 = row_.top256[static_cast<std::size_t>(place.column)];
    if (has_flow) {
        place.flow = region.flow.data() + static_cast<std::ptrdiff_t>(z) * region.flow_stride + x;
        place.flow_plane = static_cast<std::ptrdiff_t>(region.flow_plane_size());
    }
    return place;
}

void ColumnMaker::make(const Place& place) {
    runs_.clear();
    add_blocks(place);
    add_sheets(place);
    if (sources_.constants.has_relief) {
        add_cover(place);
    }
    add_caves(place);
    const std::uint16_t water = sources_.constants.palette.water;
    if (place.water > kNoWater && water != LandscapePalette::kNoEntry) {
        const std::int32_t bed = runs_.top();
        runs_.push({.bottom = bed,
                    .top = to_256(place.water),
                    .middle = bed,
                    .tail = tail_of(water, 0),
                    .from = 0});
    }
    add_overhang(place);
}

/// Whether nothing but layers, cover and open water is there, and no fracture parts it.
bool ColumnMaker::is_plain(const Place& place) const {
    if (!sources_.constants.has_relief || sources_.region.gap_mask[place.at] != 0 ||
        !sources_.caves.gaps(place.at).empty() || sources_.overhangs.at(place.at) != nullptr) {
        return false;
    }
    const bool has_sheets = !sources_.constants.palette.fillings.empty();
    for (const PlaneInColumn& plane : sources_.fractures.planes(place.field_at)) {
        const float half_sheet = has_sheets ? plane.half_sheet + 1.0F : 0.0F;
        if (plane.y > -half_sheet && plane.y < std::max(place.ground, 2.0F) + half_sheet) {
            return false;
        }
    }
    return true;
}

/// The limits of a plain column, as `make` and ColumnRuns::write would find them; nothing if the
/// stack ends below the ground.
Limit* ColumnMaker::write_plain(Limit* out, const Place& place) const {
    const Cover cover = cover_of(place);
    const bool has_soil = cover.soil != LandscapePalette::kNoEntry;
    const bool has_snow = cover.snow != LandscapePalette::kNoEntry;
    std::int32_t rock_top = place.top256;
    rock_top = has_soil ? std::min(rock_top, cover.soil_from) : rock_top;
    rock_top = has_snow ? std::min(rock_top, cover.snow_from) : rock_top;
    float moved = sources_.folds[place.field_at];
    for (const PlaneInColumn& plane : sources_.fractures.planes(place.field_at)) {
        moved += plane.y <= 0 ? -plane.half_throw : plane.half_throw;
    }
    const std::int32_t moved256 = to_256(moved);
    const auto plane = static_cast<std::ptrdiff_t>(sources_.region.plane_size());
    const std::int32_t* y256 = sources_.region.y256.data() + place.at;
    const std::int32_t* flow = place.flow;
    const auto layers = static_cast<std::int32_t>(sources_.region.layers_built);
    std::int32_t k = 0;
    while (k < layers && y256[k * plane] + moved256 <= 0) {
        ++k;
    }
    std::int32_t bottom = 0;
    bool below_alone = true;
    std::int32_t highest = k;  // the layer at the ground
    for (; k < layers && bottom < rock_top; ++k) {
        const std::int32_t top = y256[k * plane] + moved256;
        if (top <= bottom) {
            continue;
        }
        const LayerRules& rule = sources_.rules[static_cast<std::size_t>(k)];
        const LimitTail tail =
            tail_of(static_cast<std::uint16_t>(k), flow == nullptr ? 0 : flow[k * place.flow_plane]);
        const std::int32_t end = std::min(top, rock_top);
        if (below_alone || rule.alone || rule.blend <= 0) {
            put_limit(out++, bottom, tail);
        } else {
            const std::int32_t blend = std::max(1, ((top - bottom) * rule.blend + 128) >> 8);
            if (bottom + blend < end) {
                put_limit(out++, bottom + blend, tail);
            }
        }
        put_limit(out++, end, tail);
        bottom = end;
        below_alone = rule.alone;
        highest = k;
    }
    if (bottom < rock_top) {
        return nullptr;
    }
    // What is below the cover may be higher layers that it hides.
    for (std::int32_t top = k > 0 ? y256[(k - 1) * plane] + moved256 : 0; top < place.top256; ++k) {
        if (k == layers) {
            return nullptr;
        }
        if (const std::int32_t next = y256[k * plane] + moved256; next > top) {
            top = next;
            highest = k;
        }
    }
    const LimitTail cover_flow =
        flow == nullptr ? 0 : tail_of(0, flow[highest * place.flow_plane]);
    const auto lay = [&](std::int32_t from, std::int32_t to, LimitTail tail) {
        if (to > from) {
            put_limit(out++, from, tail);
            put_limit(out++, to, tail);
        }
    };
    if (has_soil) {
        lay(cover.soil_from, has_snow ? cover.snow_from : place.top256, cover_flow | cover.soil);
    }
    if (has_snow) {
        lay(cover.snow_from, place.top256, cover_flow | cover.snow);
    }
    std::int32_t top = place.top256;
    if (place.water > kNoWater && sources_.constants.palette.water != LandscapePalette::kNoEntry) {
        const std::int32_t level = to_256(place.water);
        lay(top, level, sources_.constants.palette.water);
        top = std::max(top, level);
    }
    put_limit(out++, top, sources_.world.void_id());
    return out;
}

void ColumnMaker::mark_elements(std::span<const Limit> limits) {
    for (const Limit& limit : limits) {
        const std::size_t id = limit.palette_id;
        if (id >= sources_.world.base_palette.size()) {
            element_ids_[id - sources_.world.base_palette.size()] = 0;
        }
    }
}

std::size_t ColumnMaker::write(Limits& limits, std::size_t used, std::int32_t x, std::int32_t z,
                               bool has_flow) {
    const auto grow = [&limits](std::size_t most) {
        if (limits.size() < most) {
            limits.resize(std::max(most, 2 * limits.size()));
        }
    };
    const Place place = place_at(x, z, has_flow);
    if (is_plain(place)) {
        grow(used + 2 * sources_.rules.size() + 8);
        if (const Limit* const end = write_plain(limits.data() + used, place); end != nullptr) {
            return static_cast<std::size_t>(end - limits.data());
        }
    }
    make(place);
    grow(used + runs_.limits_max());
    const Limit* const end = runs_.write(limits.data() + used, sources_.world.void_id());
    const auto now = static_cast<std::size_t>(end - limits.data());
    // Only columns that lenses meet can show one.
    if (sources_.region.gap_mask[place.at] != 0) {
        mark_elements(std::span(limits).subspan(used, now - used));
    }
    return now;
}

}  // namespace terrane
