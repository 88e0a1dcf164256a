// Row kernels: one source, compiled once per instruction set (see CMakeLists.txt). Loops over
// blocks of kVectorPad columns with a fixed trip count, so that the compiler turns them into whole
// vectors of whatever width the set has. No function of another header may be inlined here: the
// linker could keep the copy made for a newer processor.
//
// Sources: Perlin 2002 (noise); Santamaría-Ibirika et al. 2013, eq. 4 (heights), eq. 6 (elements).
#include "generator/terrain/kernels/row_kernels.h"

#ifdef __AVX2__
#include <immintrin.h>  // its functions are always inlined: the rule above holds
#endif

namespace terrane::TERRANE_KERNEL_SET {
namespace {

constexpr std::int32_t kBlock = kVectorPad;

float fade(float t) {
    return t * t * t * (t * (t * 6.0F - 15.0F) + 10.0F);
}

/// cos of (k + 1/2) * 22.5 degrees, of which all sixteen gradients are made.
constexpr float kCosine0 = .98078528F;
constexpr float kCosine1 = .83146961F;
constexpr float kCosine2 = .55557023F;
constexpr float kCosine3 = .19509032F;

/// mix() of random.h.
std::uint64_t mixed(std::uint64_t hash) {
    hash ^= hash >> 30U;
    hash *= 0xbf58476d1ce4e5b9U;
    hash ^= hash >> 27U;
    hash *= 0x94d049bb133111ebU;
    return hash ^ (hash >> 31U);
}

/// Unit vectors at (n + 1/2) * 22.5 degrees from +x, n a hash's four highest bits. Folded into a
/// quarter of the circle and chosen by comparisons: looking them up would be one lane at a time.
/// Loops over whole rows: within blocks, compilers unroll the hashes into scalars.
void gradients(float* __restrict x, float* __restrict z,
               const std::uint64_t* __restrict column_hash, std::uint64_t row_value,
               std::int32_t count) {
    std::int32_t number[2 * kRectangleSideMax + 2 * kBlock];
    const std::int32_t padded = (count + kBlock - 1) / kBlock * kBlock;
    for (std::int32_t i = 0; i < padded; ++i) {
        number[i] = static_cast<std::int32_t>(mixed(column_hash[i] ^ row_value) >> 60U);
    }
    for (std::int32_t i = 0; i < padded; ++i) {
        const std::int32_t n = number[i];
        // The quadrants run back and forth between the axes.
        const std::int32_t k = ((n & 4) != 0 ? ~n : n) & 3;
        const float near_x = (k & 1) != 0 ? kCosine1 : kCosine0;
        const float far_x = (k & 1) != 0 ? kCosine3 : kCosine2;
        const float near_z = (k & 1) != 0 ? kCosine2 : kCosine3;
        const float far_z = (k & 1) != 0 ? kCosine0 : kCosine1;
        const float size_x = (k & 2) != 0 ? far_x : near_x;
        const float size_z = (k & 2) != 0 ? far_z : near_z;
        x[i] = ((n + 4) & 8) != 0 ? -size_x : size_x;
        z[i] = (n & 8) != 0 ? -size_z : size_z;
    }
}

/// One row of one octave: per lattice column the two lines A + B * f; and what a Picker may read
/// behind them.
struct LatticeRow {
    float a[2 * kRectangleSideMax + 2 + 2 * kBlock];
    float b[2 * kRectangleSideMax + 2 + 2 * kBlock];
};

void fold_gradients(LatticeRow& lattice, const NoiseRows& octave, std::int32_t row) {
    const std::int32_t cells = octave.lattice_columns;
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
    for (std::int32_t cell = 0; cell + 1 < octave.lattice_columns; ++cell) {
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

#if defined(__AVX512F__)
constexpr std::int32_t kRun = 16;
#elif defined(__AVX2__)
constexpr std::int32_t kRun = 8;
#else
constexpr std::int32_t kRun = 4;
#endif

/// A run of columns' values.
using Run = float __attribute__((vector_size(4 * kRun)));

Run load_run(const float* from) {
    Run run;
    __builtin_memcpy(&run, from, sizeof run);
    return run;
}

/// Takes for a run of columns the entries of a table that column_cell names: these rise by at most
/// two a column, so a run's lie within two vectors, where permutations cost a fraction of what
/// gathers do.
class Picker {
  public:
#if defined(__AVX512F__)
    explicit Picker(const std::int32_t* cells)
        : at_(_mm512_sub_epi32(_mm512_loadu_si512(cells), _mm512_set1_epi32(cells[0]))) {}

    Run pick(const float* table) const {
        return _mm512_permutex2var_ps(_mm512_loadu_ps(table), at_, _mm512_loadu_ps(table + kRun));
    }

  private:
    __m512i at_;
#elif defined(__AVX2__)
    explicit Picker(const std::int32_t* cells)
        : at_(_mm256_sub_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(cells)),
                               _mm256_set1_epi32(cells[0]))),
          is_high_(_mm256_castsi256_ps(_mm256_cmpgt_epi32(at_, _mm256_set1_epi32(kRun - 1)))) {}

    Run pick(const float* table) const {
        const __m256 low = _mm256_permutevar8x32_ps(_mm256_loadu_ps(table), at_);
        const __m256 high = _mm256_permutevar8x32_ps(_mm256_loadu_ps(table + kRun), at_);
        return _mm256_blendv_ps(low, high, is_high_);
    }

  private:
    __m256i at_;
    __m256 is_high_;
#else
    explicit Picker(const std::int32_t* cells) : cells_(cells) {}

    Run pick(const float* table) const {
        const auto at = [this, table](std::int32_t i) { return table[cells_[i] - cells_[0]]; };
        return Run{at(0), at(1), at(2), at(3)};
    }

  private:
    const std::int32_t* cells_;
#endif
};

/// Run by run, for cells too narrow to go cell by cell. Whole runs; the cells of columns past the
/// row are its last column's.
void noise_row_by_columns(float* __restrict out, const float* __restrict sum, std::int32_t width,
                          const NoiseRows& octave, const LatticeRow& lattice) {
    for (std::int32_t first = 0; first < width; first += kRun) {
        const Picker picker(octave.column_cell + first);
        const float* const a = lattice.a + octave.column_cell[first];
        const float* const b = lattice.b + octave.column_cell[first];
        const Run fraction = load_run(octave.fraction_x + first);
        const Run v0 = picker.pick(a) + picker.pick(b) * fraction;
        const Run v1 = picker.pick(a + 1) + picker.pick(b + 1) * (fraction - 1.0F);
        const Run faded = load_run(octave.fade_x + first);
        const Run value = load_run(sum + first) + octave.amplitude * (v0 + faded * (v1 - v0));
        __builtin_memcpy(out + first, &value, sizeof value);
    }
}

void noise(float* out, std::int32_t stride, std::int32_t width, std::int32_t length,
           const NoiseRows* octaves, std::int32_t octave_count) {
    LatticeRow lattice;
    for (std::int32_t i = 0; i < 2 * kRectangleSideMax + 2 + 2 * kBlock; ++i) {
        lattice.a[i] = 0;
        lattice.b[i] = 0;
    }
    float zeros[kRectangleSideMax + 2 * kBlock];
    float sums[2][kRectangleSideMax + 2 * kBlock];
    // Cleared, since blocks run over into columns that no octave has: those stay harmless numbers.
    for (std::int32_t i = 0; i < kRectangleSideMax + 2 * kBlock; ++i) {
        zeros[i] = 0;
        sums[0][i] = 0;
        sums[1][i] = 0;
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
          const float* __restrict height, std::int32_t stride, std::int32_t count,
          float half_per_step) {
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
            const float slope_x = half_per_step * (height[i + 1] - height[i - 1]);
            const float slope_z = half_per_step * (after[i] - before[i]);
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

void blends(std::int32_t* __restrict middle, std::uint8_t* __restrict irregular,
            const std::int32_t* __restrict bottom, const std::int32_t* __restrict top,
            std::int32_t blend, std::int32_t count) {
    const std::int32_t least = blend > 0 ? 1 : 0;
    for (std::int32_t first = 0; first < count; first += kBlock) {
        for (std::int32_t i = first; i < first + kBlock; ++i) {
            const std::int32_t thickness = top[i] - bottom[i];
            std::int32_t part = (thickness * blend + 128) >> 8;
            part = part < least ? least : part;
            middle[i] = bottom[i] + part;
            irregular[i] = static_cast<std::uint8_t>(irregular[i] | (part >= thickness ? 1 : 0));
        }
    }
}

/// A limit's bytes; `tail` is palette id | flow << 16.
void store(char* to, std::int32_t y256, std::uint64_t tail) {
    __builtin_memcpy(to, &y256, sizeof y256);
    __builtin_memcpy(to + sizeof y256, &tail, sizeof tail);
}

void plain_columns(void* limits, const PlainRow& row, std::int32_t first, std::int32_t count) {
    constexpr std::int32_t kLimitBytes = 12;
    char* to = static_cast<char*>(limits);
    const auto void_tail = static_cast<std::uint64_t>(row.layers);
    const std::int32_t* const no_flow = nullptr;
    for (std::int32_t i = first; i < first + count; ++i) {
        const std::int32_t* y = row.y256 + i;
        const std::int32_t* middle = row.middle + i;
        const std::int32_t* packed = row.flow != no_flow ? row.flow + i : no_flow;
        for (std::int32_t k = 0; k < row.layers; ++k) {
            const std::uint64_t flow_bits =
                packed != no_flow ? static_cast<std::uint64_t>(static_cast<std::uint32_t>(*packed))
                                  : 0;
            const std::uint64_t tail = static_cast<std::uint64_t>(k) | flow_bits << 16U;
            store(to, *middle, tail);
            store(to + kLimitBytes, *y, tail);
            to += 2 * kLimitBytes;
            y += row.plane;
            middle += row.plane;
            packed = packed != no_flow ? packed + row.flow_plane : no_flow;
        }
        store(to, *(y - row.plane), void_tail);
        to += kLimitBytes;
    }
}

float clamp01(float t) {
    t = t < 0.0F ? 0.0F : t;
    return t > 1.0F ? 1.0F : t;
}

/// Squared distance from (x, z) to a segment.
float square_to_segment(float x, float z, float ax, float az, float ex, float ez, float inverse) {
    const float dx = x - ax;
    const float dz = z - az;
    const float t = clamp01((dx * ex + dz * ez) * inverse);
    const float qx = dx - t * ex;
    const float qz = dz - t * ez;
    return qx * qx + qz * qz;
}

/// How near each run of segments comes to a point, squared; the nearest of all is returned.
float nearest_of_groups(float* __restrict nearest, float x, float z, const SegmentTable& segments) {
    for (std::int32_t g = 0; g < kSegmentGroups; ++g) {
        nearest[g] = 3.0e38F;
    }
    for (std::int32_t j = 0; j < kSegments; j += kSegmentGroups) {
        for (std::int32_t g = 0; g < kSegmentGroups; ++g) {
            const float q =
                square_to_segment(x, z, segments.ax[j + g], segments.az[j + g], segments.ex[j + g],
                                  segments.ez[j + g], segments.inverse_square[j + g]);
            nearest[g] = q < nearest[g] ? q : nearest[g];
        }
    }
    float least = nearest[0];
    for (std::int32_t g = 1; g < kSegmentGroups; ++g) {
        least = nearest[g] < least ? nearest[g] : least;
    }
    return least;
}

void element_tile(float* __restrict thickness, float x, float z, float step,
                  const SegmentTable& segments, float inverse_half_side, float thick) {
    // The nearest segment of any column of the tile is at most the tile's diagonal farther from the
    // tile's middle than the middle's own nearest one; the slack is far above rounding errors.
    constexpr float kHalf = 0.5F * (kTileSide - 1);
    constexpr float kDiagonal = 4.2427F;
    float group_nearest[kSegmentGroups];
    const float middle =
        nearest_of_groups(group_nearest, x + kHalf * step, z + kHalf * step, segments);
    const float reach = (__builtin_sqrtf(middle) + kDiagonal * step) * 1.001F + 0.01F;
    const float reach_square = reach * reach;
    constexpr std::int32_t kTile = kTileSide * kTileSide;
    float column_x[kTile];
    float column_z[kTile];
    float nearest[kTile];
    for (std::int32_t i = 0; i < kTile; ++i) {
        column_x[i] = x + static_cast<float>(i % kTileSide) * step;
        column_z[i] = z + static_cast<float>(i / kTileSide) * step;
        nearest[i] = 3.0e38F;
    }
    for (std::int32_t g = 0; g < kSegmentGroups; ++g) {
        if (group_nearest[g] > reach_square) {
            continue;
        }
        for (std::int32_t j = g; j < kSegments; j += kSegmentGroups) {
            const float ax = segments.ax[j];
            const float az = segments.az[j];
            const float ex = segments.ex[j];
            const float ez = segments.ez[j];
            const float inverse = segments.inverse_square[j];
            for (std::int32_t i = 0; i < kTile; ++i) {
                const float q =
                    square_to_segment(column_x[i], column_z[i], ax, az, ex, ez, inverse);
                nearest[i] = q < nearest[i] ? q : nearest[i];
            }
        }
    }
    for (std::int32_t i = 0; i < kTile; ++i) {
        float d = __builtin_sqrtf(nearest[i]) * inverse_half_side;
        d = d > 1.0F ? 1.0F : d;
        const float k = d - 1.0F;
        thickness[i] = __builtin_sqrtf(1.0F - k * k) * thick;  // eq. 6
    }
}

}  // namespace

extern const RowKernels kKernels;
const RowKernels kKernels = {.gradients = gradients,
                             .noise = noise,
                             .heights = heights,
                             .flow = flow,
                             .quantise = quantise,
                             .blends = blends,
                             .plain_columns = plain_columns,
                             .element_tile = element_tile,
                             .landscape = &kLandscapeKernels,
                             .mesh = &kMeshKernels};

}  // namespace terrane::TERRANE_KERNEL_SET
