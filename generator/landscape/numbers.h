// Small functions that all of the landscape computes with: only + - * / sqrt, floor and comparison,
// so that every machine gets the same bits.
#pragma once

#include "generator/terrain/random.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace terrane {

/// What a landscape's hashes are for; beside `Tag`, which holds the stack's.
enum class LandscapeTag : std::uint8_t {
    potential = 16,
    river_node,
    mountains,
    gully,
    fold,
    fracture,
    cave,
    cave_noise,
    soil,
    warp
};

constexpr std::uint64_t as_key_part(LandscapeTag tag) {
    return static_cast<std::uint64_t>(tag);
}

constexpr float clamp01(float x) {
    return std::min(std::max(x, 0.0F), 1.0F);
}

/// 0 at 0, 1 from 1 on, flat there.
constexpr float ease(float t) {
    const float rest = 1.0F - clamp01(t);
    return 1.0F - rest * rest;
}

/// 0 up to `a`, 1 from `b` on, flat at both.
constexpr float smooth_step(float a, float b, float x) {
    const float t = clamp01((x - a) / (b - a));
    return t * t * (3.0F - 2.0F * t);
}

constexpr float lerp(float a, float b, float share) {
    return a + share * (b - a);
}

/// The turn's share in -0.5..0.5.
inline float wrap_turn(float t) {
    return t - std::floor(t + 0.5F);
}

/// Sine of -0.5..0.5 turns to a thousandth, as the flow of layers uses it.
inline float sin_turn(float t) {
    const float y = 8.0F * t - 16.0F * t * std::abs(t);
    return 0.225F * (y * std::abs(y) - y) + y;
}

inline float cos_turn(float t) {
    return sin_turn(wrap_turn(t + 0.25F));
}

/// Uniform in [0, 1) from a hash.
constexpr double unit_of(std::uint64_t hash) {
    return static_cast<double>(hash >> 11U) * 0x1p-53;
}

/// A draw from a stream, as float.
inline float unit_float(RandomStream& random) {
    return static_cast<float>(random.unit());
}

/// A direction on the map, of length 1.
struct Direction {
    double x = 1;
    double z = 0;
};

/// `turns` from +x towards +z.
inline Direction direction_of(double turns) {
    const auto sine = [](double t) {
        t -= std::floor(t + 0.5);
        const double y = 8 * t - 16 * t * std::abs(t);
        return 0.225 * (y * std::abs(y) - y) + y;
    };
    const double x = sine(turns + 0.25);
    const double z = sine(turns);
    const double length = std::sqrt(x * x + z * z);
    return {.x = x / length, .z = z / length};
}

}  // namespace terrane
