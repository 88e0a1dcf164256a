#include "generator/mesh/shade.h"

#include "generator/volume/color.h"
#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {
namespace {

std::uint8_t to_byte(float value) {
    return static_cast<std::uint8_t>(std::floor(std::clamp(value, 0.0F, 1.0F) * 255.0F + 0.5F));
}

Shade rounded(LinearColor color, std::uint8_t material) {
    return {
        .r = to_byte(color.r), .g = to_byte(color.g), .b = to_byte(color.b), .material = material};
}

double share_of(const Composition& composition, std::uint16_t material) {
    double sum = 0;
    for (const Share& share : composition.shares()) {
        sum += share.material == material ? share.concentration : 0.0;
    }
    return sum;
}

}  // namespace

std::vector<LinearColor> linear_colors_of(const WorldDefinition& definition) {
    std::vector<LinearColor> colors;
    colors.reserve(definition.materials.size());
    for (const Material& material : definition.materials) {
        colors.push_back(linear_from_srgb(material.color));
    }
    return colors;
}

std::vector<Shade> material_shades_of(const WorldDefinition& definition) {
    std::vector<Shade> shades;
    for (const LinearColor& color : linear_colors_of(definition)) {
        shades.push_back(rounded(color, static_cast<std::uint8_t>(shades.size())));
    }
    return shades;
}

std::uint8_t main_material(const Composition& composition) {
    Share main;
    for (const Share& share : composition.shares()) {
        main = share.concentration > main.concentration ? share : main;
    }
    return static_cast<std::uint8_t>(main.material);
}

std::uint8_t main_material(const Composition& low, const Composition& high, double t) {
    Share main;
    for (const Composition* composition : {&low, &high}) {
        for (const Share& share : composition->shares()) {
            const double amount =
                share_of(low, share.material) * (1.0 - t) + share_of(high, share.material) * t;
            if (amount > main.concentration) {
                main = {.material = share.material, .concentration = amount};
            }
        }
    }
    return static_cast<std::uint8_t>(main.material);
}

void find_palette_shades(std::vector<PaletteShade>& out, const Palette& palette,
                         std::span<const LinearColor> material_colors) {
    out.resize(palette.size());
    for (std::size_t i = 0; i < palette.size(); ++i) {
        LinearColor color;
        Share main;
        for (const Share& share : palette[i].composition.shares()) {
            const LinearColor& part = material_colors[share.material];
            const auto amount = static_cast<float>(share.concentration);
            color.r += amount * part.r;
            color.g += amount * part.g;
            color.b += amount * part.b;
            main = share.concentration > main.concentration ? share : main;
        }
        out[i] = {.color = color,
                  .shade = rounded(color, static_cast<std::uint8_t>(main.material))};
    }
}

Shade shade_at(std::span<const Limit> limits, std::int32_t y256, const Palette& palette,
               std::span<const PaletteShade> shades) {
    const auto high = std::find_if(limits.begin(), limits.end(),
                                   [y256](const Limit& limit) { return limit.y256 >= y256; });
    if (high == limits.begin()) {
        return shades[high->palette_id].shade;
    }
    const Limit& low = high[-1];
    if (high == limits.end() || low.palette_id == high->palette_id) {
        return shades[low.palette_id].shade;
    }
    const PaletteShade& from = shades[low.palette_id];
    const PaletteShade& to = shades[high->palette_id];
    const float t = static_cast<float>(y256 - low.y256) / static_cast<float>(high->y256 - low.y256);
    const LinearColor color{.r = from.color.r + t * (to.color.r - from.color.r),
                            .g = from.color.g + t * (to.color.g - from.color.g),
                            .b = from.color.b + t * (to.color.b - from.color.b)};
    if (from.shade.material == to.shade.material) {
        return rounded(color, from.shade.material);
    }
    return rounded(color,
                   main_material(palette[low.palette_id].composition,
                                 palette[high->palette_id].composition, static_cast<double>(t)));
}

}  // namespace terrane
