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

/// Unit vectors at (i + 1/2) * 22.5 degrees from +x.
alignas(64) constexpr float kGradientX[16] = {.98078528F,  .83146961F,  .55557023F,  .19509032F,
                                              -.19509032F, -.55557023F, -.83146961F, -.98078528F,
                                              -.98078528F, -.83146961F, -.55557023F, -.19509032F,
                                              .19509032F,  .55557023F,  .83146961F,  .98078528F};
alignas(64) constexpr float kGradientZ[16] = {.19509032F,  .55557023F,  .83146961F,  .98078528F,
                                              .98078528F,  .83146961F,  .55557023F,  .19509032F,
                                              -.19509032F, -.55557023F, -.83146961F, -.98078528F,
                                              -.98078528F, -.83146961F, -.55557023F, -.19509032F};

void gradients(float* __restrict x, float* __restrict z,
               const std::uint64_t* __restrict column_hash, std::uint64_t row_value,
               std::int32_t count) {
    for (std::int32_t first = 0; first < count; first += kBlock) {
        std::int32_t number[kBlock];
        for (std::int32_t i = 0; i < kBlock; ++i) {
            std::uint64_t hash = column_hash[first + i] ^ row_value;  // mix of random.h
            hash ^= hash >> 30U;
            hash *= 0xbf58476d1ce4e5b9U;
            hash ^= hash >> 27U;
            hash *= 0x94d049bb133111ebU;
            number[i] = static_cast<std::int32_t>((hash ^ (hash >> 31U)) >> 60U);
        }
        for (std::int32_t i = 0; i < kBlock; ++i) {
            x[first + i] = kGradientX[number[i]];
            z[first + i] = kGradientZ[number[i]];
        }
    }
}

/// One row of one octave: per lattice column the two lines A + B * f.
struct LatticeRow {
    float a[2 * kRectangleSideMax + 2];
    float b[2 * kRectangleSideMax + 2];
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

float absolute(float x) {
    return __builtin_fabsf(x);
}

/// Sine of -0.5..0.5 turns.
float sine(float t) {
    const float y = 8.0F * t - 16.0F * t * absolute(t);
    return 0.225F * (y * absolute(y) - y) + y;
}

/// Squared distance in cells beyond which a point counts for nothing; with slack for rounding.
constexpr float kStripeReach = 1.563F;

/// The stripes around a block's random points: three sums over them.
struct Stripes {
    float cosine[kBlock];
    float sine[kBlock];
    float weight[kBlock];
};

void add_stripes(Stripes& stripes, const ErosionRow& row, std::int32_t first, std::int32_t point,
                 const float* __restrict side_x, const float* __restrict side_z) {
    const float* __restrict const px = row.points + point * row.plane + first;
    const float* __restrict const pz = px + kErosionPoints * row.plane;
    const float* __restrict const fx = row.fraction_x + first;
    for (std::int32_t i = 0; i < kBlock; ++i) {
        const float vx = fx[i] - px[i];
        const float vz = row.fraction_z - pz[i];
        const float rest = 1.0F - (vx * vx + vz * vz) * (1.0F / 1.5625F);
        const float k = rest > 0.0F ? rest * rest : 0.0F;
        const float phase = 0.75F * (vx * side_x[i] + vz * side_z[i]);
        // Below one turn where k is not 0: a shift by half a turn at most each way.
        const float turn = phase + ((phase > 0.5F ? -1.0F : 0.0F) + (phase < -0.5F ? 1.0F : 0.0F));
        stripes.cosine[i] += k * sine(0.25F - absolute(turn));
        stripes.sine[i] += k * sine(turn);
        stripes.weight[i] += k;
    }
}

void erode(const ErosionRow& row) {
    for (std::int32_t first = 0; first < row.count; first += kBlock) {
        float side_x[kBlock];
        float side_z[kBlock];
        float* __restrict const slope_x = row.slope_x + first;
        float* __restrict const slope_z = row.slope_z + first;
        for (std::int32_t i = 0; i < kBlock; ++i) {
            const float x = slope_x[i];
            const float z = slope_z[i];
            const float inverse = 1.0F / __builtin_sqrtf(x * x + z * z + 1e-12F);
            side_x[i] = -z * inverse;
            side_z[i] = x * inverse;
        }
        Stripes stripes = {};
        const ErosionBound* const bounds = row.bounds + first / kBlock * kErosionPoints;
        for (std::int32_t point = 0; point < kErosionPoints; ++point) {
            const ErosionBound bound = bounds[point];
            const float below = bound.z_min - row.fraction_z;
            const float above = row.fraction_z - bound.z_max;
            const float dz = below > 0.0F ? below : above > 0.0F ? above : 0.0F;
            if (bound.square_x + dz * dz < kStripeReach) {
                add_stripes(stripes, row, first, point, side_x, side_z);
            }  // else it would add zeros
        }
        float* __restrict const mask = row.mask + first;
        float* __restrict const fade_of = row.fade + first;
        float* __restrict const sum = row.sum + first;
        const float amplitude = row.amplitude;
        const float steepening = row.steepening;
        float turned[kBlock];
        for (std::int32_t i = 0; i < kBlock; ++i) {
            const float inverse = 1.0F / (stripes.weight[i] + 1e-9F);
            const float c0 = stripes.cosine[i] * inverse;
            const float s0 = stripes.sine[i] * inverse;
            const float length = __builtin_sqrtf(c0 * c0 + s0 * s0);
            const float strength = 1.0F / (length > 0.5F ? length : 0.5F);
            const float c = c0 * strength;
            turned[i] = s0 * strength;
            const float delta = fade_of[i] + mask[i] * (c - fade_of[i]);
            sum[i] += amplitude * delta;
            fade_of[i] = delta;
        }
        if (row.is_last) {
            continue;  // nobody asks for what the slopes become
        }
        for (std::int32_t i = 0; i < kBlock; ++i) {
            const float s = turned[i];
            const float rest = 1.0F - mask[i];
            const float open = 1.0F - clamp01(1.4F * absolute(s));
            mask[i] = (1.0F - rest * __builtin_sqrtf(rest)) * (1.0F - open * open);
            const float turn = s < 0.0F ? steepening : -steepening;
            slope_x[i] += turn * side_x[i];
            slope_z[i] += turn * side_z[i];
        }
    }
}

/// A piece of a reach at one place: keeps the nearest.
struct Nearest {
    float square = 1e30F;
    float along = 0;
};

Nearest nearer(Nearest best, float x, float z, const ReachShape& reach, std::int32_t piece) {
    const float ax = x - reach.px[piece];
    const float az = z - reach.pz[piece];
    const float ex = reach.px[piece + 1] - reach.px[piece];
    const float ez = reach.pz[piece + 1] - reach.pz[piece];
    const float t = clamp01((ax * ex + az * ez) * reach.inverse_square[piece]);
    const float qx = ax - t * ex;
    const float qz = az - t * ez;
    const float square = qx * qx + qz * qz;
    const float along = (static_cast<float>(piece) + t) / static_cast<float>(kReachSegments);
    return {square < best.square ? square : best.square, square < best.square ? along : best.along};
}

void valleys(ValleyPlaces& places, const ReachShape* reaches, std::int32_t count,
             const ValleyConstants& constants) {
    float sum[kBlock] = {};
    float levels[kBlock] = {};
    for (std::int32_t r = 0; r < count; ++r) {
        const ReachShape reach = reaches[r];
        for (std::int32_t i = 0; i < kBlock; ++i) {
            const float x = (places.x[i] - reach.x) + places.x_rest[i];
            const float z = (places.z[i] - reach.z) + places.z_rest[i];
            static_assert(kReachSegments == 4);
            Nearest nearest = nearer({}, x, z, reach, 0);
            nearest = nearer(nearest, x, z, reach, 1);
            nearest = nearer(nearest, x, z, reach, 2);
            nearest = nearer(nearest, x, z, reach, 3);
            const float rest = 1.0F - nearest.square * constants.inverse_reach_square;
            const float inverse = (rest > 0.0F ? rest : 0.0F) / (nearest.square + constants.e2);
            const float weight = inverse * inverse;
            sum[i] += weight;
            levels[i] += weight * (reach.level + reach.level_change * nearest.along);
        }
    }
    for (std::int32_t i = 0; i < kBlock; ++i) {
        places.weight[i] = sum[i];
        places.river[i] = levels[i] / sum[i];
        const float beyond = 1.0F / __builtin_sqrtf(sum[i]) - constants.e2;
        const float distance = __builtin_sqrtf(beyond > 0.0F ? beyond : 0.0F);
        const float share = distance / constants.half_valley;
        const float t = share < 1.4F ? share : 1.4F;
        const float square = t * t;
        const float crest = __builtin_sqrtf(square + 0.03F) - 0.173F;
        places.crest[i] = crest + constants.plateau * (square / (square + 0.15F) - crest);
    }
}

void mix_cells(float* __restrict out, const float* __restrict values, const SplineShares& shares,
               std::int32_t cells) {
    for (std::int32_t cell = 0; cell < cells; ++cell) {
        const float a = values[cell];
        const float b = values[cell + 1];
        const float c = values[cell + 2];
        const float d = values[cell + 3];
        float* __restrict const to = out + cell * kSplineCell;
        for (std::int32_t e = 0; e < kSplineCell; ++e) {
            to[e] = shares.of[0][e] * a + shares.of[1][e] * b + shares.of[2][e] * c +
                    shares.of[3][e] * d;
        }
    }
}

void near_reach(const ReachRow& row, const ReachShape& reach) {
    for (std::int32_t first = 0; first < row.count; first += kBlock) {
        const float* __restrict const wander_x = row.wander_x + first;
        const float* __restrict const wander_z = row.wander_z + first;
        float* __restrict const square = row.square + first;
        float* __restrict const along = row.along + first;
        for (std::int32_t i = 0; i < kBlock; ++i) {
            const float x = (row.x + row.step * static_cast<float>(first + i)) + wander_x[i];
            const float z = row.z + wander_z[i];
            static_assert(kReachSegments == 4);
            Nearest nearest = nearer({}, x, z, reach, 0);
            nearest = nearer(nearest, x, z, reach, 1);
            nearest = nearer(nearest, x, z, reach, 2);
            nearest = nearer(nearest, x, z, reach, 3);
            square[i] = nearest.square;
            along[i] = nearest.along;
        }
    }
}

bool resist(float* __restrict height, float* __restrict rest, const float* bottom,
            const float* __restrict top, const LayerResistance& layer, std::int32_t count) {
    const float cost = layer.cost;
    const float inverse_cost = layer.inverse_cost;
    const float concave = layer.concave;
    std::int32_t left[kBlock] = {};
    for (std::int32_t first = 0; first < count; first += kBlock) {
        float thickness[kBlock];
        for (std::int32_t i = 0; i < kBlock; ++i) {
            thickness[i] = top[first + i];
        }
        if (bottom != nullptr) {
            for (std::int32_t i = 0; i < kBlock; ++i) {
                thickness[i] = top[first + i] - bottom[first + i];
            }
        }
        for (std::int32_t i = 0; i < kBlock; ++i) {
            const float limit = thickness[i] * cost;
            const float before = rest[first + i];
            const float most = limit < before ? limit : before;
            const float m = 0.0F < most ? most : 0.0F;
            height[first + i] +=
                m * m * (1.0F + concave) / (m + concave * limit + 1e-9F) * inverse_cost;
            const float after = before - limit;
            rest[first + i] = after;
            left[i] |= after > 0.0F ? 1 : 0;
        }
    }
    std::int32_t any = 0;
    for (std::int32_t i = 0; i < kBlock; ++i) {
        any |= left[i];
    }
    return any != 0;
}

void raise_tops(float* __restrict raw_top, const float* bottom, const float* __restrict top,
                float cost, std::int32_t count) {
    if (bottom == nullptr) {
        for (std::int32_t i = 0; i < count; ++i) {
            raw_top[i] += top[i] * cost;
        }
        return;
    }
    const float* __restrict const below = bottom;
    for (std::int32_t i = 0; i < count; ++i) {
        raw_top[i] += (top[i] - below[i]) * cost;
    }
}

LedgeSeen ledge(const LedgeRow& row) {
    std::uint32_t* __restrict const lean = row.lean;
    const float* __restrict const highest = row.highest;
    const float* __restrict const raw = row.raw;
    const float* __restrict const moved = row.moved;
    const float* __restrict const raw_top = row.raw_top;
    const float* __restrict const top = row.top;
    const float* __restrict const bottom = row.bottom;
    const std::uint32_t bit = row.bit;
    const float thick_least = row.thick_least;
    const std::int32_t count = row.count;
    std::uint32_t any_leans = 0;
    std::uint32_t any_lower = 0;
    for (std::int32_t i = 0; i < count; ++i) {
        const std::uint32_t is_lower = raw_top[i] <= highest[i] ? bit : 0;
        const std::uint32_t is_above = raw_top[i] > raw[i] - moved[i] ? bit : 0;
        const std::uint32_t is_thick = top[i] - bottom[i] > thick_least ? bit : 0;
        const std::uint32_t leans = is_lower & is_above & is_thick;
        lean[i] |= leans;
        any_leans |= leans;
        any_lower |= is_lower;
    }
    return {any_leans, any_lower};
}

void tube(const TubeRow& row, const TubePiece& piece) {
    constexpr float kFlatFloor = 0.62F;
    constexpr float kCeiling = 0.95F;
    for (std::int32_t first = 0; first < row.count; first += kBlock) {
        float* __restrict const floor = row.floor + first;
        float* __restrict const lid = row.lid + first;
        const float* __restrict const rough = row.rough + first;
        const float* __restrict const ragged = row.ragged + first;
        const float az = row.z - piece.z;
        const std::int32_t left = row.count - first;
        for (std::int32_t i = 0; i < kBlock; ++i) {
            const float ax = (row.x + static_cast<float>(first + i)) - piece.x;
            const float t = clamp01((ax * piece.ex + az * piece.ez) * piece.inverse_square);
            const float qx = ax - t * piece.ex;
            const float qz = az - t * piece.ez;
            const float r =
                (piece.radius + t * piece.dr) * (1.0F + 0.25F * rough[i] + 0.15F * ragged[i]);
            const float rest = r * r - (qx * qx + qz * qz);
            const float hh = __builtin_sqrtf(rest > 0.0F ? rest : 0.0F);
            const float up = kCeiling * (1.0F + 0.5F * ragged[i]);
            const float y = piece.y + t * piece.dy;
            const float reach = hh * piece.steep;
            const float high = y + up * reach;
            const float high_most = piece.y_max + up * hh;
            const float new_lid = high < high_most ? high : high_most;
            const float low = y - kFlatFloor * reach;
            const float low_least = piece.y_min - kFlatFloor * hh;
            const float new_floor = low > low_least ? low : low_least;
            // A column of another row, or out of the tube, keeps what it has.
            const bool is_in = static_cast<int>(rest > 0.0F) & static_cast<int>(i < left);
            const float lid_here = is_in ? new_lid : -3.0e38F;
            const float floor_here = is_in ? new_floor : 3.0e38F;
            lid[i] = lid[i] < lid_here ? lid_here : lid[i];
            floor[i] = floor[i] > floor_here ? floor_here : floor[i];
        }
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
                             .erode = erode,
                             .valleys = valleys,
                             .mix_cells = mix_cells,
                             .near_reach = near_reach,
                             .resist = resist,
                             .raise_tops = raise_tops,
                             .ledge = ledge,
                             .tube = tube};

}  // namespace terrane::TERRANE_KERNEL_SET
