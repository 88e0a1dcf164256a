#include "generator/landscape/erosion.h"

#include "generator/landscape/numbers.h"
#include "generator/landscape/relief.h"
#include "generator/terrain/kernels/landscape_kernels.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/kernels/vector_pad.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/random.h"
#include "generator/world/world_definition.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {
namespace {

__extension__ using Wide = __int128;

/// A place in cells: which one, and where in it.
struct CellPlace {
    std::int64_t cell = 0;
    float fraction = 0;
};

CellPlace cell_place(std::int64_t coordinate, std::uint64_t frequency) {
    const Wide position = static_cast<Wide>(coordinate) * static_cast<Wide>(frequency);
    const auto low = static_cast<std::uint64_t>(position);
    return {.cell = static_cast<std::int64_t>(position >> 64),
            .fraction = static_cast<float>(static_cast<std::uint32_t>(low >> 40U)) * 0x1p-24F};
}

/// One random point of a cell, from its hash.
struct CellPoint {
    float x = 0;
    float z = 0;
};

CellPoint point_of(std::uint64_t hash, std::int64_t dx, std::int64_t dz) {
    const float x = static_cast<float>(hash >> 40U) * 0x1p-24F;
    const float z = static_cast<float>(hash >> 8U & 0xffffffU) * 0x1p-24F;
    return {.x = static_cast<float>(dx) + (0.25F + 0.5F * x),
            .z = static_cast<float>(dz) + (0.25F + 0.5F * z)};
}

/// The points of the 3 x 3 cells around each column's, for rows whose cell is `cell_z`.
void fill_points(float* points, std::size_t plane, const ErosionBuffers& buffers,
                 std::int64_t cell_z) {
    for (std::size_t r = 0; r < buffers.runs.size(); ++r) {
        const ErosionRun& run = buffers.runs[r];
        // The last one goes on to the end of the padding.
        const std::size_t end = r + 1 < buffers.runs.size() ? buffers.runs[r + 1].first : plane;
        float* px = points;
        for (std::int64_t dz = -1; dz <= 1; ++dz) {
            for (std::int64_t dx = -1; dx <= 1; ++dx, px += plane) {
                const CellPoint found = point_of(
                    key(run.hashes[static_cast<std::size_t>(dx + 1)], cell_z + dz), dx, dz);
                float* const pz = px + kErosionPoints * plane;
                for (std::size_t column = run.first; column < end; ++column) {
                    px[column] = found.x;
                    pz[column] = found.z;
                }
            }
        }
    }
}

static_assert(kVectorPad == 16);

/// Of a block, in halves: a chain of sixteen would wait for each.
template <typename Choose>
float least_of_block(const float* __restrict values, Choose choose) {
    std::array<float, 8> eight;
    std::array<float, 4> four;
    for (std::size_t i = 0; i < 8; ++i) {
        eight[i] = choose(values[i], values[i + 8]);
    }
    for (std::size_t i = 0; i < 4; ++i) {
        four[i] = choose(eight[i], eight[i + 4]);
    }
    return choose(choose(four[0], four[2]), choose(four[1], four[3]));
}

/// How near the points come to each block of columns; the padding repeats the last column.
void bound_points(std::vector<ErosionBound>& bounds, const float* points, const float* fraction_x,
                  std::size_t plane) {
    const auto lower = [](float a, float b) { return a < b ? a : b; };
    const auto higher = [](float a, float b) { return a < b ? b : a; };
    bounds.clear();
    for (std::size_t first = 0; first < plane; first += kVectorPad) {
        for (std::size_t point = 0; point < kErosionPoints; ++point) {
            const float* const px = points + point * plane + first;
            const float* const pz = px + kErosionPoints * plane;
            std::array<float, kVectorPad> square;
            for (std::size_t i = 0; i < kVectorPad; ++i) {
                const float x = fraction_x[first + i] - px[i];
                square[i] = x * x;
            }
            bounds.push_back({.square_x = least_of_block(square.data(), lower),
                              .z_min = least_of_block(pz, lower),
                              .z_max = least_of_block(pz, higher)});
        }
    }
}

/// What octaves hand on, a value a column.
struct Slopes {
    float* x = nullptr;
    float* z = nullptr;
    float* mask = nullptr;
    float* fade = nullptr;
};

void run_octave(float* sum, const Slopes& slopes, const GullyOctave& octave,
                const RectangleShape& shape, bool is_last, const RowKernels& kernels,
                ErosionBuffers& buffers) {
    const auto plane = static_cast<std::size_t>(shape.stride());
    float* const fraction_x = buffers.points.data();
    float* const points = fraction_x + plane;
    buffers.runs.clear();
    std::int64_t newest = 0;
    for (std::int32_t i = 0; i < shape.width; ++i) {
        const CellPlace place = cell_place(shape.x0 + i * shape.step, octave.frequency);
        if (i == 0 || place.cell != newest) {
            newest = place.cell;
            buffers.runs.push_back(
                {.first = static_cast<std::size_t>(i),
                 .hashes = {key(octave.seed, place.cell - 1), key(octave.seed, place.cell),
                            key(octave.seed, place.cell + 1)}});
        }
        fraction_x[i] = place.fraction;
    }
    std::fill(fraction_x + shape.width, fraction_x + plane, fraction_x[shape.width - 1]);
    std::int64_t filled = 0;
    for (std::int32_t z = 0; z < shape.length; ++z) {
        const CellPlace place = cell_place(shape.z0 + z * shape.step, octave.frequency);
        if (z == 0 || place.cell != filled) {
            fill_points(points, plane, buffers, place.cell);
            bound_points(buffers.bounds, points, fraction_x, plane);
            filled = place.cell;
        }
        const auto first = static_cast<std::ptrdiff_t>(z) * shape.stride();
        kernels.landscape->erode({.slope_x = slopes.x + first,
                                  .slope_z = slopes.z + first,
                                  .mask = slopes.mask + first,
                                  .fade = slopes.fade + first,
                                  .sum = sum + first,
                                  .fraction_x = fraction_x,
                                  .points = points,
                                  .plane = static_cast<std::int64_t>(plane),
                                  .bounds = buffers.bounds.data(),
                                  .fraction_z = place.fraction,
                                  .amplitude = octave.amplitude,
                                  .steepening = octave.steepening,
                                  .count = shape.stride(),
                                  .is_last = is_last});
    }
}

}  // namespace

ErosionConstants::ErosionConstants(const WorldDefinition& definition) {
    const ReliefParameters& relief = definition.relief;
    double amplitude = relief.gullies;
    double period = relief.gully_scale;
    for (std::int32_t o = 0; o < relief.gully_octaves && amplitude > 0 && period >= 2; ++o) {
        octaves[octave_count++] = {
            .seed = key(definition.seed, LandscapeTag::gully, o),
            .frequency = static_cast<std::uint64_t>(0x1p64 / period),
            .period = period,
            .amplitude = static_cast<float>(amplitude),
            .steepening = static_cast<float>(0.5 * amplitude * 6.28318530718 * 0.75 / period)};
        (octave_count <= kCoarseOctaves ? coarse_amplitude : fine_amplitude) +=
            static_cast<float>(amplitude);
        amplitude /= 2;
        period /= 2;
    }
}

void erode(float* coarse, float* fine, ReliefRasters& relief, const ErosionConstants& constants,
           const RectangleShape& shape, const RowKernels& kernels, ErosionBuffers& buffers) {
    if (!relief.is_smooth) {
        // Nothing says which way the slopes run: what the stripes tend to where there are none.
        for (std::size_t i = 0; i < shape.padded_size(); ++i) {
            const float fade = std::min(1.0F, std::max(-1.0F, 2.0F * relief.crest[i] - 1.0F));
            coarse[i] = constants.coarse_amplitude + constants.coarse_amplitude * fade;
            fine[i] = constants.fine_amplitude * fade;
        }
        return;
    }
    const std::size_t size = shape.padded_size();
    const auto row_size = static_cast<std::size_t>(shape.stride());
    buffers.floats.resize(std::max(buffers.floats.size(), 2 * size));
    buffers.points.resize(std::max(buffers.points.size(), (2 * kErosionPoints + 1) * row_size));
    const Slopes slopes{.x = relief.slope_x.data(),
                        .z = relief.slope_z.data(),
                        .mask = buffers.floats.data(),
                        .fade = buffers.floats.data() + size};
    std::fill_n(coarse, size, constants.coarse_amplitude);
    std::fill_n(fine, size, 0.0F);
    for (std::size_t i = 0; i < size; ++i) {
        const float x = slopes.x[i];
        const float z = slopes.z[i];
        slopes.mask[i] = ease(1.1F * std::sqrt(x * x + z * z));
        slopes.fade[i] = std::min(1.0F, std::max(-1.0F, 2.0F * relief.crest[i] - 1.0F));
    }
    for (std::size_t o = 0; o < constants.octave_count; ++o) {
        const GullyOctave& octave = constants.octaves[o];
        float* const sum = o < ErosionConstants::kCoarseOctaves ? coarse : fine;
        if (shape.step > ErosionConstants::kExactSteps &&
            octave.period < 2 * static_cast<double>(shape.step)) {
            // Stripes that are too narrow to be seen: their mean.
            for (std::size_t i = 0; i < size; ++i) {
                sum[i] += octave.amplitude * slopes.fade[i] * (1.0F - slopes.mask[i]);
            }
            continue;
        }
        run_octave(sum, slopes, octave, shape, o + 1 == constants.octave_count, kernels, buffers);
    }
}

}  // namespace terrane
