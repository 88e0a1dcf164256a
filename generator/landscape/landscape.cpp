#include "generator/landscape/landscape.h"

#include "generator/landscape/caves.h"
#include "generator/landscape/channels.h"
#include "generator/landscape/column_maker.h"
#include "generator/landscape/fractures.h"
#include "generator/landscape/landscape_palette.h"
#include "generator/landscape/numbers.h"
#include "generator/landscape/overhangs.h"
#include "generator/landscape/resistance.h"
#include "generator/terrain/column_writer.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/kernels/vector_pad.h"
#include "generator/terrain/layer_stack.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/plot_cache.h"
#include "generator/terrain/random.h"
#include "generator/terrain/region.h"
#include "generator/terrain/world.h"
#include "generator/volume/limit.h"
#include "generator/world/composition.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

namespace terrane {
namespace {

/// The columns of a region and those that overhangs look at.
RectangleShape field_of(const RectangleShape& shape, std::int32_t apron, std::int32_t reach) {
    if (shape.step != 1) {
        return shape;
    }
    // Overhangs stand over the rectangle and a column around it.
    const std::int32_t margin = std::max(0, reach + 1 - apron);
    return {.x0 = shape.x0 - margin,
            .z0 = shape.z0 - margin,
            .width = shape.width + 2 * margin,
            .length = shape.length + 2 * margin};
}

/// The inner part of a raster, in whole blocks of columns.
void crop(std::vector<float>& out, const std::vector<float>& raster, const RectangleShape& from,
          const RectangleShape& to) {
    out.resize(to.padded_size());
    const float* const first = raster.data() + (to.z0 - from.z0) * from.stride() + to.x0 - from.x0;
    for (std::int32_t z = 0; z < to.length; ++z) {
        const float* const row = first + static_cast<std::ptrdiff_t>(z) * from.stride();
        for (std::int32_t x = 0; x < to.width; x += kVectorPad) {
            std::memcpy(out.data() + static_cast<std::ptrdiff_t>(z) * to.stride() + x, row + x,
                        kVectorPad * sizeof(float));
        }
    }
}

LandscapePalette palette_of(const World& world) {
    Palette palette(world.base_palette.begin(), world.base_palette.begin() + world.void_id() + 1);
    return append_landscape_palette(palette, world.definition);
}

}  // namespace

LandscapeConstants::LandscapeConstants(const World& world)
    : folds(world.definition),
      fractures(world.definition),
      relief(world.definition),
      erosion(world.definition),
      resistance(world.definition, world.stack),
      overhangs(world.definition, resistance),
      channels(world.definition),
      caves(world.definition, world.stack),
      palette(palette_of(world)),
      has_relief(world.definition.relief.height > 0),
      snow_line(static_cast<float>(world.definition.relief.snow_line.value_or(0))),
      has_snow(world.definition.relief.snow_line.has_value()),
      soil(static_cast<float>(world.definition.relief.soil)),
      sea(channels.sea),
      water_table(static_cast<float>(world.definition.caves.water_table)),
      soil_noise(Noise::make(key(world.definition.seed, LandscapeTag::soil, 0), 40, 2)) {}

Landscape::Landscape(const World& world) : world_(&world), constants_(world) {}

/// Where column (x, z) of `shape` lies in the field's rasters.
std::size_t Landscape::field_index(const RectangleShape& shape, std::int32_t x,
                                   std::int32_t z) const {
    // Only at level 0 are the two apart.
    return static_cast<std::size_t>((shape.z0 - field_.z0 + z) * field_.stride() +
                                    (shape.x0 - field_.x0 + x));
}

void Landscape::build_fields(const Region& region, const RowKernels& kernels) {
    field_ = field_of(region.shape, region.apron, constants_.overhangs.reach);
    fields_ = &field_builder_.build({.folds = constants_.folds,
                                     .relief = constants_.relief,
                                     .erosion = constants_.erosion,
                                     .has_relief = constants_.has_relief},
                                    field_, kernels, noise_);
    fractures_.build(constants_.fractures, field_, kernels, noise_);
    if (!constants_.has_relief) {
        return;
    }
    moved_ = fields_->folds;
    if (!fractures_.is_empty()) {
        for (std::int32_t z = 0; z < field_.length; ++z) {
            for (std::int32_t x = 0; x < field_.width; ++x) {
                const std::size_t i = field_.index(x, z);
                const auto planes = fractures_.planes(i);
                if (!planes.empty()) {
                    moved_[i] += displacement_at(planes, fields_->raw[i]);
                }
            }
        }
    }
}

void Landscape::build_ground(Region& region, const TerrainConstants& constants,
                             const RowKernels& kernels) {
    const RectangleShape& shape = region.shape;
    const std::size_t size = shape.padded_size();
    const std::size_t layer_count = constants.rules.size();
    for (std::vector<float>* raster : {&rest_, &ground_}) {
        raster->resize(size);
    }
    const LayerHeights layers{.first = region.heights.data(), .plane = region.plane_size()};
    if (!constants_.has_relief) {
        // The stack's own top, moved.
        while (region.layers_built < layer_count) {
            build_layer(region, constants, kernels);
        }
        const float* const top = layers.first + (layer_count - 1) * layers.plane;
        for (std::int32_t z = 0; z < shape.length; ++z) {
            for (std::int32_t x = 0; x < shape.width; ++x) {
                const std::size_t i = shape.index(x, z);
                const std::size_t at = field_index(shape, x, z);
                const float folded = top[i] + fields_->folds[at];
                ground_[i] =
                    std::max(2.0F, folded + displacement_at(fractures_.planes(at), folded));
            }
        }
        for (std::vector<float>* raster : {&relief_.crest, &relief_.river}) {
            raster->assign(size, 1.0F);
        }
        relief_.is_smooth = false;
        return;
    }
    over_.assign(size, 0.0F);
    for (std::int32_t z = 0; z < shape.length; ++z) {
        const std::size_t from = field_index(shape, 0, z);
        float* const over = over_.data() + static_cast<std::ptrdiff_t>(z) * shape.stride();
        for (std::size_t x = 0; x < static_cast<std::size_t>(shape.width); ++x) {
            over[x] = fields_->raw[from + x] - moved_[from + x];
        }
    }
    ResistanceWalk walk(ground_.data(), rest_.data(), over_.data(), size);
    for (std::size_t k = 0; k < layer_count; ++k) {
        if (k == region.layers_built) {
            build_layer(region, constants, kernels);
        }
        if (!walk.pass(constants_.resistance.layers[k], layers, k, kernels)) {
            break;
        }
    }
    for (std::int32_t z = 0; z < shape.length; ++z) {
        const std::size_t from = field_index(shape, 0, z);
        float* const ground = ground_.data() + static_cast<std::ptrdiff_t>(z) * shape.stride();
        for (std::size_t x = 0; x < static_cast<std::size_t>(shape.width); ++x) {
            const std::size_t at = from + x;
            const float raw = fields_->raw[at];
            const float share = smooth_step(0.04F, 0.3F, fields_->crest[at]);
            ground[x] = std::max(
                2.0F, raw + (ground[x] + moved_[at] - raw) * share + fields_->fine[at] * share);
        }
    }
}

/// Dry ground beside water is no lower than kBankUnder below it, so that no water stands in the
/// air. Where two arms of a river touch, the higher one's column is such a bank.
void Landscape::raise_banks(const Region& region) {
    constexpr float kBankUnder = 0.7F;
    const RectangleShape& shape = region.shape;
    banks_ = ground_;
    if (shape.step != 1 || !channels_.is_wet) {
        return;
    }
    channels_.levels = channels_.water;
    const auto stride = static_cast<std::size_t>(shape.stride());
    const auto width = static_cast<std::size_t>(shape.width);
    const auto higher = [](float a, float b) { return a < b ? b : a; };
    const auto lower = [](float a, float b) { return b < a ? b : a; };
    std::array<float, kRectangleSideMax> highest;  // of a column and the rows beside it
    std::array<float, kRectangleSideMax> lowest;   // likewise, of wet columns
    for (std::size_t z = 1; z + 1 < static_cast<std::size_t>(shape.length); ++z) {
        const float* __restrict const level = channels_.levels.data() + z * stride;
        const float* __restrict const before = level - stride;
        const float* __restrict const after = level + stride;
        const auto wet = [](float one) { return one > kNoWater ? one : -kNoWater; };
        for (std::size_t x = 0; x < width; ++x) {
            highest[x] = higher(level[x], higher(before[x], after[x]));
            lowest[x] = lower(wet(level[x]), lower(wet(before[x]), wet(after[x])));
        }
        float* __restrict const banks = banks_.data() + z * stride;
        float* __restrict const water = channels_.water.data() + z * stride;
        for (std::size_t x = 1; x + 1 < width; ++x) {
            const float high = higher(highest[x], higher(highest[x - 1], highest[x + 1]));
            const float low = lower(lowest[x], lower(lowest[x - 1], lowest[x + 1]));
            const bool is_wet = level[x] > kNoWater && level[x] - low <= kBankUnder;
            water[x] = is_wet ? level[x] : kNoWater;
            banks[x] = higher(banks[x], is_wet ? kNoWater : high - kBankUnder);
        }
    }
}

/// Between which heights of the stack as it was laid down something of it shows, column by column:
/// what is above the relief has been cut away, and folds have taken what is below the bottom of the
/// world.
void Landscape::find_shown(const Region& region) {
    constexpr float kSlack = 0.1F;  // voxels; far above rounding errors
    const RectangleShape& shape = region.shape;
    shown_.assign(region.plane_size(), INT32_MIN);
    buried_.assign(region.plane_size(), INT32_MAX);
    const bool has_planes = !fractures_.is_empty();
    for (std::int32_t z = 1; z + 1 < shape.length; ++z) {
        const std::size_t first = shape.index(0, z);
        const std::size_t at = field_index(shape, 0, z);
        // The most that any block of a column was lowered and lifted by.
        std::array<float, kRectangleSideMax> lowered;
        std::array<float, kRectangleSideMax> lifted;
        const auto width = static_cast<std::size_t>(shape.width);
        std::copy_n(fields_->folds.data() + at, width, lowered.data());
        std::copy_n(fields_->folds.data() + at, width, lifted.data());
        for (std::size_t x = 1; has_planes && x + 1 < width; ++x) {
            for (const PlaneInColumn& one : fractures_.planes(at + x)) {
                lowered[x] -= one.half_throw;
                lifted[x] += one.half_throw;
            }
        }
        const float* __restrict const banks = banks_.data() + first;
        std::int32_t* __restrict const shown = shown_.data() + first;
        std::int32_t* __restrict const buried = buried_.data() + first;
        for (std::size_t x = 1; x + 1 < width; ++x) {
            const float top = std::max(banks[x], 2.0F) - lowered[x] + kSlack;
            shown[x] = static_cast<std::int32_t>(top * kUnitsPerVoxel) + 1;
            buried[x] = static_cast<std::int32_t>((-lifted[x] - kSlack) * kUnitsPerVoxel) - 1;
        }
    }
}

/// Layers, lenses and flow as far as they show in some column.
void Landscape::build_shown(Region& region, const TerrainConstants& constants,
                            const RowKernels& kernels, PlotCache& plots) {
    const std::size_t plane = region.plane_size();
    const std::size_t layers = constants.rules.size();
    find_shown(region);
    std::array<bool, kLayersMax> shows{};
    shows[0] = true;
    overhangs_.for_each(
        [&](const Overhang& one) { shows[static_cast<std::size_t>(one.layer)] = true; });
    const auto any_below = [plane](const std::int32_t* low, const std::int32_t* high) {
        // Mostly the first few tell.
        constexpr std::size_t kAtOnce = 128;
        std::int32_t found = 0;
        for (std::size_t i = 0; i < plane && found == 0; i += kAtOnce) {
            const std::size_t end = std::min(i + kAtOnce, plane);
            for (std::size_t n = i; n < end; ++n) {
                found |= static_cast<std::int32_t>(low[n] < high[n]);
            }
        }
        return found != 0;
    };
    for (std::size_t k = 0; k < layers; ++k) {
        if (k > 0 && !any_below(region.y256.data() + (k - 1) * plane, shown_.data())) {
            break;
        }
        if (k == region.layers_built) {
            build_layer(region, constants, kernels);
        }
        if (k > 0) {
            build_blends(region, constants, k, kernels);
        }
        // Where the whole stack ends below the ground, what is on it flows as its last layer.
        shows[k] = shows[k] || k + 1 == layers ||
                   any_below(buried_.data(), region.y256.data() + k * plane);
    }
    place_elements(region, *world_, shown_.data(), plots, kernels);
    for (const PlacedElement& placed : region.elements) {
        shows[static_cast<std::size_t>(placed.element().gap)] = true;
    }
    for (std::size_t k = 0; k < region.layers_built; ++k) {
        if (shows[k]) {
            build_flow(region, constants, k, kernels);
        }
    }
}

void Landscape::build(Region& region, const TerrainConstants& constants, PlotCache& plots,
                      const RowKernels& kernels) {
    const RectangleShape& shape = region.shape;
    build_fields(region, kernels);
    build_ground(region, constants, kernels);
    if (shape.step == 1 && constants_.has_relief) {
        overhangs_.build(constants_.overhangs, constants_.resistance,
                         {.field = field_,
                          .raw = fields_->raw.data(),
                          .moved = moved_.data(),
                          .crest = fields_->crest.data(),
                          .fine = fields_->fine.data()},
                         region, constants, ground_.data(), kernels, noise_);
    } else {
        overhangs_.clear();
    }
    if (constants_.has_relief) {
        crop(relief_.crest, fields_->crest, field_, shape);
        crop(relief_.river, fields_->river, field_, shape);
        crop(relief_.wander_x, fields_->wander_x, field_, shape);
        crop(relief_.wander_z, fields_->wander_z, field_, shape);
        relief_.is_smooth = fields_->is_smooth;
    }
    if (shape.step == 1 && constants_.caves.cell > 0) {
        cave_graph_.build(constants_.caves, constants_.folds, shape);
        for (std::size_t i = 0; i < rest_.size(); ++i) {
            rest_[i] = smooth_step(0.15F, 0.35F, relief_.crest[i]);
        }
        cut_funnels(ground_.data(), rest_.data(), cave_graph_, shape);
        for (float& ground : ground_) {
            ground = std::max(2.0F, ground);
        }
    }
    cut_channels(ground_.data(), channels_, constants_.channels, relief_, field_builder_.rivers(),
                 shape, kernels);
    raise_banks(region);
    overhangs_.break_off(banks_.data());
    if (shape.step == 1 && constants_.caves.cell > 0) {
        caves_.build(constants_.caves, cave_graph_, banks_.data(), shape, kernels, noise_);
    } else {
        caves_.clear();
    }
    build_shown(region, constants, kernels, plots);
    if (constants_.has_relief) {
        soil_.resize(shape.padded_size());
        noise_rectangle(soil_.data(), constants_.soil_noise, shape, kernels, noise_);
    }
}

void Landscape::write(const ColumnWriterOutput& out, const Region& region,
                      const TerrainConstants& constants, std::int32_t apron) {
    const ColumnRectangle& rectangle = region.inner;
    ColumnGrid& grid = out.grid;
    grid.x_first = grid.z_first = -apron;
    grid.width = rectangle.width + 2 * apron;
    grid.length = rectangle.length + 2 * apron;
    grid.offsets.resize(
        static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.length) + 1);
    std::uint32_t* end_of = grid.offsets.data();
    *end_of++ = 0;
    out.element_ids.assign(region.elements.size(), kNoPaletteId);
    out.element_limits.clear();
    std::int32_t highest = 0;
    ColumnMaker maker({.world = *world_,
                       .constants = constants_,
                       .rules = constants.rules,
                       .region = region,
                       .ground = ground_,
                       .banks = banks_,
                       .crest = relief_.crest,
                       .river = relief_.river,
                       .soil = soil_,
                       .channels = channels_,
                       .caves = caves_,
                       .overhangs = overhangs_,
                       .fractures = fractures_,
                       .folds = fields_->folds,
                       .field = field_,
                       .field_first = field_index(region.shape, 0, 0)},
                      out.element_ids, out.element_limits);
    std::size_t used = 0;
    for (std::int32_t z = -apron; z < rectangle.length + apron; ++z) {
        maker.begin_row(z);
        const bool is_inner_row = z >= 0 && z < rectangle.length;
        for (std::int32_t x = -apron; x < rectangle.width + apron; ++x) {
            const bool is_inner = is_inner_row && x >= 0 && x < rectangle.width;
            used = maker.write(grid.limits, used, x, z, is_inner);
            *end_of++ = static_cast<std::uint32_t>(used);
            if (is_inner) {
                highest = std::max(highest, grid.limits[used - 1].y256);
            }
        }
    }
    out.highest_y256 = highest;
    grid.limits.resize(used);
    number_elements(out, region, *world_);
}

}  // namespace terrane
