// Elements: veins and caves that stand in the gaps between layers. Their plot decides how many
// there are; a hash of plot, type and number decides everything else. Source: the paper, 4.2.2
// (veins), 4.2.3 (caves), 4.2.4 (later plots: 0.5 to 1.5 times the first).
#pragma once

#include "generator/terrain/world.h"
#include "generator/world/composition.h"

#include <cstdint>
#include <optional>
#include <vector>

namespace terrane {

struct PlotPos {
    std::int64_t x = 0;
    std::int64_t z = 0;

    friend auto operator<=>(const PlotPos&, const PlotPos&) = default;
};

enum class ElementType : std::uint8_t { vein = 0, cave = 1 };

struct Element {
    PlotPos plot;
    ElementType type = ElementType::vein;
    std::int32_t number = 0;  ///< among those of its type in its plot
    std::uint64_t id = 0;     ///< hash of plot, type and number
    std::int32_t gap = 0;     ///< stands on top of this layer
    float center_x = 0;       ///< plot-local, columns
    float center_z = 0;
    float side = 0;          ///< of its square, columns
    float thickness = 0;     ///< in the middle, voxels
    double roughness = 0;    ///< of its outline, 0..1
    std::int32_t blend = 0;  ///< share of its thickness that blends, 1/256
    PaletteEntry content;
};

/// The order in which elements of a region are laid down and numbered: gap, id, then plot, type and
/// number to break ties.
bool comes_before(const Element& a, const Element& b);

/// Draws every element of a plot. `out` is overwritten. Any thread.
void draw_plot(std::vector<Element>& out, const World& world, PlotPos plot);

}  // namespace terrane
