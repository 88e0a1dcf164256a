// Per-voxel Perlin noise, what the paper compares itself with ("PN"): the baseline of our ratios.
//
// Classic form: K. Perlin, "Improving noise", 2002, in three dimensions with a permutation table
// and doubles. The paper's PN gives each voxel its material and internal flow: four samples a
// voxel.
#pragma once

#include "generator/terrain/random.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>

namespace terrane {

class ClassicPerlin {
  public:
    explicit ClassicPerlin(std::uint64_t seed) {
        std::iota(permutation_.begin(), permutation_.begin() + 256, std::uint8_t{0});
        RandomStream random(seed);
        for (std::size_t i = 255; i > 0; --i) {
            std::swap(permutation_[i], permutation_[random.next() % (i + 1)]);
        }
        for (std::size_t i = 0; i < 256; ++i) {
            permutation_[i + 256] = permutation_[i];
        }
    }

    double at(double x, double y, double z) const {
        const double floor_x = std::floor(x);
        const double floor_y = std::floor(y);
        const double floor_z = std::floor(z);
        const std::size_t ix = cell(floor_x);
        const std::size_t iy = cell(floor_y);
        const std::size_t iz = cell(floor_z);
        x -= floor_x;
        y -= floor_y;
        z -= floor_z;
        const double u = fade(x);
        const double v = fade(y);
        const double w = fade(z);
        const auto& p = permutation_;
        const std::size_t a = p[ix] + iy;
        const std::size_t aa = p[a] + iz;
        const std::size_t ab = p[a + 1] + iz;
        const std::size_t b = p[ix + 1] + iy;
        const std::size_t ba = p[b] + iz;
        const std::size_t bb = p[b + 1] + iz;
        return lerp(
            w,
            lerp(v, lerp(u, grad(p[aa], x, y, z), grad(p[ba], x - 1, y, z)),
                 lerp(u, grad(p[ab], x, y - 1, z), grad(p[bb], x - 1, y - 1, z))),
            lerp(v, lerp(u, grad(p[aa + 1], x, y, z - 1), grad(p[ba + 1], x - 1, y, z - 1)),
                 lerp(u, grad(p[ab + 1], x, y - 1, z - 1), grad(p[bb + 1], x - 1, y - 1, z - 1))));
    }

  private:
    static std::size_t cell(double value) {
        return static_cast<std::size_t>(static_cast<std::int64_t>(value) & 255);
    }

    static double fade(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }

    static double lerp(double t, double a, double b) { return a + t * (b - a); }

    static double grad(std::uint8_t hash, double x, double y, double z) {
        const unsigned h = hash & 15U;
        const double u = h < 8 ? x : y;
        const double v = h < 4 ? y : (h == 12 || h == 14 ? x : z);
        return ((h & 1U) == 0 ? u : -u) + ((h & 2U) == 0 ? v : -v);
    }

    std::array<std::uint8_t, 512> permutation_{};
};

/// What a voxel of the baseline holds.
struct PerlinVoxel {
    float material = 0;
    float flow_x = 0;
    float flow_y = 0;
    float flow_z = 0;
};

}  // namespace terrane
