#include "generator/landscape/erosion.h"

#include "generator/landscape/numbers.h"
#include "generator/terrain/random.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

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

/// The points of the 3 x 3 cells around each column's, for rows whose cell is `cell_z`.
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

void fill_points(float* points, std::size_t plane, const ErosionBuffers& buffers,
                 std::int64_t cell_z) {
    const std::vector<std::int64_t>& cells = buffers.cells;
    const std::size_t width = cells.size();
    std::size_t point = 0;
    for (std::int64_t dz = -1; dz <= 1; ++dz) {
        for (std::int64_t dx = -1; dx <= 1; ++dx, ++point) {
            float* const px = points + point * plane;
            float* const pz = px + kErosionPoints * plane;
            const auto hash_at = [&](std::size_t column) {
                return key(buffers.hashes[column][static_cast<std::size_t>(dx + 1)], cell_z + dz);
            };
            for (std::size_t column = 0; buffers.is_sparse && column < width; ++column) {
                const CellPoint found = point_of(hash_at(column), dx, dz);
                px[column] = found.x;
                pz[column] = found.z;
            }
            for (std::size_t column = 0; !buffers.is_sparse && column < width;) {
                const CellPoint found = point_of(hash_at(column), dx, dz);
                const std::int64_t cell = cells[column];
                for (; column < width && cells[column] == cell; ++column) {
                    px[column] = found.x;
                    pz[column] = found.z;
                }
            }
        }
    }
    for (std::size_t one = 0; one < 2 * kErosionPoints; ++one) {
        float* const row = points + one * plane;
        std::fill(row + width, row + plane, row[width - 1]);
    }
}

/// How near the points come to each block of columns; the padding repeats the last column.
void bound_points(std::vector<ErosionBound>& bounds, const float* points, const float* fraction_x,
                  std::size_t plane) {
    bounds.clear();
    for (std::size_t first = 0; first < plane; first += kVectorPad) {
        for (std::size_t point = 0; point < kErosionPoints; ++point) {
            const float* const px = points + point * plane + first;
            const float* const pz = px + kErosionPoints * plane;
            ErosionBound bound{.square_x = 1e9F, .z_min = pz[0], .z_max = pz[0]};
            for (std::size_t i = 0; i < kVectorPad; ++i) {
                const float x = fraction_x[first + i] - px[i];
                bound.square_x = std::min(bound.square_x, x * x);
                bound.z_min = std::min(bound.z_min, pz[i]);
                bound.z_max = std::max(bound.z_max, pz[i]);
            }
            bounds.push_back(bound);
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
                const RectangleShape& shape, const RowKernels& kernels, ErosionBuffers& buffers) {
    const auto plane = static_cast<std::size_t>(shape.stride());
    float* const fraction_x = buffers.points.data();
    float* const points = fraction_x + plane;
    buffers.cells.resize(static_cast<std::size_t>(shape.width));
    buffers.hashes.resize(static_cast<std::size_t>(shape.width));
    std::int32_t runs = 0;  // of columns in one cell
    for (std::int32_t i = 0; i < shape.width; ++i) {
        const CellPlace place = cell_place(shape.x0 + i * shape.step, octave.frequency);
        const auto column = static_cast<std::size_t>(i);
        buffers.cells[column] = place.cell;
        if (i > 0 && place.cell == buffers.cells[column - 1]) {
            buffers.hashes[column] = buffers.hashes[column - 1];
        } else {
            ++runs;
            buffers.hashes[column] = {key(octave.seed, place.cell - 1),
                                      key(octave.seed, place.cell),
                                      key(octave.seed, place.cell + 1)};
        }
        fraction_x[i] = place.fraction;
    }
    buffers.is_sparse = 2 * runs > shape.width;
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
        kernels.erode({.slope_x = slopes.x + first,
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
                       .count = shape.stride()});
    }
}

/// The shape's even columns, which it begins and ends with.
RectangleShape halved(const RectangleShape& shape) {
    return {.x0 = shape.x0,
            .z0 = shape.z0,
            .width = shape.width / 2 + 1,
            .length = shape.length / 2 + 1,
            .step = 2};
}

/// to[i] = from[2 i], rows and columns; `to` is of the halved shape.
void take_even(float* to, const RectangleShape& half, const float* from,
               const RectangleShape& shape) {
    for (std::int32_t z = 0; z < half.length; ++z) {
        const float* __restrict const row = from + std::ptrdiff_t{2} * z * shape.stride();
        float* __restrict const out = to + static_cast<std::ptrdiff_t>(z) * half.stride();
        for (std::int32_t x = 0; x < half.width; ++x) {
            out[x] = row[2 * x];
        }
        std::fill(out + half.width, out + half.stride(), out[half.width - 1]);
    }
}

/// The other way round: means in between.
void fill_between(float* to, const RectangleShape& shape, const float* from,
                  const RectangleShape& half) {
    std::array<float, kRectangleSideMax + kVectorPad> mean{};
    const auto spread = [width = half.width](float* __restrict out, const float* __restrict row) {
        for (std::int32_t x = 0; x < width; ++x) {
            out[2 * x] = row[x];
            out[2 * x + 1] = 0.5F * (row[x] + row[x + 1]);  // the last is padding
        }
    };
    for (std::int32_t z = 0; z < half.length; ++z) {
        const float* const row = from + static_cast<std::ptrdiff_t>(z) * half.stride();
        float* const out = to + std::ptrdiff_t{2} * z * shape.stride();
        spread(out, row);
        if (z + 1 < half.length) {
            for (std::int32_t x = 0; x <= half.width; ++x) {
                mean[static_cast<std::size_t>(x)] = 0.5F * (row[x] + row[x + half.stride()]);
            }
            spread(out + shape.stride(), mean.data());
        }
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
        if (period >= kHalvedPeriod) {
            halved_count = octave_count;
        }
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
    const bool is_halved = shape.step == 1 && constants.halved_count > 0;
    const RectangleShape half = halved(shape);
    const RectangleShape& first = is_halved ? half : shape;
    const std::size_t size = shape.padded_size();
    const std::size_t first_size = first.padded_size();
    const auto row_size = static_cast<std::size_t>(shape.stride());
    buffers.floats.resize(std::max(buffers.floats.size(), 2 * size + 6 * first_size));
    buffers.points.resize(std::max(buffers.points.size(), (2 * kErosionPoints + 1) * row_size));
    float* memory = buffers.floats.data();
    const auto take = [&memory](std::size_t count) {
        return std::exchange(memory, memory + count);
    };
    const Slopes whole{.x = relief.slope_x.data(),
                       .z = relief.slope_z.data(),
                       .mask = take(size),
                       .fade = take(size)};
    Slopes slopes = whole;
    float* coarse_sum = coarse;
    float* fine_sum = fine;
    float* crest = relief.crest.data();
    if (is_halved) {
        slopes = {.x = take(first_size),
                  .z = take(first_size),
                  .mask = take(first_size),
                  .fade = take(first_size)};
        coarse_sum = take(first_size);
        fine_sum = take(first_size);
        crest = slopes.fade;
        take_even(slopes.x, half, whole.x, shape);
        take_even(slopes.z, half, whole.z, shape);
        take_even(crest, half, relief.crest.data(), shape);
    }
    std::fill_n(coarse_sum, first_size, constants.coarse_amplitude);
    std::fill_n(fine_sum, first_size, 0.0F);
    for (std::size_t i = 0; i < first_size; ++i) {
        const float x = slopes.x[i];
        const float z = slopes.z[i];
        slopes.mask[i] = ease(1.1F * std::sqrt(x * x + z * z));
        slopes.fade[i] = std::min(1.0F, std::max(-1.0F, 2.0F * crest[i] - 1.0F));
    }
    const auto to_whole = [&](bool is_last) {
        fill_between(coarse, shape, coarse_sum, half);
        fill_between(fine, shape, fine_sum, half);
        if (!is_last) {
            fill_between(whole.x, shape, slopes.x, half);
            fill_between(whole.z, shape, slopes.z, half);
            fill_between(whole.mask, shape, slopes.mask, half);
            fill_between(whole.fade, shape, slopes.fade, half);
        }
        slopes = whole;
        coarse_sum = coarse;
        fine_sum = fine;
    };
    for (std::size_t o = 0; o < constants.octave_count; ++o) {
        const GullyOctave& octave = constants.octaves[o];
        if (is_halved && o == constants.halved_count) {
            to_whole(false);
        }
        float* const sum = o < ErosionConstants::kCoarseOctaves ? coarse_sum : fine_sum;
        if (shape.step > ErosionConstants::kExactSteps &&
            octave.period < 2 * static_cast<double>(shape.step)) {
            // Stripes that are too narrow to be seen: their mean.
            for (std::size_t i = 0; i < size; ++i) {
                sum[i] += octave.amplitude * slopes.fade[i] * (1.0F - slopes.mask[i]);
            }
            continue;
        }
        run_octave(sum, slopes, octave, is_halved && o < constants.halved_count ? half : shape,
                   kernels, buffers);
    }
    if (is_halved && constants.halved_count == constants.octave_count) {
        to_whole(true);
    }
}

}  // namespace terrane
