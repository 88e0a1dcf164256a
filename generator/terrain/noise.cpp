#include "generator/terrain/noise.h"

#include "generator/terrain/random.h"
#include "protocol/base/check.h"

#include <algorithm>
#include <utility>

namespace terrane {
namespace {

struct Gradient {
    float x = 0;
    float z = 0;
};

/// Unit vectors at (i + 1/2) * 22.5 degrees from +x.
constexpr std::array<Gradient, 16> kGradients = {{
    {.98078528F, .19509032F},
    {.83146961F, .55557023F},
    {.55557023F, .83146961F},
    {.19509032F, .98078528F},
    {-.19509032F, .98078528F},
    {-.55557023F, .83146961F},
    {-.83146961F, .55557023F},
    {-.98078528F, .19509032F},
    {-.98078528F, -.19509032F},
    {-.83146961F, -.55557023F},
    {-.55557023F, -.83146961F},
    {-.19509032F, -.98078528F},
    {.19509032F, -.98078528F},
    {.55557023F, -.83146961F},
    {.83146961F, -.55557023F},
    {.98078528F, -.19509032F},
}};

/// Cells narrower than this go column by column: a cell-wise block would mostly be thrown away.
constexpr float kWideCellPeriod = 8;

Gradient gradient_at(std::uint64_t row_hash, std::int64_t cell_z) {
    return kGradients[combine(row_hash, static_cast<std::uint64_t>(cell_z)) >> 60U];
}

float fade(float t) {
    return t * t * t * (t * (t * 6.0F - 15.0F) + 10.0F);
}

struct LatticePosition {
    std::int64_t cell = 0;
    float fraction = 0;  ///< 24 bits, [0, 1)
};

LatticePosition lattice_position(std::int64_t coordinate, std::uint64_t frequency,
                                 std::uint64_t offset) {
    __extension__ using Wide = __int128;
    const Wide position =
        static_cast<Wide>(coordinate) * static_cast<Wide>(frequency) + static_cast<Wide>(offset);
    const auto low = static_cast<std::uint64_t>(position);
    return {.cell = static_cast<std::int64_t>(position >> 64),
            .fraction = static_cast<float>(static_cast<std::uint32_t>(low >> 40U)) * 0x1p-24F};
}

float octave_at(const NoiseOctave& octave, std::int64_t x, std::int64_t z) {
    const LatticePosition px = lattice_position(x, octave.frequency, octave.offset_x);
    const LatticePosition pz = lattice_position(z, octave.frequency, octave.offset_z);
    const std::uint64_t near_row = combine(octave.seed, static_cast<std::uint64_t>(px.cell));
    const std::uint64_t far_row = combine(octave.seed, static_cast<std::uint64_t>(px.cell + 1));
    const Gradient g00 = gradient_at(near_row, pz.cell);
    const Gradient g01 = gradient_at(near_row, pz.cell + 1);
    const Gradient g10 = gradient_at(far_row, pz.cell);
    const Gradient g11 = gradient_at(far_row, pz.cell + 1);
    const float u = fade(px.fraction);
    const float w = fade(pz.fraction);
    const auto line = [&](const Gradient& near, const Gradient& far, float fx) {
        const float b = near.x + w * (far.x - near.x);
        const float a = near.z * pz.fraction;
        return a + w * (far.z * (pz.fraction - 1.0F) - a) + b * fx;
    };
    const float v0 = line(g00, g01, px.fraction);
    const float v1 = line(g10, g11, px.fraction - 1.0F);
    return octave.amplitude * (v0 + u * (v1 - v0));
}

/// Hands out pieces of the buffers; they are sized before any piece is taken.
class Pieces {
  public:
    explicit Pieces(NoiseBuffers& buffers, const RectangleShape& shape, std::int32_t octaves) {
        const auto row = static_cast<std::size_t>(shape.stride() + 2 * kVectorPad);
        const auto length = static_cast<std::size_t>(shape.length);
        const auto lattice = (row + 2) * (length + 2);
        buffers.floats.resize(
            std::max(buffers.floats.size(),
                     static_cast<std::size_t>(octaves) * (2 * row + length + 2 * lattice)));
        buffers.integers.resize(std::max(
            buffers.integers.size(), static_cast<std::size_t>(octaves) * (2 * row + 2 + length)));
        floats_ = buffers.floats.data();
        integers_ = buffers.integers.data();
    }

    float* floats(std::size_t count) { return std::exchange(floats_, floats_ + count); }

    std::int32_t* integers(std::size_t count) {
        return std::exchange(integers_, integers_ + count);
    }

  private:
    float* floats_;
    std::int32_t* integers_;
};

NoiseRows prepare_octave(Pieces& pieces, const NoiseOctave& octave, const RectangleShape& shape) {
    const auto row = static_cast<std::size_t>(shape.stride() + 2 * kVectorPad);
    float* const fraction_x = pieces.floats(row);
    float* const fade_x = pieces.floats(row);
    std::int32_t* const column_cell = pieces.integers(row);
    std::int32_t* const cell_begin = pieces.integers(row + 2);
    NoiseRows rows;
    const std::int64_t first_cell =
        lattice_position(shape.x0, octave.frequency, octave.offset_x).cell;
    for (std::int32_t i = 0; i < shape.width; ++i) {
        const LatticePosition position =
            lattice_position(shape.x0 + i, octave.frequency, octave.offset_x);
        fraction_x[i] = position.fraction;
        fade_x[i] = fade(position.fraction);
        column_cell[i] = static_cast<std::int32_t>(position.cell - first_cell);
        while (rows.cell_count <= column_cell[i]) {
            cell_begin[rows.cell_count++] = i;
        }
    }
    cell_begin[rows.cell_count] = shape.width;
    std::fill(fraction_x + shape.width, fraction_x + row, 0.0F);
    std::fill(fade_x + shape.width, fade_x + row, 0.0F);
    std::fill(column_cell + shape.width, column_cell + row, 0);
    float* const fraction_z = pieces.floats(static_cast<std::size_t>(shape.length));
    std::int32_t* const row_cell = pieces.integers(static_cast<std::size_t>(shape.length));
    const std::int64_t first_row =
        lattice_position(shape.z0, octave.frequency, octave.offset_z).cell;
    for (std::int32_t i = 0; i < shape.length; ++i) {
        const LatticePosition position =
            lattice_position(shape.z0 + i, octave.frequency, octave.offset_z);
        fraction_z[i] = position.fraction;
        row_cell[i] = static_cast<std::int32_t>(position.cell - first_row);
    }
    const std::int32_t lattice_rows = row_cell[shape.length - 1] + 2;
    const std::int32_t lattice_columns = rows.cell_count + 1;
    float* const gradient_x =
        pieces.floats(static_cast<std::size_t>(lattice_rows * lattice_columns));
    float* const gradient_z =
        pieces.floats(static_cast<std::size_t>(lattice_rows * lattice_columns));
    for (std::int32_t c = 0; c < lattice_columns; ++c) {
        const std::uint64_t hash = combine(octave.seed, static_cast<std::uint64_t>(first_cell + c));
        for (std::int32_t r = 0; r < lattice_rows; ++r) {
            const Gradient gradient = gradient_at(hash, first_row + r);
            gradient_x[r * lattice_columns + c] = gradient.x;
            gradient_z[r * lattice_columns + c] = gradient.z;
        }
    }
    rows.fraction_x = fraction_x;
    rows.fade_x = fade_x;
    rows.column_cell = column_cell;
    rows.cell_begin = cell_begin;
    rows.fraction_z = fraction_z;
    rows.row_cell = row_cell;
    rows.gradient_x = gradient_x;
    rows.gradient_z = gradient_z;
    rows.amplitude = octave.amplitude;
    rows.wide_cells = octave.period >= kWideCellPeriod;
    return rows;
}

}  // namespace

Noise Noise::make(std::uint64_t noise_key, double period, std::int32_t octaves) {
    TERRANE_ASSERT(octaves >= 1 && octaves <= kNoiseOctavesMax && period >= 2);
    double sum = 0;
    double amplitude = 1;
    for (std::int32_t o = 0; o < octaves; ++o) {
        sum += amplitude;
        amplitude /= 2;
    }
    Noise noise;
    amplitude = 1;
    for (std::int32_t o = 0; o < octaves && period >= 2; ++o) {
        noise.octaves[static_cast<std::size_t>(noise.octave_count++)] = {
            .seed = key(noise_key, o, 0),
            .offset_x = key(noise_key, o, 1),
            .offset_z = key(noise_key, o, 2),
            .frequency = static_cast<std::uint64_t>(0x1p64 / period),
            .amplitude = static_cast<float>(amplitude / sum * 1.41421356237),
            .period = static_cast<float>(period)};
        amplitude /= 2;
        period /= 2;
    }
    return noise;
}

float noise_at(const Noise& noise, std::int64_t x, std::int64_t z) {
    float sum = 0;
    for (std::int32_t o = 0; o < noise.octave_count; ++o) {
        sum += octave_at(noise.octaves[static_cast<std::size_t>(o)], x, z);
    }
    return sum;
}

void noise_rectangle(float* out, const Noise& noise, const RectangleShape& shape,
                     const RowKernels& kernels, NoiseBuffers& buffers) {
    TERRANE_ASSERT(shape.width >= 1 && shape.width <= kRectangleSideMax && shape.length >= 1 &&
                   shape.length <= kRectangleSideMax);
    Pieces pieces(buffers, shape, noise.octave_count);
    std::array<NoiseRows, kNoiseOctavesMax> rows;
    for (std::size_t o = 0; o < static_cast<std::size_t>(noise.octave_count); ++o) {
        rows[o] = prepare_octave(pieces, noise.octaves[o], shape);
    }
    kernels.noise(out, shape.stride(), shape.width, shape.length, rows.data(), noise.octave_count);
}

}  // namespace terrane
