// Row kernels: one source, compiled once per instruction set (see CMakeLists.txt). Loops over
// blocks of kVectorPad columns with a fixed trip count, so that the compiler turns them into whole
// vectors of whatever width the set has. No function of another header may be inlined here: the
// linker could keep the copy made for a newer processor.
//
// Sources: Perlin 2002 (noise); Santamaría-Ibirika et al. 2013, eq. 4 (heights), eq. 6 (elements).
#include "generator/terrain/kernels/row_kernels.h"

namespace terrane::TERRANE_KERNEL_SET {
namespace {

constexpr std::int32_t kBlock = kVectorPad;

float fade(float t) {
    return t * t * t * (t * (t * 6.0F - 15.0F) + 10.0F);
}

/// One row of one octave: per lattice column the two lines A + B * f.
struct LatticeRow {
    float a[kRectangleSideMax + 2 * kBlock + 2];
    float b[kRectangleSideMax + 2 * kBlock + 2];
};

void fold_gradients(LatticeRow& lattice, const NoiseRows& octave, std::int32_t row) {
    const std::int32_t cells = octave.cell_count + 1;
    const float* near_x = octave.gradient_x + octave.row_cell[row] * cells;
    const float* near_z = octave.gradient_z + octave.row_cell[row] * cells;
    const float* far_x = near_x + cells;
    const float* far_z = near_z + cells;
    const float f = octave.fraction_z[row];
    const float w = fade(f);
    for (std::int32_t i = 0; i < cells; ++i) {
        lattice.b[i] = near_x[i] + w * (far_x[i] - near_x[i]);
        const float a = near_z[i] * f;
        lattice.a[i] = a + w * (far_z[i] * (f - 1.0F) - a);
    }
}

/// Cell by cell: within one, the lines are constants. A cell's last block runs over into the next
/// cell's columns, which overwrites them; that is why sums are not read from where they are
/// written.
void noise_row_by_cells(float* __restrict out, const float* __restrict sum, const NoiseRows& octave,
                        const LatticeRow& lattice) {
    for (std::int32_t cell = 0; cell < octave.cell_count; ++cell) {
        const float a0 = lattice.a[cell];
        const float b0 = lattice.b[cell];
        const float a1 = lattice.a[cell + 1];
        const float b1 = lattice.b[cell + 1];
        const std::int32_t end = octave.cell_begin[cell + 1];
        for (std::int32_t first = octave.cell_begin[cell]; first < end; first += kBlock) {
            const float* __restrict fraction = octave.fraction_x + first;
            const float* __restrict faded = octave.fade_x + first;
            const float* __restrict before = sum + first;
            float* __restrict after = out + first;
            for (std::int32_t i = 0; i < kBlock; ++i) {
                const float v0 = a0 + b0 * fraction[i];
                const float v1 = a1 + b1 * (fraction[i] - 1.0F);
                after[i] = before[i] + octave.amplitude * (v0 + faded[i] * (v1 - v0));
            }
        }
    }
}

/// Column by column, for cells narrower than a block.
void noise_row_by_columns(float* __restrict out, const float* __restrict sum, std::int32_t width,
                          const NoiseRows& octave, const LatticeRow& lattice) {
    for (std::int32_t i = 0; i < width; ++i) {
        const std::int32_t cell = octave.column_cell[i];
        const float v0 = lattice.a[cell] + lattice.b[cell] * octave.fraction_x[i];
        const float v1 = lattice.a[cell + 1] + lattice.b[cell + 1] * (octave.fraction_x[i] - 1.0F);
        out[i] = sum[i] + octave.amplitude * (v0 + octave.fade_x[i] * (v1 - v0));
    }
}

void noise(float* out, std::int32_t stride, std::int32_t width, std::int32_t length,
           const NoiseRows* octaves, std::int32_t octave_count) {
    LatticeRow lattice;
    float zeros[kRectangleSideMax + 2 * kBlock];
    float sums[2][kRectangleSideMax + 2 * kBlock];
    for (std::int32_t i = 0; i < kRectangleSideMax + 2 * kBlock; ++i) {
        zeros[i] = 0;
    }
    for (std::int32_t row = 0; row < length; ++row) {
        float* const result = out + row * stride;
        const float* sum = zeros;
        for (std::int32_t o = 0; o < octave_count; ++o) {
            float* const to = o == octave_count - 1 ? result : sums[o % 2];
            fold_gradients(lattice, octaves[o], row);
            if (octaves[o].wide_cells) {
                noise_row_by_cells(to, sum, octaves[o], lattice);
            } else {
                noise_row_by_columns(to, sum, width, octaves[o], lattice);
            }
            sum = to;
        }
        if (octave_count == 0) {
            for (std::int32_t i = 0; i < width; ++i) {
                result[i] = 0;
            }
        }
    }
}

void heights(float* __restrict height, float* __restrict stacked, const float* __restrict noise_of,
             std::int32_t count, HeightConstants constants) {
    for (std::int32_t first = 0; first < count; first += kBlock) {
        for (std::int32_t i = first; i < first + kBlock; ++i) {
            const float below = stacked[i];
            const float raised = ((below - constants.below) * constants.similarity +
                                  noise_of[i] * constants.roughness) +
                                 constants.top;
            const float top = raised > below ? raised : below;  // eq. 4; max: a layer may pinch out
            height[i] = top;
            stacked[i] = top;
        }
    }
}

/// sin of `turns` in [-1/2, 1/2], within 0.001: two parabolas.
float sine_of_turns(float turns) {
    const float size = turns < 0 ? -turns : turns;
    const float y = 8.0F * turns - 16.0F * turns * size;
    const float y_size = y < 0 ? -y : y;
    return 0.225F * (y * y_size - y) + y;
}

std::int32_t round_half_away(float value) {
    return static_cast<std::int32_t>(value + (value < 0 ? -0.5F : 0.5F));
}

void flow(std::int32_t* __restrict packed, const float* __restrict noise_of,
          const float* __restrict height, std::int32_t stride, std::int32_t count) {
    const float* const before = height - stride;
    const float* const after = height + stride;
    for (std::int32_t first = 0; first < count; first += kBlock) {
        for (std::int32_t i = first; i < first + kBlock; ++i) {
            float turns = noise_of[i] * 0.5F;
            turns = turns < -0.5F ? -0.5F : turns;
            turns = turns > 0.5F ? 0.5F : turns;
            float quarter = turns + 0.25F;
            quarter = quarter > 0.5F ? quarter - 1.0F : quarter;
            const float sine = sine_of_turns(turns);
            const float cosine = sine_of_turns(quarter);
            const float slope_x = 0.5F * (height[i + 1] - height[i - 1]);
            const float slope_z = 0.5F * (after[i] - before[i]);
            const float rise = cosine * slope_x + sine * slope_z;
            const float scale =
                127.0F / __builtin_sqrtf(cosine * cosine + sine * sine + rise * rise);
            packed[i] = (round_half_away(cosine * scale) & 255) |
                        (round_half_away(rise * scale) & 255) << 8 |
                        (round_half_away(sine * scale) & 255) << 16;
        }
    }
}

void quantise(std::int32_t* __restrict y256, const float* __restrict height, std::int32_t count) {
    for (std::int32_t first = 0; first < count; first += kBlock) {
        for (std::int32_t i = first; i < first + kBlock; ++i) {
            y256[i] = static_cast<std::int32_t>(height[i] * 256.0F + 0.5F);
        }
    }
}

void element_row(float* __restrict thickness, float x_first, float z, std::int32_t count,
                 const SegmentTable& segments, float inverse_half_side, float thick) {
    const float* __restrict ax = segments.ax;
    const float* __restrict az = segments.az;
    const float* __restrict ex = segments.ex;
    const float* __restrict ez = segments.ez;
    const float* __restrict il = segments.inverse_square;
    for (std::int32_t first = 0; first < count; first += kBlock) {
        float x[kBlock];
        float nearest[kBlock];
        for (std::int32_t i = 0; i < kBlock; ++i) {
            x[i] = x_first + static_cast<float>(first + i);
            nearest[i] = 3.0e38F;
        }
        for (std::int32_t s = 0; s < segments.count; ++s) {
            const float dz = z - az[s];
            const float along_z = dz * ez[s];
            const float sx = ax[s];
            const float sex = ex[s];
            const float sez = ez[s];
            const float sil = il[s];
            for (std::int32_t i = 0; i < kBlock; ++i) {
                const float dx = x[i] - sx;
                float t = (dx * sex + along_z) * sil;
                t = t < 0.0F ? 0.0F : t;
                t = t > 1.0F ? 1.0F : t;
                const float qx = dx - t * sex;
                const float qz = dz - t * sez;
                const float q = qx * qx + qz * qz;
                nearest[i] = q < nearest[i] ? q : nearest[i];
            }
        }
        for (std::int32_t i = 0; i < kBlock; ++i) {
            float d = __builtin_sqrtf(nearest[i]) * inverse_half_side;
            d = d > 1.0F ? 1.0F : d;
            const float k = d - 1.0F;
            thickness[first + i] = __builtin_sqrtf(1.0F - k * k) * thick;  // eq. 6
        }
    }
}

}  // namespace

extern const RowKernels kKernels;
const RowKernels kKernels = {.noise = noise,
                             .heights = heights,
                             .flow = flow,
                             .quantise = quantise,
                             .element_row = element_row};

}  // namespace terrane::TERRANE_KERNEL_SET
