#include "generator/terrain/noise.h"

#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/kernels/vector_pad.h"
#include "generator/terrain/random.h"
#include "protocol/base/check.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
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
constexpr std::int32_t kWideCellColumns = 6;  ///< the same for columns that are listed

Gradient gradient_at(std::uint64_t row_hash, std::int64_t cell_z) {
    return kGradients[combine(row_hash, static_cast<std::uint64_t>(cell_z)) >> 60U];
}

float fade(float t) {
    return t * t * t * (t * (t * 6.0F - 15.0F) + 10.0F);
}

__extension__ using Wide = __int128;

struct LatticePosition {
    std::int64_t cell = 0;
    float fraction = 0;  ///< 24 bits, [0, 1)
};

/// 64.64 fixed point, in lattice cells.
Wide fixed_point(std::int64_t coordinate, std::uint64_t frequency, std::uint64_t offset) {
    return static_cast<Wide>(coordinate) * static_cast<Wide>(frequency) + static_cast<Wide>(offset);
}

LatticePosition split(Wide position) {
    const auto low = static_cast<std::uint64_t>(position);
    return {.cell = static_cast<std::int64_t>(position >> 64),
            .fraction = static_cast<float>(static_cast<std::uint32_t>(low >> 40U)) * 0x1p-24F};
}

LatticePosition lattice_position(std::int64_t coordinate, std::uint64_t frequency,
                                 std::uint64_t offset) {
    return split(fixed_point(coordinate, frequency, offset));
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

/// The positions of one axis: `count` from `first` on, evenly apart unless they are listed.
struct Axis {
    std::int64_t first = 0;
    std::int64_t step = 0;
    std::int32_t count = 0;
    const std::int64_t* listed = nullptr;  ///< null: first, first + step, ...
};

Axis axis_of(std::span<const std::int64_t> listed) {
    return {.first = listed.front(),
            .count = static_cast<std::int32_t>(listed.size()),
            .listed = listed.data()};
}

/// Values that a row's buffer has room for: kernels read and write beyond its end.
std::size_t room_of_row(std::int32_t width) {
    return static_cast<std::size_t>(padded_width(width)) + 2 * std::size_t{kVectorPad};
}

/// Hands out pieces of the buffers; they are sized before any piece is taken.
class Pieces {
  public:
    Pieces(NoiseBuffers& buffers, std::int32_t width, std::int32_t rows, std::int32_t octaves) {
        const std::size_t row = room_of_row(width);
        const auto length = static_cast<std::size_t>(rows);
        const auto lattice = lattice_row(width) * 2 * length;
        const auto count = static_cast<std::size_t>(octaves);
        const auto grow = [](auto& buffer, std::size_t size) {
            buffer.resize(std::max(buffer.size(), size));
        };
        grow(buffers.floats, count * (2 * row + length + 2 * lattice));
        grow(buffers.integers, count * (2 * row + 2 + length));
        grow(buffers.hashes, lattice_row(width));
        floats_ = buffers.floats.data();
        integers_ = buffers.integers.data();
        hashes_ = buffers.hashes.data();
    }

    /// At most two lattice columns a column, in whole blocks.
    static std::size_t lattice_row(std::int32_t width) {
        return static_cast<std::size_t>(padded_width(2 * width));
    }

    float* floats(std::size_t count) { return std::exchange(floats_, floats_ + count); }

    std::int32_t* integers(std::size_t count) {
        return std::exchange(integers_, integers_ + count);
    }

    /// One row of lattice columns; the same memory for every octave.
    std::uint64_t* hashes() { return hashes_; }

  private:
    float* floats_;
    std::int32_t* integers_;
    std::uint64_t* hashes_;
};

/// Walks positions along one axis and numbers the lattice lines next to them. Far apart positions
/// leave out the lines between; near ones share theirs.
class LatticeLines {
  public:
    LatticeLines(const Axis& axis, std::uint64_t frequency, std::uint64_t offset)
        : position_(fixed_point(axis.first, frequency, offset)),
          step_(fixed_point(axis.step, frequency, 0)),
          frequency_(frequency),
          listed_(axis.listed),
          left_(axis.count) {}

    struct Next {
        float fraction = 0;
        std::int32_t entry = 0;      ///< of the line below the position
        std::int32_t new_lines = 0;  ///< the last so many lines were not there before
        std::int64_t cell = 0;
    };

    Next next() {
        const LatticePosition position = split(position_);
        advance();
        Next next{.fraction = position.fraction, .cell = position.cell};
        if (count_ > 0 && position.cell == last_cell_) {
            next.new_lines = 0;
        } else if (count_ > 0 && position.cell == last_cell_ + 1) {
            next.new_lines = 1;
        } else {
            next.new_lines = 2;
        }
        count_ += next.new_lines;
        last_cell_ = position.cell;
        next.entry = count_ - 2;
        return next;
    }

    std::int32_t count() const { return count_; }

  private:
    void advance() {
        if (listed_ != nullptr && --left_ > 0) {
            step_ = fixed_point(listed_[1] - listed_[0], frequency_, 0);
            ++listed_;
        }
        position_ += step_;
    }

    Wide position_;
    Wide step_;
    std::uint64_t frequency_;
    const std::int64_t* listed_;
    std::int32_t left_;
    std::int64_t last_cell_ = 0;
    std::int32_t count_ = 0;
};

/// Fills the columns' part of `rows` and the hashes of the lattice columns.
void prepare_columns(NoiseRows& rows, Pieces& pieces, const NoiseOctave& octave, const Axis& axis) {
    const std::size_t row = room_of_row(axis.count);
    float* const fraction_x = pieces.floats(row);
    float* const fade_x = pieces.floats(row);
    std::int32_t* const column_cell = pieces.integers(row);
    std::int32_t* const cell_begin = pieces.integers(row + 2);
    LatticeLines lines(axis, octave.frequency, octave.offset_x);
    bool follow_each_other = true;
    for (std::int32_t i = 0; i < axis.count; ++i) {
        const LatticeLines::Next next = lines.next();
        fraction_x[i] = next.fraction;
        fade_x[i] = fade(next.fraction);
        column_cell[i] = next.entry;
        follow_each_other = follow_each_other && (i == 0 || next.new_lines < 2);
        if (next.new_lines > 0) {
            // Wide cells follow each other, so that entries count cells.
            cell_begin[std::min(next.entry, i)] = i;
            std::uint64_t* const hashes = pieces.hashes() + next.entry;
            for (std::int32_t line = 2 - next.new_lines; line < 2; ++line) {
                hashes[line] = combine(octave.seed, static_cast<std::uint64_t>(next.cell + line));
            }
        }
    }
    rows.lattice_columns = lines.count();
    rows.wide_cells =
        axis.listed == nullptr
            ? octave.period >= kWideCellPeriod * static_cast<float>(axis.step)
            : follow_each_other && axis.count >= kWideCellColumns * (lines.count() - 1);
    if (rows.wide_cells) {
        cell_begin[rows.lattice_columns - 1] = axis.count;
    }
    std::fill(fraction_x + axis.count, fraction_x + row, 0.0F);
    std::fill(fade_x + axis.count, fade_x + row, 0.0F);
    std::fill(column_cell + axis.count, column_cell + row, column_cell[axis.count - 1]);
    rows.fraction_x = fraction_x;
    rows.fade_x = fade_x;
    rows.column_cell = column_cell;
    rows.cell_begin = cell_begin;
}

NoiseRows prepare_octave(Pieces& pieces, const NoiseOctave& octave, const Axis& x, const Axis& z,
                         const RowKernels& kernels) {
    NoiseRows rows;
    rows.amplitude = octave.amplitude;
    prepare_columns(rows, pieces, octave, x);
    const auto length = static_cast<std::size_t>(z.count);
    float* const fraction_z = pieces.floats(length);
    std::int32_t* const row_cell = pieces.integers(length);
    const std::size_t lattice = Pieces::lattice_row(x.count) * 2 * length;
    float* const gradient_x = pieces.floats(lattice);
    float* const gradient_z = pieces.floats(lattice);
    LatticeLines lines(z, octave.frequency, octave.offset_z);
    for (std::size_t i = 0; i < length; ++i) {
        const LatticeLines::Next next = lines.next();
        fraction_z[i] = next.fraction;
        row_cell[i] = next.entry;
        for (std::int32_t line = 2 - next.new_lines; line < 2; ++line) {
            // Rows are packed; a row's last block runs into the next row, which follows.
            const std::int32_t at = (next.entry + line) * rows.lattice_columns;
            kernels.gradients(gradient_x + at, gradient_z + at, pieces.hashes(),
                              combine_value(static_cast<std::uint64_t>(next.cell + line)),
                              rows.lattice_columns);
        }
    }
    rows.fraction_z = fraction_z;
    rows.row_cell = row_cell;
    rows.gradient_x = gradient_x;
    rows.gradient_z = gradient_z;
    return rows;
}

void fill_noise(float* out, std::int32_t stride, const Noise& noise, const Axis& x, const Axis& z,
                const RowKernels& kernels, NoiseBuffers& buffers) {
    TERRANE_ASSERT(x.count >= 1 && x.count <= kRectangleSideMax && z.count >= 1 &&
                   z.count <= kRectangleSideMax);
    Pieces pieces(buffers, x.count, z.count, noise.octave_count);
    std::array<NoiseRows, kNoiseOctavesMax> rows;
    for (std::size_t o = 0; o < static_cast<std::size_t>(noise.octave_count); ++o) {
        rows[o] = prepare_octave(pieces, noise.octaves[o], x, z, kernels);
    }
    kernels.noise(out, stride, x.count, z.count, rows.data(), noise.octave_count);
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
    fill_noise(out, shape.stride(), noise,
               {.first = shape.x0, .step = shape.step, .count = shape.width},
               {.first = shape.z0, .step = shape.step, .count = shape.length}, kernels, buffers);
}

void noise_grid(float* out, const Noise& noise, std::span<const std::int64_t> xs,
                std::span<const std::int64_t> zs, const RowKernels& kernels,
                NoiseBuffers& buffers) {
    constexpr auto kMost = static_cast<std::size_t>(kRectangleSideMax);
    static_assert(kRectangleSideMax % kVectorPad == 0, "a piece's last block ends where it ends");
    const std::int32_t stride = padded_width(static_cast<std::int32_t>(xs.size()));
    for (std::size_t z = 0; z < zs.size(); z += kMost) {
        // From left to right: blocks run over into columns that come later.
        for (std::size_t x = 0; x < xs.size(); x += kMost) {
            fill_noise(out + z * static_cast<std::size_t>(stride) + x, stride, noise,
                       axis_of(xs.subspan(x, std::min(kMost, xs.size() - x))),
                       axis_of(zs.subspan(z, std::min(kMost, zs.size() - z))), kernels, buffers);
        }
    }
}

}  // namespace terrane
