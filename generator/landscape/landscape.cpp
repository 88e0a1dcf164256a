#include "generator/landscape/landscape.h"

#include "generator/landscape/column_maker.h"
#include "generator/landscape/numbers.h"
#include "generator/terrain/random.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace terrane {
namespace {

/// The shape without `margin` columns on each side.
RectangleShape shrunk(const RectangleShape& shape, std::int32_t margin) {
    return {.x0 = shape.x0 + margin * shape.step,
            .z0 = shape.z0 + margin * shape.step,
            .width = shape.width - 2 * margin,
            .length = shape.length - 2 * margin,
            .step = shape.step};
}

/// Keeps the inner part of a raster.
void crop(std::vector<float>& raster, const RectangleShape& from, const RectangleShape& to,
          std::int32_t margin) {
    if (margin == 0) {
        return;
    }
    for (std::int32_t z = 0; z < to.length; ++z) {
        const float* const row =
            raster.data() + static_cast<std::ptrdiff_t>(z + margin) * from.stride() + margin;
        std::copy(row, row + to.width,
                  raster.data() + static_cast<std::ptrdiff_t>(z) * to.stride());
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

ColumnRectangle Landscape::region_for(const ColumnRectangle& rectangle) {
    return {.x0 = rectangle.x0 - rectangle.step(),
            .z0 = rectangle.z0 - rectangle.step(),
            .width = rectangle.width + 2,
            .length = rectangle.length + 2,
            .lod = rectangle.lod};
}

void Landscape::build_fields(const ColumnRectangle& rectangle, const Region& region,
                             const RowKernels& kernels) {
    const std::int32_t margin = rectangle.lod == 0 ? constants_.overhangs.reach : 0;
    field_ = shrunk(region.shape, -margin);
    const std::size_t size = field_.padded_size();
    for (std::vector<float>* raster : {&folds_, &raw_, &fine_, &moved_}) {
        raster->resize(size);
    }
    fold_rectangle(folds_.data(), constants_.folds, field_, kernels, noise_);
    fractures_.build(constants_.fractures, field_, kernels, noise_);
    if (!constants_.has_relief) {
        return;
    }
    relief_builder_.build(relief_, constants_.relief, field_, kernels, noise_);
    if (relief_.has_rivers) {
        erode(raw_.data(), fine_.data(), relief_, constants_.erosion, field_, kernels, erosion_);
    } else {
        std::fill(raw_.begin(), raw_.end(), constants_.erosion.coarse_amplitude);
        std::fill(fine_.begin(), fine_.end(), 0.0F);
    }
    for (std::size_t i = 0; i < size; ++i) {
        raw_[i] = relief_.ground[i] + relief_.mountain[i] * raw_[i];
        fine_[i] = relief_.mountain[i] * fine_[i];
        moved_[i] = folds_[i];
    }
    if (!fractures_.is_empty()) {
        for (std::int32_t z = 0; z < field_.length; ++z) {
            for (std::int32_t x = 0; x < field_.width; ++x) {
                const auto i = static_cast<std::size_t>(z * field_.stride() + x);
                const auto planes = fractures_.planes(i);
                if (!planes.empty()) {
                    moved_[i] += displacement_at(planes, raw_[i]);
                }
            }
        }
    }
}

void Landscape::build_ground(const Region& region) {
    const RectangleShape& shape = region.shape;
    const auto margin = static_cast<std::int32_t>((shape.x0 - field_.x0) / shape.step);
    const std::size_t size = shape.padded_size();
    for (std::vector<float>* raster : {&over_, &rest_, &ground_}) {
        raster->resize(size);
    }
    const LayerHeights layers{.first = region.heights.data(), .plane = region.plane_size()};
    if (!constants_.has_relief) {
        // The stack's own top, moved.
        const float* const top =
            layers.first + (constants_.resistance.layers.size() - 1) * layers.plane;
        for (std::int32_t z = 0; z < shape.length; ++z) {
            for (std::int32_t x = 0; x < shape.width; ++x) {
                const auto i = static_cast<std::size_t>(z * shape.stride() + x);
                const auto at =
                    static_cast<std::size_t>((z + margin) * field_.stride() + x + margin);
                const float folded = top[i] + folds_[at];
                ground_[i] =
                    std::max(2.0F, folded + displacement_at(fractures_.planes(at), folded));
            }
        }
        for (std::vector<float>* raster : {&relief_.crest, &relief_.river}) {
            raster->assign(size, 1.0F);
        }
        relief_.has_rivers = false;
        return;
    }
    for (std::int32_t z = 0; z < shape.length; ++z) {
        for (std::int32_t x = 0; x < shape.width; ++x) {
            const auto i = static_cast<std::size_t>(z * shape.stride() + x);
            const auto at = static_cast<std::size_t>((z + margin) * field_.stride() + x + margin);
            over_[i] = raw_[at] - moved_[at];
        }
    }
    resist(ground_.data(), rest_.data(), over_.data(), constants_.resistance, layers, size);
    for (std::int32_t z = 0; z < shape.length; ++z) {
        for (std::int32_t x = 0; x < shape.width; ++x) {
            const auto i = static_cast<std::size_t>(z * shape.stride() + x);
            const auto at = static_cast<std::size_t>((z + margin) * field_.stride() + x + margin);
            const float raw = raw_[at];
            const float share = smooth_step(0.04F, 0.3F, relief_.crest[at]);
            ground_[i] =
                std::max(2.0F, raw + (ground_[i] + moved_[at] - raw) * share + fine_[at] * share);
        }
    }
}

/// Dry ground beside water is no lower than kBankUnder below it, so that no water stands in the
/// air.
void Landscape::raise_banks(const Region& region) {
    constexpr float kBankUnder = 0.7F;
    const RectangleShape& shape = region.shape;
    banks_ = ground_;
    if (shape.step != 1) {
        return;
    }
    const std::int32_t stride = shape.stride();
    for (std::int32_t z = 1; z + 1 < shape.length; ++z) {
        for (std::int32_t x = 1; x + 1 < shape.width; ++x) {
            const auto i = static_cast<std::size_t>(z * stride + x);
            if (channels_.water[i] > kNoWater) {
                continue;
            }
            float highest = kNoWater;
            for (std::int32_t dz = -1; dz <= 1; ++dz) {
                for (std::int32_t dx = -1; dx <= 1; ++dx) {
                    highest = std::max(
                        highest,
                        channels_.water[static_cast<std::size_t>((z + dz) * stride + x + dx)]);
                }
            }
            banks_[i] = std::max(banks_[i], highest - kBankUnder);
        }
    }
}

/// Flow of the layers that show in some column: what the relief has cut away needs none.
void Landscape::build_flows(Region& region, const TerrainConstants& constants,
                            const ColumnRectangle& rectangle, const RowKernels& kernels) {
    constexpr float kSlack = 0.1F;  // voxels; far above rounding errors
    const RectangleShape& shape = region.shape;
    const auto margin = static_cast<std::int32_t>((shape.x0 - field_.x0) / shape.step);
    const std::size_t layers = constants.rules.size();
    std::array<bool, kLayersMax> shows{};
    shows[0] = true;
    shown_.assign(region.plane_size(), 0);
    for (std::int32_t z = 2; z < rectangle.length + 2; ++z) {
        for (std::int32_t x = 2; x < rectangle.width + 2; ++x) {
            const auto i = static_cast<std::size_t>(z * shape.stride() + x);
            const auto at = static_cast<std::size_t>((z + margin) * field_.stride() + x + margin);
            // The most that any block of the column was lowered by.
            float moved = folds_[at];
            for (const PlaneInColumn& plane : fractures_.planes(at)) {
                moved -= plane.half_throw;
            }
            shown_[i] = static_cast<std::int32_t>(
                std::ceil((std::max(banks_[i], 2.0F) - moved + kSlack) * kUnitsPerVoxel));
            if (const Overhang* const overhang = overhangs_.at(i); overhang != nullptr) {
                shows[static_cast<std::size_t>(overhang->layer)] = true;
            }
        }
    }
    for (std::size_t k = 0; k < layers; ++k) {
        if (!shows[k]) {
            const std::int32_t* const bottom = region.y256.data() + (k - 1) * region.plane_size();
            std::int32_t found = 0;
            for (std::size_t i = 0; i < shown_.size(); ++i) {
                found |= static_cast<std::int32_t>(bottom[i] < shown_[i]);
            }
            shows[k] = found != 0;
        }
        if (shows[k]) {
            build_flow(region, constants, k, kernels);
        }
    }
}

void Landscape::write(const ColumnWriterOutput& out, Region& region,
                      const TerrainConstants& constants, const ColumnRectangle& rectangle,
                      std::int32_t apron, const RowKernels& kernels) {
    const RectangleShape& shape = region.shape;
    build_fields(rectangle, region, kernels);
    build_ground(region);
    const auto margin = static_cast<std::int32_t>((shape.x0 - field_.x0) / shape.step);
    const LayerHeights layers{.first = region.heights.data(), .plane = region.plane_size()};
    if (shape.step == 1 && constants_.has_relief) {
        overhangs_.build(constants_.overhangs, constants_.resistance,
                         {.field = field_,
                          .raw = raw_.data(),
                          .moved = moved_.data(),
                          .crest = relief_.crest.data(),
                          .fine = fine_.data()},
                         shape, layers, ground_.data(), kernels, noise_);
    } else {
        overhangs_ = {};
    }
    if (constants_.has_relief) {
        for (std::vector<float>* raster :
             {&relief_.crest, &relief_.river, &relief_.wander_x, &relief_.wander_z}) {
            crop(*raster, field_, shape, margin);
        }
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
        caves_.build(constants_.caves, cave_graph_, shape, kernels, noise_);
    } else {
        caves_ = {};
    }
    cut_channels(ground_.data(), channels_, constants_.channels, relief_, relief_builder_.rivers(),
                 shape);
    raise_banks(region);
    build_flows(region, constants, rectangle, kernels);
    soil_.resize(shape.padded_size());
    noise_rectangle(soil_.data(), constants_.soil_noise, shape, kernels, noise_);

    ColumnGrid& grid = out.grid;
    grid.x_first = grid.z_first = -apron;
    grid.width = rectangle.width + 2 * apron;
    grid.length = rectangle.length + 2 * apron;
    grid.offsets.clear();
    grid.offsets.push_back(0);
    grid.limits.clear();
    out.element_ids.assign(region.elements.size(), kNoPaletteId);
    out.element_limits.clear();
    out.highest_y256 = 0;
    const ColumnMaker maker({.world = *world_,
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
                             .folds = folds_,
                             .field = field_,
                             .margin = margin});
    for (std::int32_t z = -apron; z < rectangle.length + apron; ++z) {
        for (std::int32_t x = -apron; x < rectangle.width + apron; ++x) {
            const bool is_inner = x >= 0 && z >= 0 && x < rectangle.width && z < rectangle.length;
            maker.make(runs_, x, z, is_inner);
            const std::size_t first = grid.limits.size();
            runs_.write(grid.limits, world_->void_id());
            grid.offsets.push_back(static_cast<std::uint32_t>(grid.limits.size()));
            // Only columns that lenses meet can show one.
            const auto at = static_cast<std::size_t>((z + 2) * shape.stride() + x + 2);
            for (std::size_t i = first; region.gap_mask[at] != 0 && i < grid.limits.size(); ++i) {
                const std::size_t id = grid.limits[i].palette_id;
                if (id >= world_->base_palette.size()) {
                    out.element_ids[id - world_->base_palette.size()] = 0;
                    out.element_limits.push_back(static_cast<std::uint32_t>(i));
                }
            }
            if (is_inner) {
                out.highest_y256 = std::max(out.highest_y256, grid.limits.back().y256);
            }
        }
    }
    number_elements(out, region, *world_);
}

}  // namespace terrane
