#include "generator/landscape/erosion.h"

#include "generator/landscape/numbers.h"
#include "generator/terrain/random.h"

#include <algorithm>
#include <cmath>

namespace terrane {
namespace {

__extension__ using Wide = __int128;

constexpr float kStripes = 0.75F;             ///< turns a cell
constexpr float kInverseReach = 1 / 1.5625F;  ///< of the kernel, 1 / cells^2

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

/// One row's values while an octave is computed; columns of the same cell go together.
struct Row {
    const float* fraction_x = nullptr;
    float fraction_z = 0;
    float* side_x = nullptr;
    float* side_z = nullptr;
    float* cosine = nullptr;
    float* sine = nullptr;
    float* weight = nullptr;
};

/// Adds the stripes around one cell's point, `px`, `pz` from the columns' own cell.
void add_point(const Row& row, std::int32_t first, std::int32_t end, float px, float pz) {
    const float vz = row.fraction_z - pz;
    for (std::int32_t i = first; i < end; ++i) {
        const float vx = row.fraction_x[i] - px;
        const float rest = std::max(0.0F, 1.0F - (vx * vx + vz * vz) * kInverseReach);
        const float k = rest * rest;
        const float phase = kStripes * (vx * row.side_x[i] + vz * row.side_z[i]);
        row.cosine[i] += k * cos_turn(phase);
        row.sine[i] += k * sin_turn(wrap_turn(phase));
        row.weight[i] += k;
    }
}

/// What an octave makes of a row's values.
struct RowState {
    float* slope_x = nullptr;
    float* slope_z = nullptr;
    float* mask = nullptr;
    float* fade = nullptr;
    float* sum = nullptr;
};

void find_sides(const Row& row, const RowState& state, std::int32_t width) {
    for (std::int32_t i = 0; i < width; ++i) {
        const float x = state.slope_x[i];
        const float z = state.slope_z[i];
        const float inverse = 1.0F / std::sqrt(x * x + z * z + 1e-12F);
        row.side_x[i] = -z * inverse;
        row.side_z[i] = x * inverse;
        row.cosine[i] = 0;
        row.sine[i] = 0;
        row.weight[i] = 0;
    }
}

void apply_octave(const Row& row, const RowState& state, const GullyOctave& octave,
                  std::int32_t width) {
    for (std::int32_t i = 0; i < width; ++i) {
        const float inverse = 1.0F / (row.weight[i] + 1e-9F);
        float c = row.cosine[i] * inverse;
        float s = row.sine[i] * inverse;
        const float strength = 1.0F / std::max(0.5F, std::sqrt(c * c + s * s));
        c *= strength;
        s *= strength;
        const float mask = state.mask[i];
        const float delta = state.fade[i] + mask * (c - state.fade[i]);
        state.sum[i] += octave.amplitude * delta;
        state.fade[i] = delta;
        const float rest = 1.0F - mask;
        state.mask[i] = (1.0F - rest * std::sqrt(rest)) * ease(1.4F * std::abs(s));
        const float turn = s < 0.0F ? octave.steepening : -octave.steepening;
        state.slope_x[i] += turn * row.side_x[i];
        state.slope_z[i] += turn * row.side_z[i];
    }
}

/// The random points of the cells around a row's, three lattice rows of them.
class CellPoints {
  public:
    CellPoints(std::vector<float>& memory, const GullyOctave& octave)
        : memory_(memory), octave_(octave) {}

    /// The points around cells first..last of a row.
    void set_row(std::int64_t cell_z, std::int64_t first, std::int64_t last) {
        if (count_ > 0 && cell_z == cell_z_ && first - 1 == first_cell_) {
            return;
        }
        cell_z_ = cell_z;
        first_cell_ = first - 1;
        count_ = static_cast<std::size_t>(last - first + 3);
        memory_.resize(std::max(memory_.size(), 6 * count_));
        for (std::int64_t dz = -1; dz <= 1; ++dz) {
            for (std::size_t n = 0; n < count_; ++n) {
                const std::uint64_t hash =
                    key(octave_.seed, first_cell_ + static_cast<std::int64_t>(n), cell_z + dz);
                const std::size_t at = (static_cast<std::size_t>(dz + 1) * count_ + n) * 2;
                memory_[at] = 0.25F + 0.5F * static_cast<float>(hash >> 40U) * 0x1p-24F;
                memory_[at + 1] =
                    0.25F + 0.5F * static_cast<float>(hash >> 8U & 0xffffffU) * 0x1p-24F;
            }
        }
    }

    float x(std::int64_t cell, int dz) const { return memory_[index(cell, dz)]; }

    float z(std::int64_t cell, int dz) const { return memory_[index(cell, dz) + 1]; }

  private:
    std::size_t index(std::int64_t cell, int dz) const {
        return (static_cast<std::size_t>(dz + 1) * count_ +
                static_cast<std::size_t>(cell - first_cell_)) *
               2;
    }

    std::vector<float>& memory_;
    const GullyOctave& octave_;
    std::int64_t first_cell_ = 0;
    std::size_t count_ = 0;
    std::int64_t cell_z_ = 0;
};

void run_octave(float* sum, float* mask, float* fade, ReliefRasters& relief,
                const GullyOctave& octave, const RectangleShape& shape, ErosionBuffers& buffers) {
    const std::int32_t stride = shape.stride();
    const auto row_size = static_cast<std::size_t>(stride);
    float* const memory = buffers.floats.data();
    std::vector<std::int64_t> cells(static_cast<std::size_t>(shape.width));
    for (std::int32_t i = 0; i < shape.width; ++i) {
        const CellPlace place = cell_place(shape.x0 + i * shape.step, octave.frequency);
        cells[static_cast<std::size_t>(i)] = place.cell;
        memory[i] = place.fraction;
    }
    // Wide apart, cells between columns are left out: each run's points are drawn for itself.
    const bool is_dense = cells.back() - cells.front() < 4 * std::int64_t{kRectangleSideMax};
    CellPoints points(buffers.points, octave);
    for (std::int32_t z = 0; z < shape.length; ++z) {
        const CellPlace place = cell_place(shape.z0 + z * shape.step, octave.frequency);
        const auto first = static_cast<std::ptrdiff_t>(z) * stride;
        const Row row{.fraction_x = memory,
                      .fraction_z = place.fraction,
                      .side_x = memory + row_size,
                      .side_z = memory + 2 * row_size,
                      .cosine = memory + 3 * row_size,
                      .sine = memory + 4 * row_size,
                      .weight = memory + 5 * row_size};
        const RowState state{.slope_x = relief.slope_x.data() + first,
                             .slope_z = relief.slope_z.data() + first,
                             .mask = mask + first,
                             .fade = fade + first,
                             .sum = sum + first};
        find_sides(row, state, shape.width);
        std::int32_t begin = 0;
        if (is_dense) {
            points.set_row(place.cell, cells.front(), cells.back());
        }
        while (begin < shape.width) {
            const std::int64_t cell = cells[static_cast<std::size_t>(begin)];
            std::int32_t end = begin + 1;
            while (end < shape.width && cells[static_cast<std::size_t>(end)] == cell) {
                ++end;
            }
            if (!is_dense) {
                points.set_row(place.cell, cell, cell);
            }
            for (int dz = -1; dz <= 1; ++dz) {
                for (int dx = -1; dx <= 1; ++dx) {
                    add_point(row, begin, end, static_cast<float>(dx) + points.x(cell + dx, dz),
                              static_cast<float>(dz) + points.z(cell + dx, dz));
                }
            }
            begin = end;
        }
        apply_octave(row, state, octave, shape.width);
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
            .amplitude = static_cast<float>(amplitude),
            .steepening = static_cast<float>(0.5 * amplitude * 6.28318530718 * 0.75 / period)};
        if (octave_count <= kCoarseOctaves) {
            coarse_amplitude += static_cast<float>(amplitude);
        }
        amplitude /= 2;
        period /= 2;
    }
}

void erode(float* coarse, float* fine, ReliefRasters& relief, const ErosionConstants& constants,
           const RectangleShape& shape, ErosionBuffers& buffers) {
    const std::size_t size = shape.padded_size();
    std::fill_n(coarse, size, constants.coarse_amplitude);
    std::fill_n(fine, size, 0.0F);
    const auto row_size = static_cast<std::size_t>(shape.stride());
    buffers.floats.resize(std::max(buffers.floats.size(), 6 * row_size + 2 * size));
    float* const mask = buffers.floats.data() + 6 * row_size;
    float* const fade = mask + size;
    for (std::size_t i = 0; i < size; ++i) {
        const float x = relief.slope_x[i];
        const float z = relief.slope_z[i];
        mask[i] = ease(1.1F * std::sqrt(x * x + z * z));
        fade[i] = std::min(1.0F, std::max(-1.0F, 2.0F * relief.crest[i] - 1.0F));
    }
    for (std::size_t o = 0; o < constants.octave_count; ++o) {
        run_octave(o < ErosionConstants::kCoarseOctaves ? coarse : fine, mask, fade, relief,
                   constants.octaves[o], shape, buffers);
    }
}

}  // namespace terrane
