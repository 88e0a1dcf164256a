// Colours of mixes: sRGB in the world file, linear light when mixed.
//
// Served meshes carry these colours, so they must have the same bits on every machine: the curve is
// computed with + - * / only, never with libm's pow.
#pragma once

#include "generator/world/composition.h"
#include "generator/world/world_definition.h"

#include <span>
#include <vector>

namespace terrane {

/// The standard's curve (IEC 61966-2-1), rounded to float.
LinearColor linear_from_srgb(Rgb8 color);

/// The nearest sRGB; values outside 0..1 are clamped.
Rgb8 srgb_from_linear(LinearColor color);

/// The mix of the materials' colours in linear light. `materials` is WorldDefinition::materials.
LinearColor color_of(std::span<const Share> shares, std::span<const Material> materials);

/// Colour of every palette entry, by position.
std::vector<LinearColor> palette_colors(const Palette& palette,
                                        std::span<const Material> materials);

}  // namespace terrane
