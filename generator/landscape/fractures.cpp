#include "generator/landscape/fractures.h"

#include "generator/landscape/numbers.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/random.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {
namespace {

struct Fracture {
    std::int64_t x = 0;  ///< its middle
    std::int64_t z = 0;
    float along_x = 1;
    float along_z = 0;
    float length = 0;
    float reach = 0;
    float tangent = 0;
    float half_throw = 0;
    float half_sheet = 0;  ///< upright thickness
    float y_reference = 0;
    std::uint32_t filling = 0;
};

constexpr double kSecondSetShare = 0.35;
constexpr double kDykeShare = 0.25;
constexpr double kSheetShare = 0.6;
constexpr float kWarp = 5;  ///< columns

Fracture draw_fracture(RandomStream& random, const FractureConstants& constants, std::int64_t i,
                       std::int64_t j) {
    constexpr auto kCell = static_cast<double>(kFractureCell);
    Fracture fracture;
    fracture.filling = static_cast<std::uint32_t>(random.next() >> 32U);
    fracture.x = i * kFractureCell + static_cast<std::int64_t>(random.unit() * kCell);
    fracture.z = j * kFractureCell + static_cast<std::int64_t>(random.unit() * kCell);
    const double set = random.unit() < 1 - kSecondSetShare ? 0 : 0.25;
    const Direction along =
        direction_of(constants.strike + 0.25 + set + (random.unit() - 0.5) * 0.09);
    fracture.along_x = static_cast<float>(along.x);
    fracture.along_z = static_cast<float>(along.z);
    const double length = std::min(kCell, constants.length * (0.5 + 0.5 * random.unit()));
    fracture.length = static_cast<float>(length);
    fracture.reach = static_cast<float>(std::min(kCell, 0.6 * length));
    const double tangent = constants.dip * (0.7 + 0.6 * random.unit());
    fracture.tangent = static_cast<float>(random.unit() < 0.5 ? -tangent : tangent);
    const double slip = constants.throw_voxels * (0.3 + 0.7 * random.unit());
    fracture.y_reference = static_cast<float>(constants.y_reference);
    const double kind = random.unit();
    const double thickness = constants.sheet * (0.4 + 0.6 * random.unit());
    fracture.half_throw = kind < kDykeShare ? 0.0F : static_cast<float>(slip * 0.5);
    fracture.half_sheet =
        kind < kSheetShare ? static_cast<float>(thickness * 0.5 * std::sqrt(1 + tangent * tangent))
                           : 0.0F;
    return fracture;
}

/// Whether a fracture's ellipse can meet the shape: its l and a are linear but for the warp, so
/// their extremes are at the corners.
bool can_meet(const Fracture& fracture, const RectangleShape& shape) {
    constexpr float kSlack = kWarp + 1;
    const auto x0 = static_cast<float>(shape.x0 - fracture.x);
    const auto z0 = static_cast<float>(shape.z0 - fracture.z);
    const auto x1 = x0 + static_cast<float>((shape.width - 1) * shape.step);
    const auto z1 = z0 + static_cast<float>((shape.length - 1) * shape.step);
    float l_min = 1e9F;
    float l_max = -1e9F;
    float a_min = 1e9F;
    float a_max = -1e9F;
    for (const float x : {x0, x1}) {
        for (const float z : {z0, z1}) {
            const float l = x * fracture.along_x + z * fracture.along_z;
            const float a = z * fracture.along_x - x * fracture.along_z;
            l_min = std::min(l_min, l);
            l_max = std::max(l_max, l);
            a_min = std::min(a_min, a);
            a_max = std::max(a_max, a);
        }
    }
    return l_min < fracture.length + kSlack && l_max > -fracture.length - kSlack &&
           a_min < fracture.reach + kSlack && a_max > -fracture.reach - kSlack;
}

/// Columns first..end - 1 of a row.
struct Columns {
    std::int32_t first = 0;
    std::int32_t end = 0;
};

/// Those of `columns` where at + slope * column can be within `most` of 0; with slack.
Columns columns_within(const Columns& columns, float at, float slope, float most) {
    constexpr float kLevel = 1e-3F;
    if (std::abs(slope) < kLevel) {
        return columns;
    }
    const float one = (-most - at) / slope;
    const float other = (most - at) / slope;
    const auto clamped = [&](float column) {
        return static_cast<std::int32_t>(
            std::clamp(column, static_cast<float>(columns.first), static_cast<float>(columns.end)));
    };
    return {.first = clamped(std::floor(std::min(one, other)) - 1.0F),
            .end = clamped(std::floor(std::max(one, other)) + 3.0F)};
}

std::vector<Fracture> find_fractures(const FractureConstants& constants,
                                     const RectangleShape& shape) {
    std::vector<Fracture> found;
    const std::int64_t i0 = floor_div(shape.x0, kFractureCell) - 1;
    const std::int64_t j0 = floor_div(shape.z0, kFractureCell) - 1;
    const std::int64_t i1 = floor_div(shape.x0 + (shape.width - 1) * shape.step, kFractureCell) + 1;
    const std::int64_t j1 =
        floor_div(shape.z0 + (shape.length - 1) * shape.step, kFractureCell) + 1;
    for (std::int64_t j = j0; j <= j1; ++j) {
        for (std::int64_t i = i0; i <= i1; ++i) {
            RandomStream random(key(constants.seed, LandscapeTag::fracture, i, j));
            const auto count = static_cast<std::int32_t>(constants.density + random.unit());
            for (std::int32_t n = 0; n < count; ++n) {
                const Fracture fracture = draw_fracture(random, constants, i, j);
                if ((fracture.half_throw > 0 || fracture.half_sheet > 0) &&
                    can_meet(fracture, shape)) {
                    found.push_back(fracture);
                }
            }
        }
    }
    return found;
}

}  // namespace

FractureConstants::FractureConstants(const WorldDefinition& definition)
    : density(definition.structure.fault_density),
      throw_voxels(definition.structure.fault_throw),
      length(definition.structure.fault_length),
      dip(definition.structure.fault_dip),
      sheet(definition.structure.sheet),
      strike(definition.structure.fold_direction),
      y_reference(definition.terrain.depth / 2),
      seed(definition.seed),
      warp(Noise::make(key(definition.seed, LandscapeTag::warp, 0), 48, 2)) {}

double FractureConstants::bound() const {
    return density > 0 ? static_cast<double>(kPlanesPerColumnMax) * throw_voxels / 2 : 0;
}

void FractureField::build(const FractureConstants& constants, const RectangleShape& shape,
                          const RowKernels& kernels, NoiseBuffers& buffers) {
    pool_used_ = 0;
    counts_.clear();
    if (constants.density <= 0 || shape.step * 2 > kFractureCell) {
        return;
    }
    const std::vector<Fracture> fractures = find_fractures(constants, shape);
    if (fractures.empty()) {
        return;
    }
    const std::size_t size = shape.padded_size();
    counts_.assign(size, 0);
    places_.resize(size);
    warp_.resize(size);
    noise_rectangle(warp_.data(), constants.warp, shape, kernels, buffers);
    for (const Fracture& fracture : fractures) {
        const auto x0 = static_cast<float>(shape.x0 - fracture.x);
        const auto z0 = static_cast<float>(shape.z0 - fracture.z);
        const auto step = static_cast<float>(shape.step);
        for (std::int32_t row = 0; row < shape.length; ++row) {
            const float z = z0 + static_cast<float>(row) * step;
            const std::size_t first = shape.index(0, row);
            Columns columns{.first = 0, .end = shape.width};
            columns = columns_within(columns, x0 * fracture.along_x + z * fracture.along_z,
                                     step * fracture.along_x, fracture.length + 1);
            columns = columns_within(columns, z * fracture.along_x - x0 * fracture.along_z,
                                     -step * fracture.along_z, fracture.reach + kWarp + 1);
            for (std::int32_t column = columns.first; column < columns.end; ++column) {
                const float x = x0 + static_cast<float>(column) * step;
                const std::size_t i = first + static_cast<std::size_t>(column);
                const float l = (x * fracture.along_x + z * fracture.along_z) / fracture.length;
                const float a = z * fracture.along_x - x * fracture.along_z + kWarp * warp_[i];
                const float across = a / fracture.reach;
                const float end = 1.0F - l * l;
                const float side = 1.0F - across * across;
                if (end <= 0 || side <= 0 || counts_[i] == kPlanesPerColumnMax) {
                    continue;
                }
                const float m = end * end * side * side;
                if (counts_[i] == 0) {
                    places_[i] = static_cast<std::uint32_t>(pool_used_++);
                    if (pool_.size() < pool_used_ * kPlanesPerColumnMax) {
                        pool_.resize(2 * pool_used_ * kPlanesPerColumnMax);
                    }
                }
                pool_[places_[i] * kPlanesPerColumnMax + counts_[i]++] = {
                    .y = fracture.y_reference - a * fracture.tangent,
                    .half_throw = fracture.half_throw * m,
                    .half_sheet = fracture.half_sheet * std::min(1.0F, 2.5F * m),
                    .filling = fracture.filling};
            }
        }
    }
}

float displacement_at(std::span<const PlaneInColumn> planes, float y) {
    float sum = 0;
    for (const PlaneInColumn& plane : planes) {
        sum += y > plane.y ? -plane.half_throw : plane.half_throw;
    }
    return sum;
}

}  // namespace terrane
