#include "generator/landscape/relief.h"

#include "generator/landscape/numbers.h"
#include "generator/terrain/random.h"
#include "protocol/base/coords.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace terrane {
namespace {

constexpr std::size_t kValues = 4;

/// Weights of the four lattice points around a place, and their slopes a column.
struct Taps {
    std::array<float, 4> weight{};
    std::array<float, 4> slope{};
};

/// The uniform cubic B-spline `eighths` of a step behind the second point.
Taps taps_at(std::int64_t eighths) {
    constexpr float kSixth = 1.0F / 6.0F;
    constexpr float kPerColumn = 0.5F / static_cast<float>(kLatticeStep);
    const float t = static_cast<float>(eighths) / static_cast<float>(kLatticeStep);
    const float s = 1.0F - t;
    return {.weight = {s * s * s * kSixth, (3.0F * t * t * t - 6.0F * t * t + 4.0F) * kSixth,
                       (3.0F * s * s * s - 6.0F * s * s + 4.0F) * kSixth, t * t * t * kSixth},
            .slope = {-s * s * kPerColumn, (3.0F * t * t - 4.0F * t) * kPerColumn,
                      (4.0F * s - 3.0F * s * s) * kPerColumn, t * t * kPerColumn}};
}

/// A place moved by the noise that makes rivers wind.
struct MovedPlace {
    std::int64_t x = 0;
    std::int64_t z = 0;
    float x_rest = 0;  ///< 0..1
    float z_rest = 0;
};

MovedPlace moved(std::int64_t x, std::int64_t z, float by_x, float by_z) {
    const float whole_x = std::floor(by_x);
    const float whole_z = std::floor(by_z);
    return {.x = x + static_cast<std::int64_t>(whole_x),
            .z = z + static_cast<std::int64_t>(whole_z),
            .x_rest = by_x - whole_x,
            .z_rest = by_z - whole_z};
}

struct Valley {
    float river = 0;
    float crest = 0;
};

float crest_of(const ReliefConstants& constants, float t) {
    const float square = t * t;
    return lerp(std::sqrt(square + 0.03F) - 0.173F, square / (square + 0.15F), constants.plateau);
}

Valley valley_at(const ReliefConstants& constants, const RiverGraph& rivers,
                 const MovedPlace& place) {
    const float reach = 1.1F * constants.valley;
    const float inverse_reach_square = 1.0F / (reach * reach);
    const float e2 = 0.0025F * constants.valley * constants.valley;
    const std::int64_t row = constants.rivers.row_of(place.z);
    const std::int64_t cell = constants.rivers.cell_of(place.x, row);
    float sum = 0;
    float level = 0;
    for (std::int64_t j = row - kRiverReachCells; j <= row + kRiverReachCells; ++j) {
        for (std::int64_t i = cell - kRiverReachCells; i <= cell + kRiverReachCells; ++i) {
            const Reach& one = rivers.reach(i, j);
            const float x = static_cast<float>(place.x - one.x) + place.x_rest;
            const float z = static_cast<float>(place.z - one.z) + place.z_rest;
            if (x < one.x_min - reach || x > one.x_max + reach || z < one.z_min - reach ||
                z > one.z_max + reach) {
                continue;
            }
            const OnReach nearest = nearest_on(one, x, z);
            const float rest = 1.0F - nearest.square * inverse_reach_square;
            if (rest > 0) {
                const float inverse = rest / (nearest.square + e2);
                const float weight = inverse * inverse;
                sum += weight;
                level += weight * (one.level + one.level_change * nearest.along);
            }
        }
    }
    if (sum <= 0) {
        return {.river = constants.rivers.potential_at(place.x, place.z),
                .crest = crest_of(constants, 1.4F)};
    }
    const float distance = std::sqrt(std::max(0.0F, 1.0F / std::sqrt(sum) - e2));
    return {.river = level / sum,
            .crest = crest_of(constants, std::min(1.4F, distance / (0.5F * constants.valley)))};
}

float mountain_of(float noise) {
    return 0.1F + 0.9F * smooth_step(-0.2F, 0.3F, noise);
}

}  // namespace

/// The lattice lines that the columns of one axis need, and where each column finds its own.
struct ReliefBuilder::Axis {
    std::vector<std::int64_t> lines;   ///< lattice numbers, ascending
    std::vector<std::int32_t> first;   ///< per column: entry of its first point
    std::vector<std::uint8_t> eighth;  ///< per column: how far behind its second point
    std::size_t points = 4;            ///< of which a column's value is made

    Axis(std::int64_t start, std::int32_t count, std::int64_t step) {
        // Right on a line the fourth point weighs nothing.
        points = start % kLatticeStep == 0 && step % kLatticeStep == 0 ? 3 : 4;
        for (std::int32_t i = 0; i < count; ++i) {
            const std::int64_t at = start + i * step;
            const std::int64_t line = floor_div(at, kLatticeStep);
            eighth.push_back(static_cast<std::uint8_t>(at - line * kLatticeStep));
            const std::int64_t last = line + static_cast<std::int64_t>(points) - 2;
            const std::int64_t from =
                lines.empty() ? line - 1 : std::max(lines.back() + 1, line - 1);
            for (std::int64_t one = from; one <= last; ++one) {
                lines.push_back(one);
            }
            first.push_back(static_cast<std::int32_t>(static_cast<std::int64_t>(lines.size()) - 1 -
                                                      (lines.back() - (line - 1))));
        }
    }
};

ReliefConstants::ReliefConstants(const WorldDefinition& definition)
    : rivers(definition),
      height(static_cast<float>(definition.relief.height)),
      valley(static_cast<float>(rivers.cell_x)),
      plateau(static_cast<float>(definition.relief.plateau)),
      mountains(Noise::make(key(definition.seed, LandscapeTag::mountains),
                            definition.relief.province, 2)) {}

void ReliefBuilder::find_rivers(const RiverConstants& constants, const RectangleShape& shape) {
    const auto wander = static_cast<std::int64_t>(constants.wander) + 1;
    const std::int64_t margin = wander + 2 * kLatticeStep;
    const std::int64_t x1 = shape.x0 + (shape.width - 1) * shape.step;
    const std::int64_t z1 = shape.z0 + (shape.length - 1) * shape.step;
    const std::int64_t j0 = constants.row_of(shape.z0 - margin) - kRiverReachCells;
    const std::int64_t j1 = constants.row_of(z1 + margin) + kRiverReachCells;
    // Even rows begin earliest and odd ones latest.
    const std::int64_t i0 = constants.cell_of(shape.x0 - margin, 1) - kRiverReachCells;
    const std::int64_t i1 = constants.cell_of(x1 + margin, 0) + kRiverReachCells;
    rivers_.build(constants, {.first_i = i0, .last_i = i1, .first_j = j0, .last_j = j1});
}

void ReliefBuilder::fill_lattice(const ReliefConstants& constants, const Axis& x, const Axis& z) {
    lattice_.resize(x.lines.size() * z.lines.size() * kValues);
    float* value = lattice_.data();
    const RiverConstants& rivers = constants.rivers;
    for (const std::int64_t line_z : z.lines) {
        for (const std::int64_t line_x : x.lines) {
            const std::int64_t at_x = line_x * kLatticeStep;
            const std::int64_t at_z = line_z * kLatticeStep;
            const Valley valley =
                valley_at(constants, rivers_,
                          moved(at_x, at_z, rivers.wander * noise_at(rivers.wander_x, at_x, at_z),
                                rivers.wander * noise_at(rivers.wander_z, at_x, at_z)));
            const float mountain = mountain_of(noise_at(constants.mountains, at_x, at_z));
            value[0] = valley.river + constants.height * mountain * valley.crest;
            value[1] = valley.river;
            value[2] = valley.crest;
            value[3] = mountain;
            value += kValues;
        }
    }
}

void ReliefBuilder::build(ReliefRasters& out, const ReliefConstants& constants,
                          const RectangleShape& shape, const RowKernels& kernels,
                          NoiseBuffers& buffers) {
    const std::size_t size = shape.padded_size();
    for (std::vector<float>* raster : {&out.ground, &out.river, &out.crest, &out.mountain,
                                       &out.slope_x, &out.slope_z, &out.wander_x, &out.wander_z}) {
        raster->resize(size);
    }
    out.has_rivers = shape.step <= constants.rivers.cell_x;
    if (!out.has_rivers) {
        // Half way between a river and a crest, without their shapes.
        constexpr float kMeanCrest = 0.5F;
        noise_rectangle(out.mountain.data(), constants.mountains, shape, kernels, buffers);
        noise_rectangle(out.river.data(), constants.rivers.potential, shape, kernels, buffers);
        for (std::size_t i = 0; i < size; ++i) {
            out.mountain[i] = mountain_of(out.mountain[i]);
            out.river[i] = constants.rivers.ground + 1.6F * constants.rivers.fall * out.river[i];
            out.crest[i] = kMeanCrest;
            out.ground[i] = out.river[i] + constants.height * out.mountain[i] * kMeanCrest;
        }
        std::fill(out.slope_x.begin(), out.slope_x.end(), 0.0F);
        std::fill(out.slope_z.begin(), out.slope_z.end(), 0.0F);
        return;
    }
    find_rivers(constants.rivers, shape);
    const Axis x(shape.x0, shape.width, shape.step);
    const Axis z(shape.z0, shape.length, shape.step);
    fill_lattice(constants, x, z);
    std::array<Taps, kLatticeStep> taps;
    for (std::int64_t eighth = 0; eighth < kLatticeStep; ++eighth) {
        taps[static_cast<std::size_t>(eighth)] = taps_at(eighth);
    }
    // Rows of the lattice first, mixed along z: five values a lattice column, g's slope along z
    // too.
    const std::size_t lines = x.lines.size();
    std::vector<float> mixed(lines * (kValues + 1));
    for (std::int32_t row = 0; row < shape.length; ++row) {
        const Taps& along_z = taps[z.eighth[static_cast<std::size_t>(row)]];
        const auto line_z = static_cast<std::size_t>(z.first[static_cast<std::size_t>(row)]);
        for (std::size_t line = 0; line < lines; ++line) {
            std::array<float, kValues + 1> sum{};
            for (std::size_t p = 0; p < z.points; ++p) {
                const float* const value =
                    lattice_.data() + ((line_z + p) * lines + line) * kValues;
                for (std::size_t v = 0; v < kValues; ++v) {
                    sum[v] += along_z.weight[p] * value[v];
                }
                sum[kValues] += along_z.slope[p] * value[0];
            }
            std::copy(sum.begin(), sum.end(),
                      mixed.begin() + static_cast<std::ptrdiff_t>(line * (kValues + 1)));
        }
        for (std::int32_t column = 0; column < shape.width; ++column) {
            const Taps& along_x = taps[x.eighth[static_cast<std::size_t>(column)]];
            const float* value =
                mixed.data() +
                static_cast<std::size_t>(x.first[static_cast<std::size_t>(column)]) * (kValues + 1);
            std::array<float, kValues + 2> sum{};
            for (std::size_t p = 0; p < x.points; ++p, value += kValues + 1) {
                for (std::size_t v = 0; v <= kValues; ++v) {
                    sum[v] += along_x.weight[p] * value[v];
                }
                sum[kValues + 1] += along_x.slope[p] * value[0];
            }
            const auto i = static_cast<std::size_t>(row * shape.stride() + column);
            out.ground[i] = sum[0];
            out.river[i] = sum[1];
            out.crest[i] = sum[2];
            out.mountain[i] = sum[3];
            out.slope_z[i] = sum[4];
            out.slope_x[i] = sum[5];
        }
    }
    noise_rectangle(out.wander_x.data(), constants.rivers.wander_x, shape, kernels, buffers);
    noise_rectangle(out.wander_z.data(), constants.rivers.wander_z, shape, kernels, buffers);
    for (std::size_t i = 0; i < size; ++i) {
        out.wander_x[i] *= constants.rivers.wander;
        out.wander_z[i] *= constants.rivers.wander;
    }
}

}  // namespace terrane
