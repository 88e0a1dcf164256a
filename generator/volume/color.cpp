#include "generator/volume/color.h"

#include "generator/world/composition.h"
#include "generator/world/world_definition.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {
namespace {

/// x^(1/5) for 0 < x <= 1 by Newton's method, which converges from above.
constexpr double fifth_root(double x) {
    double root = 1;
    for (int i = 0; i < 60; ++i) {
        const double fourth = root * root * root * root;
        root -= (root * fourth - x) / (5 * fourth);
    }
    return root;
}

/// `code` in 0..1.
constexpr double decode_srgb(double code) {
    if (code <= 0.04045) {
        return code / 12.92;
    }
    const double base = (code + 0.055) / 1.055;
    const double tenths = fifth_root(base);
    return base * base * tenths * tenths;  // base^2.4
}

constexpr auto kLinear = [] {
    std::array<float, 256> table{};
    for (std::size_t i = 0; i < table.size(); ++i) {
        table[i] = static_cast<float>(decode_srgb(static_cast<double>(i) / 255));
    }
    return table;
}();

/// kThresholds[i]: from here on, i + 1 is nearer than i.
constexpr auto kThresholds = [] {
    std::array<float, 255> table{};
    for (std::size_t i = 0; i < table.size(); ++i) {
        table[i] = static_cast<float>(decode_srgb((static_cast<double>(i) + 0.5) / 255));
    }
    return table;
}();

std::uint8_t encode_srgb(float value) {
    const auto above = std::upper_bound(kThresholds.begin(), kThresholds.end(), value);
    return static_cast<std::uint8_t>(above - kThresholds.begin());
}

}  // namespace

LinearColor linear_from_srgb(Rgb8 color) {
    return {.r = kLinear[color.r], .g = kLinear[color.g], .b = kLinear[color.b]};
}

Rgb8 srgb_from_linear(LinearColor color) {
    return {.r = encode_srgb(color.r), .g = encode_srgb(color.g), .b = encode_srgb(color.b)};
}

LinearColor color_of(std::span<const Share> shares, std::span<const Material> materials) {
    LinearColor mixed;
    for (const Share& share : shares) {
        const LinearColor color = linear_from_srgb(materials[share.material].color);
        const auto weight = static_cast<float>(share.concentration);
        mixed.r += color.r * weight;
        mixed.g += color.g * weight;
        mixed.b += color.b * weight;
    }
    return mixed;
}

std::vector<LinearColor> palette_colors(const Palette& palette,
                                        std::span<const Material> materials) {
    std::vector<LinearColor> colors;
    colors.reserve(palette.size());
    for (const PaletteEntry& entry : palette) {
        colors.push_back(color_of(entry.composition.shares(), materials));
    }
    return colors;
}

}  // namespace terrane
