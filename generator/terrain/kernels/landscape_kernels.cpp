// The inner loops of landscapes, compiled as row_kernels.cpp is and under its rules.
//
// Sources: see the files of generator/landscape that ask for them.
#include "generator/terrain/kernels/row_kernels.h"

namespace terrane::TERRANE_KERNEL_SET {
namespace {

constexpr std::int32_t kBlock = kVectorPad;

float clamp01(float t) {
    t = t < 0.0F ? 0.0F : t;
    return t > 1.0F ? 1.0F : t;
}

float absolute(float x) {
    return __builtin_fabsf(x);
}

/// Sine of -2..2 quarter turns.
float sine(float q) {
    const float y = (q + q) - q * absolute(q);
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
        const float quarters = 4.0F * (phase - __builtin_rintf(phase));
        stripes.cosine[i] += k * sine(1.0F - absolute(quarters));
        stripes.sine[i] += k * sine(quarters);
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
    const float* __restrict const crest = row.crest;
    const float* __restrict const raw_top = row.raw_top;
    const float* __restrict const top = row.top;
    const float* __restrict const bottom = row.bottom;
    const std::uint32_t bit = row.bit;
    const float crest_least = row.crest_least;
    const float thick_least = row.thick_least;
    const std::int32_t count = row.count;
    std::uint32_t any_leans = 0;
    std::uint32_t any_lower = 0;
    for (std::int32_t i = 0; i < count; ++i) {
        const std::uint32_t is_lower = raw_top[i] <= highest[i] ? bit : 0;
        const std::uint32_t is_above = raw_top[i] > raw[i] - moved[i] ? bit : 0;
        const std::uint32_t is_thick = top[i] - bottom[i] > thick_least ? bit : 0;
        const std::uint32_t is_high = crest[i] >= crest_least ? bit : 0;
        const std::uint32_t leans = is_lower & is_above & is_thick & is_high;
        lean[i] |= leans;
        any_leans |= leans;
        any_lower |= is_lower;
    }
    return {any_leans, any_lower};
}

float nearest_lip(const LipPlace& place) {
    float nearest[kBlock];
    for (std::int32_t i = 0; i < kBlock; ++i) {
        nearest[i] = 1.0F;
    }
    for (std::int32_t z = -place.reach; z <= place.reach; ++z) {
        const std::int64_t row = z * place.stride;
        if (place.row_highest[row] < place.raw_top) {
            continue;
        }
        const float* __restrict const over = place.over + row;
        const float* __restrict const moved = place.moved + row;
        const float* __restrict const inverse_reaches = place.inverse_reaches + row;
        const float* __restrict const distance = place.distances + (z < 0 ? -z : z) * kBlock;
        for (std::int32_t i = 0; i < kBlock; ++i) {
            const bool is_lip =
                static_cast<int>(over[i] >= place.raw_top) &
                static_cast<int>(absolute(moved[i] - place.moved_here) <= 0.4F * distance[i]);
            const float share = is_lip ? distance[i] * inverse_reaches[i] : 1.0F;
            nearest[i] = share < nearest[i] ? share : nearest[i];
        }
    }
    float least = nearest[0];
    for (std::int32_t i = 1; i < kBlock; ++i) {
        least = nearest[i] < least ? nearest[i] : least;
    }
    return least;
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

extern const LandscapeKernels kLandscapeKernels;
const LandscapeKernels kLandscapeKernels = {.erode = erode,
                                            .valleys = valleys,
                                            .mix_cells = mix_cells,
                                            .near_reach = near_reach,
                                            .resist = resist,
                                            .raise_tops = raise_tops,
                                            .ledge = ledge,
                                            .nearest_lip = nearest_lip,
                                            .tube = tube};

}  // namespace terrane::TERRANE_KERNEL_SET
