#include "generator/landscape/column_maker.h"

#include "generator/landscape/channels.h"
#include "generator/landscape/column_limits.h"
#include "generator/landscape/fractures.h"
#include "generator/landscape/numbers.h"
#include "generator/landscape/overhangs.h"
#include "generator/terrain/kernels/vector_pad.h"
#include "generator/terrain/region.h"
#include "generator/volume/limit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

namespace terrane {
namespace {

constexpr float kSteepestSoil = 0.42F;  ///< slope^2 on which no soil lies
constexpr float kSteepestSnow = 1.1F;
constexpr float kSnow = 2.2F;         ///< voxels
constexpr float kSnowLineNoise = 22;  ///< voxels
constexpr float kLeastCover = 0.25F;  ///< voxels
constexpr float kLeastSand = 1.2F;    ///< voxels
constexpr float kBeach = 1.5F;        ///< voxels around the sea's level

/// Squares of the slopes of a row of columns, but for its first and last one.
void slope_squares(float* __restrict square, const float* __restrict ground, std::ptrdiff_t stride,
                   float per_column, std::int32_t count) {
    const float* __restrict const before = ground - stride;
    const float* __restrict const after = ground + stride;
    for (std::int32_t i = 1; i + 1 < count; ++i) {
        const float x = (ground[i + 1] - ground[i - 1]) * per_column;
        const float z = (after[i] - before[i]) * per_column;
        square[i] = x * x + z * z;
    }
}

/// A cover's thickness in 1/256 voxel; thin ones are none.
std::int32_t thickness256(float thickness) {
    return thickness >= kLeastCover ? to_256(thickness) : 0;
}

/// Up the layers of a block. Its functions are inlined where it is a local: what moves stays in
/// registers.
struct LayerWalk {
    static constexpr std::int32_t kNoFlow = 0;
    const std::int32_t* y256 = nullptr;
    const std::int32_t* flow = nullptr;
    std::ptrdiff_t plane = 0;
    std::ptrdiff_t flow_plane = 0;
    std::ptrdiff_t to_middle = 0;  ///< from a layer's top to where it has blended
    std::int32_t k = 0;
    std::int32_t layers = 0;
    std::int32_t moved = 0;
    std::int32_t bottom = 0;  ///< of what is to come
    bool is_regular = false;  ///< all layers stand and blend as they were laid down

    void go_on() {
        ++k;
        y256 += plane;
        flow += flow_plane;
    }

    LayerWalk(const LayerRow& row, std::size_t column, bool has_flow, std::int32_t bottom_of,
              std::int32_t moved_by)
        : y256(row.y256 + column),
          flow(has_flow ? row.flow + (static_cast<std::ptrdiff_t>(column) - row.flow_first)
                        : &kNoFlow),
          plane(row.plane),
          flow_plane(has_flow ? row.flow_plane : 0),
          to_middle(row.to_middle),
          layers(row.layers),
          moved(moved_by),
          bottom(bottom_of),
          is_regular(row.irregular[column] == 0) {
        while (k < layers && top() <= bottom) {
            go_on();
        }
    }

    std::int32_t top() const { return *y256 + moved; }

    LimitTail tail() const { return tail_of(static_cast<std::uint16_t>(k), *flow); }
};

/// Whole regular layers that follow the walk's, up to `end`.
[[gnu::always_inline]] inline Limit* put_whole(Limit* to, LayerWalk& walk, std::int32_t end) {
    const std::int32_t most = end - walk.moved;
    const std::int32_t begun = walk.k;
    for (; walk.k + 1 < walk.layers && walk.y256[walk.plane] <= most; to += 2) {
        walk.go_on();
        const LimitTail tail = walk.tail();
        put_limit(to, walk.y256[walk.to_middle] + walk.moved, tail);
        put_limit(to + 1, walk.top(), tail);
    }
    if (walk.k > begun) {
        walk.bottom = walk.top();
    }
    return to;
}

/// How high a layer blends out of the one below; `thickness` is the part of it that stands.
std::int32_t blend_of(const LayerRules& below, const LayerRules& rule, std::int32_t thickness) {
    return below.alone || rule.alone || rule.blend <= 0
               ? 0
               : std::max(1, (thickness * rule.blend + 128) >> 8);
}

/// The walk's layer and those above, to `end`, before which no overlay comes. `shown` is what the
/// limit before `to` shows, and becomes what the last one does.
[[gnu::always_inline]] inline Limit* put_clear(Limit* to, LimitTail& shown, LayerWalk& walk,
                                               const LayerRules* rules, std::int32_t end) {
    LimitTail tail = walk.tail();
    if (tail == shown) {
        --to;
    } else {
        put_limit(to++, walk.bottom, tail);
    }
    walk.bottom = std::min(walk.top(), end);
    put_limit(to++, walk.bottom, tail);
    std::int32_t below = walk.k;
    while (walk.bottom < end) {
        if (walk.is_regular) {
            to = put_whole(to, walk, end);
            below = walk.k;
            tail = walk.tail();
            if (walk.bottom == end) {
                break;
            }
        }
        walk.go_on();
        if (walk.k == walk.layers) {
            break;
        }
        const std::int32_t top = walk.top();
        if (top <= walk.bottom) {
            continue;
        }
        tail = walk.tail();
        const std::int32_t blend = blend_of(rules[below], rules[walk.k], top - walk.bottom);
        const std::int32_t middle = walk.bottom + blend;
        walk.bottom = std::min(top, end);
        put_limit(to, middle, tail);
        to += blend == 0 || middle < walk.bottom ? 1 : 0;
        put_limit(to++, walk.bottom, tail);
        below = walk.k;
    }
    shown = tail;
    return to;
}

/// The same where overlays come.
[[gnu::always_inline]] inline void write_overlaid(LimitWriter& out, LayerWalk& walk,
                                                  const LayerRules* rules, std::int32_t end) {
    static constexpr LayerRules kNothingBelow{.alone = true};
    const LayerRules* below_rules = &kNothingBelow;
    LimitTail below = 0;
    for (; walk.k < walk.layers; walk.go_on()) {
        const std::int32_t top = walk.top();
        if (top <= walk.bottom) {
            continue;
        }
        const LayerRules& rule = rules[walk.k];
        const LimitTail tail = walk.tail();
        const std::int32_t own_end = std::min(top, end);
        const std::int32_t blend = blend_of(*below_rules, rule, top - walk.bottom);
        out.write({.bottom = walk.bottom,
                   .top = own_end,
                   .middle = std::min(walk.bottom + blend, own_end),
                   .tail = tail,
                   .from = below});
        walk.bottom = own_end;
        below = tail;
        below_rules = &rule;
        const std::int32_t clear_to = std::min(end, out.clear_to());
        if (walk.is_regular && own_end < clear_to && out.top() == own_end && out.shown() == tail) {
            Limit* const to = put_whole(out.position(), walk, clear_to);
            below = walk.tail();
            below_rules = rules + walk.k;
            out.set_position(to, walk.bottom, below);
        }
        if (walk.bottom >= end) {
            return;
        }
    }
}

}  // namespace

/// The planes that pass under the ground part the column.
void ColumnMaker::find_blocks(const Place& place, std::span<const PlaneInColumn> planes) {
    const float fold = sources_.folds[place.field_at];
    float moved_whole = fold;
    bool is_parted = false;
    for (const PlaneInColumn& plane : planes) {
        moved_whole += plane.y <= 0 ? -plane.half_throw : plane.half_throw;
        is_parted = is_parted || (plane.half_throw > 0 && plane.y > 0 && plane.y < place.ground);
    }
    if (!is_parted) {
        blocks_[0] = {.bottom = 0, .top = place.top256, .moved = to_256(moved_whole)};
        block_count_ = 1;
        return;
    }
    std::array<float, kPlanesPerColumnMax + 1> tops{};
    std::size_t count = 0;
    for (const PlaneInColumn& plane : planes) {
        if (plane.half_throw > 0 && plane.y > 0 && plane.y < place.ground) {
            std::size_t place_of = count++;
            for (; place_of > 0 && tops[place_of - 1] > plane.y; --place_of) {
                tops[place_of] = tops[place_of - 1];
            }
            tops[place_of] = plane.y;
        }
    }
    tops[count++] = place.ground;
    float bottom = 0;
    std::int32_t bottom256 = 0;
    block_count_ = 0;
    for (std::size_t b = 0; b < count; ++b) {
        // A plane at the block's bottom lies below it.
        float moved = fold;
        for (const PlaneInColumn& plane : planes) {
            moved += plane.y <= bottom ? -plane.half_throw : plane.half_throw;
        }
        const std::int32_t top256 =
            b + 1 == count ? place.top256 : std::min(to_256(tops[b]), place.top256);
        if (top256 > bottom256) {
            blocks_[block_count_++] = {.bottom = bottom256, .top = top256, .moved = to_256(moved)};
            bottom256 = top256;
        }
        bottom = tops[b];
    }
}

/// Tops and covers of the columns of a row, side by side so that it goes by vectors.
void ColumnMaker::begin_row(std::int32_t z) {
    const Region& region = sources_.region;
    const std::int32_t row = z + region.apron;
    const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(row) * region.shape.stride();
    row_.at = static_cast<std::size_t>(first);
    row_.field_at = sources_.field_first + static_cast<std::size_t>(row * sources_.field.stride());
    row_.layers = {.y256 = region.y256.data() + first,
                   .irregular = region.irregular.data() + first,
                   .plane = static_cast<std::ptrdiff_t>(region.plane_size()),
                   .to_middle = region.middle.data() - region.y256.data(),
                   .flow_first = region.apron,
                   .layers = static_cast<std::int32_t>(region.layers_built)};
    if (z >= 0 && z < region.inner.length) {
        row_.layers.flow = region.flow.data() + static_cast<std::ptrdiff_t>(z) * region.flow_stride;
        row_.layers.flow_plane = static_cast<std::ptrdiff_t>(region.flow_plane_size());
    }
    const float* __restrict const banks = sources_.banks.data() + first;
    const std::int32_t count = region.shape.width;
    std::int32_t* __restrict const top256 = row_.top256.data();
    for (std::int32_t i = 0; i < count; ++i) {
        top256[i] = std::max(to_256(banks[i]), 2 * kUnitsPerVoxel);
    }
    const float* __restrict const folds = sources_.folds.data() + row_.field_at;
    std::int32_t* __restrict const folded = row_.folded.data();
    for (std::int32_t i = 0; i < count; ++i) {
        folded[i] = to_256(folds[i]);
    }
    find_crossed();
    row_.soil_from = row_.snow_from = row_.top256;
    if (sources_.constants.has_relief) {
        find_covers(first);
    }
    if (sources_.constants.has_snow && sources_.constants.has_relief) {
        find_snow(first);
    }
}

/// Which columns of the row meet a lens, a plane, a cave or an overhang.
void ColumnMaker::find_crossed() {
    const auto count = static_cast<std::size_t>(sources_.region.shape.width);
    std::uint8_t* __restrict const crossed = row_.crossed.data();
    const std::uint64_t* __restrict const lenses = sources_.region.gap_mask.data() + row_.at;
    for (std::size_t i = 0; i < count; ++i) {
        crossed[i] = lenses[i] != 0 ? 1 : 0;
    }
    const auto add = [=](const std::uint8_t* __restrict counts, std::size_t first) {
        for (std::size_t i = 0; i < count; ++i) {
            crossed[i] |= counts[first + i];
        }
    };
    if (!sources_.fractures.is_empty()) {
        add(sources_.fractures.counts().data(), row_.field_at);
    }
    if (!sources_.caves.is_empty()) {
        add(sources_.caves.counts().data(), row_.at);
    }
    if (!sources_.overhangs.is_empty()) {
        for (std::size_t i = 0; i < count; ++i) {
            if (sources_.overhangs.at(row_.at + i) != nullptr) {
                crossed[i] = 1;
            }
        }
    }
}

/// Soil and sand of the row whose columns are from `first` on.
void ColumnMaker::find_covers(std::ptrdiff_t first) {
    const LandscapeConstants& constants = sources_.constants;
    const RectangleShape& shape = sources_.region.shape;
    std::array<float, kRectangleSideMax> squares;
    slope_squares(squares.data(), sources_.ground.data() + first, shape.stride(),
                  0.5F / static_cast<float>(shape.step), shape.width);
    const float* __restrict const banks = sources_.banks.data() + first;
    const float* __restrict const noise = sources_.soil.data() + first;
    const float* __restrict const crest = sources_.crest.data() + first;
    const float* __restrict const nearness = sources_.channels.nearness.data() + first;
    const std::int32_t* __restrict const top256 = row_.top256.data();
    std::int32_t* __restrict const soil_from = row_.soil_from.data();
    std::int32_t* __restrict const soil_of = row_.soil.data();
    const float most_soil = constants.soil;
    const float beach = constants.sea + kBeach;
    const std::int32_t count = shape.width;
    const std::int32_t soil_id = constants.palette.soil;
    const std::int32_t sand_id = constants.palette.sand;
    // What the world does not have is 0 voxels thick.
    const std::int32_t soil_bits = soil_id != LandscapePalette::kNoEntry ? -1 : 0;
    const std::int32_t sand_bits = sand_id != LandscapePalette::kNoEntry ? -1 : 0;
    for (std::int32_t i = 1; i + 1 < count; ++i) {
        const float square = squares[static_cast<std::size_t>(i)];
        const float soil = most_soil * (1.0F - square / kSteepestSoil) *
                           (0.6F + 0.4F * clamp01(1.0F - crest[i])) * (1.0F + 0.6F * noise[i]);
        const auto by_water = static_cast<std::int32_t>(nearness[i] < kSandWidths) |
                              static_cast<std::int32_t>(banks[i] < beach);
        const std::int32_t sand = by_water & static_cast<std::int32_t>(square < kSteepestSnow);
        const std::int32_t thickness = thickness256(sand != 0 ? std::max(kLeastSand, soil) : soil) &
                                       (sand != 0 ? sand_bits : soil_bits);
        soil_of[i] = sand != 0 ? sand_id : soil_id;
        soil_from[i] = std::max(0, top256[i] - thickness);
    }
}

/// Likewise its snow.
void ColumnMaker::find_snow(std::ptrdiff_t first) {
    const LandscapeConstants& constants = sources_.constants;
    if (constants.palette.snow == LandscapePalette::kNoEntry) {
        return;
    }
    const RectangleShape& shape = sources_.region.shape;
    std::array<float, kRectangleSideMax> squares;
    slope_squares(squares.data(), sources_.ground.data() + first, shape.stride(),
                  0.5F / static_cast<float>(shape.step), shape.width);
    const float* __restrict const banks = sources_.banks.data() + first;
    const float* __restrict const noise = sources_.soil.data() + first;
    const float* __restrict const water = sources_.channels.water.data() + first;
    const std::int32_t* __restrict const top256 = row_.top256.data();
    std::int32_t* __restrict const snow_from = row_.snow_from.data();
    const float snow_line = constants.snow_line;
    const std::int32_t count = shape.width;
    for (std::int32_t i = 1; i + 1 < count; ++i) {
        const float above = (banks[i] - snow_line + kSnowLineNoise * noise[i]) * (1.0F / 12.0F);
        const float snow =
            kSnow * clamp01(above) * (1.0F - squares[static_cast<std::size_t>(i)] / kSteepestSnow);
        const std::int32_t thickness = water[i] == kNoWater ? thickness256(snow) : 0;
        snow_from[i] = std::max(0, top256[i] - thickness);
    }
}

/// The packed flow of the layer at the ground, which is `first` or higher.
std::int32_t ColumnMaker::top_flow(const Place& place, std::size_t first) const {
    const Block& block = blocks_[block_count_ - 1];
    const std::size_t plane = sources_.region.plane_size();
    const std::int32_t* const y256 = sources_.region.y256.data() + place.at;
    const std::size_t layers = sources_.region.layers_built;
    for (std::size_t k = first; k < layers; ++k) {
        if (y256[k * plane] + block.moved >= block.top) {
            return place.flow_of(k);
        }
    }
    return place.flow_of(layers - 1);
}

/// What lies where the stack of layers ends below the ground.
LimitTail ColumnMaker::above_stack(std::int32_t last_flow) const {
    const std::uint16_t soil = sources_.constants.palette.soil;
    const auto last = static_cast<std::uint16_t>(sources_.region.layers_built - 1);
    return tail_of(soil != LandscapePalette::kNoEntry ? soil : last, last_flow);
}

std::size_t ColumnMaker::write_block(LimitWriter& out, const Place& place, const Block& block,
                                     std::int32_t end) const {
    LayerWalk walk(row_.layers, static_cast<std::size_t>(place.column), place.flow != nullptr,
                   block.bottom, block.moved);
    if (walk.k < walk.layers) {
        // An overlay of the block below may reach into this one.
        if (end <= out.clear_to() && out.top() <= block.bottom) {
            LimitTail shown = out.shown();
            Limit* const to = put_clear(out.position(), shown, walk, sources_.rules.data(), end);
            out.set_position(to, walk.bottom, shown);
        } else {
            write_overlaid(out, walk, sources_.rules.data(), end);
        }
    }
    if (walk.bottom < end) {  // the stack ends below the ground
        out.write({.bottom = walk.bottom,
                   .top = end,
                   .middle = walk.bottom,
                   .tail = above_stack(place.flow_of(sources_.region.layers_built - 1)),
                   .from = 0});
    }
    return static_cast<std::size_t>(std::min(walk.k, walk.layers - 1));
}

void ColumnMaker::write_overhang(LimitWriter& out, const Place& place) const {
    const Overhang* const overhang = sources_.overhangs.at(place.at);
    if (overhang == nullptr || place.water > kNoWater) {
        return;
    }
    const auto layer = static_cast<std::uint16_t>(overhang->layer);
    const LimitTail rock = tail_of(layer, place.flow_of(static_cast<std::size_t>(overhang->layer)));
    const std::int32_t ground = out.top();
    const std::int32_t top = to_256(overhang->top);
    const bool is_filled = overhang->bottom <= place.ground;
    const std::int32_t bottom = is_filled ? ground : to_256(overhang->bottom);
    if (top <= ground || bottom < ground) {
        return;
    }
    if (bottom > ground) {
        out.write({.bottom = ground,
                   .top = bottom,
                   .middle = ground,
                   .tail = tail_of(sources_.constants.palette.open_air, 0),
                   .from = 0});
    }
    if (top > bottom) {
        out.write({.bottom = bottom, .top = top, .middle = bottom, .tail = rock, .from = rock});
    }
}

ColumnMaker::Place ColumnMaker::place_at(std::int32_t x, std::int32_t z, bool has_flow) const {
    const Region& region = sources_.region;
    Place place;
    place.column = x + region.apron;
    place.row = z + region.apron;
    place.at = row_.at + static_cast<std::size_t>(place.column);
    place.field_at = row_.field_at + static_cast<std::size_t>(place.column);
    place.ground = sources_.banks[place.at];
    place.water = sources_.channels.water[place.at];
    place.top256 = row_.top256[static_cast<std::size_t>(place.column)];
    if (has_flow) {
        place.flow = row_.layers.flow + x;
        place.flow_plane = row_.layers.flow_plane;
    }
    return place;
}

void ColumnMaker::mark_elements(const Limits& limits, std::size_t first, std::size_t end) {
    const std::size_t first_id = sources_.world.base_palette.size();
    for (std::size_t i = first; i < end; ++i) {
        const std::size_t id = limits[i].palette_id;
        if (id >= first_id) {
            element_ids_[id - first_id] = 0;
            element_limits_.push_back(static_cast<std::uint32_t>(i));
        }
    }
}

Limit* ColumnMaker::write_plain(Limit* to, std::size_t i, std::int32_t moved, bool has_flow) const {
    LimitTail shown = kNothingShown;
    const auto lay = [&](std::int32_t from, std::int32_t top, LimitTail tail) {
        if (from < top) {
            if (tail == shown) {
                --to;
            } else {
                put_limit(to++, from, tail);
            }
            put_limit(to++, top, tail);
            shown = tail;
        }
    };
    const Cover cover = cover_of(i);
    const std::int32_t rock_top = std::min(cover.soil_from, cover.snow_from);
    LayerWalk walk(row_.layers, i, has_flow, 0, moved);
    if (walk.bottom < rock_top && walk.k < walk.layers) {
        to = put_clear(to, shown, walk, sources_.rules.data(), rock_top);
    }
    // Where the stack ends below the ground, its last layer's flow goes on.
    const std::ptrdiff_t beyond = walk.k < walk.layers ? 0 : walk.flow_plane;
    const LandscapePalette& palette = sources_.constants.palette;
    if (walk.bottom < rock_top) {
        lay(walk.bottom, rock_top, above_stack(*(walk.flow - beyond)));
    }
    std::int32_t top = row_.top256[i];
    if (rock_top < top) {
        // The cover flows as what it lies on.
        while (walk.k + 1 < walk.layers && walk.top() < top) {
            walk.go_on();
        }
        const LimitTail flow = tail_of(0, *(walk.flow - beyond));
        lay(cover.soil_from, cover.snow_from, flow | cover.soil);
        lay(cover.snow_from, top, flow | palette.snow);
    }
    const float water = sources_.channels.water[row_.at + i];
    if (water > kNoWater && palette.water != LandscapePalette::kNoEntry) {
        lay(top, to_256(water), palette.water);
        top = std::max(top, to_256(water));
    }
    put_limit(to++, top, sources_.world.void_id());
    return to;
}

Limit* ColumnMaker::write_crossed(Limits& limits, std::size_t used, const Place& place) {
    const Cover cover = cover_of(static_cast<std::size_t>(place.column));
    const std::int32_t rock_top = std::min(cover.soil_from, cover.snow_from);
    // The cover flows as what it lies on.
    const bool on_overlay = !overlays_.is_empty() && overlays_.all().back().high == place.top256;
    LimitTail cover_flow = on_overlay ? overlays_.all().back().tail & ~LimitTail{0xffff} : 0;
    overlays_.cut(rock_top);
    const std::int32_t end = find_caves(place);
    LimitWriter out(reserve(limits, used, block_count_, overlays_.size()), overlays_.all());
    std::size_t layer = 0;  // the last of the last block
    for (std::size_t b = 0; b < block_count_; ++b) {
        const std::int32_t block_end = std::min({blocks_[b].top, rock_top, end});
        layer = blocks_[b].bottom < block_end ? write_block(out, place, blocks_[b], block_end) : 0;
    }
    if (rock_top < place.top256 && !on_overlay) {
        cover_flow = tail_of(0, top_flow(place, layer));
    }
    const auto lay = [&](std::int32_t from, std::int32_t to, LimitTail tail) {
        if (from < to) {
            out.write({.bottom = from, .top = to, .middle = from, .tail = tail, .from = 0});
        }
    };
    const LandscapePalette& palette = sources_.constants.palette;
    lay(cover.soil_from, std::min(cover.snow_from, end), cover_flow | cover.soil);
    lay(cover.snow_from, end, cover_flow | palette.snow);
    if (place.water > kNoWater && palette.water != LandscapePalette::kNoEntry) {
        lay(out.top(), to_256(place.water), palette.water);
    }
    write_overhang(out, place);
    return out.end(sources_.world.void_id());
}

std::size_t ColumnMaker::write(Limits& limits, std::size_t used, std::int32_t x, std::int32_t z,
                               bool has_flow) {
    const std::size_t column =
        static_cast<std::size_t>(x) + static_cast<std::size_t>(sources_.region.apron);
    const auto used_by = [&](const Limit* end) {
        return static_cast<std::size_t>(end - limits.data());
    };
    const auto plain = [&](std::int32_t moved) {
        return used_by(write_plain(reserve(limits, used, 1, 0), column, moved, has_flow));
    };
    if (row_.crossed[column] == 0) {
        return plain(row_.folded[column]);
    }
    const std::size_t at = row_.at + column;
    const auto planes = sources_.fractures.planes(row_.field_at + column);
    const Place place = place_at(x, z, has_flow);
    find_blocks(place, planes);
    overlays_.clear();
    const bool meets_lenses = sources_.region.gap_mask[at] != 0;
    for (std::size_t b = 0; meets_lenses && b < block_count_; ++b) {
        find_lenses(place, blocks_[b]);
    }
    const bool has_lenses = !overlays_.is_empty();
    find_sheets(place, planes);
    if (block_count_ == 1 && overlays_.is_empty() && sources_.caves.gaps(at).empty() &&
        sources_.overhangs.at(at) == nullptr) {
        return plain(blocks_[0].moved);
    }
    const std::size_t now = used_by(write_crossed(limits, used, place));
    if (has_lenses) {
        mark_elements(limits, used, now);
    }
    return now;
}

}  // namespace terrane
