// What a composition looks like on a mesh: its colour in linear light and its main material.
#pragma once

#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"

#include <cstdint>
#include <span>
#include <vector>

namespace terrane {

/// Linear-light colour, 255 is 1, and the index of the material with the largest share.
struct Shade {
    std::uint8_t r = 0;
    std::uint8_t g = 0;
    std::uint8_t b = 0;
    std::uint8_t material = 0;

    friend bool operator==(const Shade&, const Shade&) = default;
};

/// The definition's material colours in linear light, by material index.
std::vector<LinearColor> linear_colors_of(const WorldDefinition& definition);

/// Every material's own colour and index, by material index.
std::vector<Shade> material_shades_of(const WorldDefinition& definition);

/// The material with the largest share; the first of equals.
std::uint8_t main_material(const Composition& composition);

/// The material with the largest share of (1 - t) * low + t * high; the first of equals.
std::uint8_t main_material(const Composition& low, const Composition& high, double t);

/// A palette entry's colour before and after rounding.
struct PaletteShade {
    LinearColor color;
    Shade shade;
};

/// Overwrites `out` with one shade a palette entry; black where a composition is empty.
void find_palette_shades(std::vector<PaletteShade>& out, const Palette& palette,
                         std::span<const LinearColor> material_colors);

/// The shade at height y256 of a column: the linear mix of the limits below and above. A frontier
/// belongs to what is below it. Needs: at least one limit; `shades` made from `palette`.
Shade shade_at(std::span<const Limit> limits, std::int32_t y256, const Palette& palette,
               std::span<const PaletteShade> shades);

}  // namespace terrane
