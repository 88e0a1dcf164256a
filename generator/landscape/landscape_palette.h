// What a landscape adds to a world's palette, and how high a landscape can rise.
//
// After the layers and the void come, always in this order: cave air, open air (under overhangs),
// then water, soil, sand and snow as far as the world has them, then two entries for each filling
// of fractures, the primary and the enriched one. Veins follow as in every stack.
//
// Fillings are made of vein materials of area 0, which form no lenses; without any, of all vein
// materials. The first by id is the gangue; each further one is an ore of its own: kOrePrimary of
// it in the gangue at depth, kOreEnriched near the ground.
#pragma once

#include "generator/terrain/layer_stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"

#include <cstdint>
#include <vector>

namespace terrane {

inline constexpr double kOrePrimary = 0.15;
inline constexpr double kOreEnriched = 0.6;

/// Palette ids; kNoEntry for what the world does not have.
struct LandscapePalette {
    static constexpr std::uint16_t kNoEntry = 0xffff;

    struct Filling {
        std::uint16_t primary = kNoEntry;
        std::uint16_t enriched = kNoEntry;
    };

    std::uint16_t cave_air = kNoEntry;
    std::uint16_t open_air = kNoEntry;
    std::uint16_t water = kNoEntry;
    std::uint16_t soil = kNoEntry;
    std::uint16_t sand = kNoEntry;
    std::uint16_t snow = kNoEntry;
    std::vector<Filling> fillings;
};

/// Appends the entries to `palette`, which holds the layers and the void.
LandscapePalette append_landscape_palette(Palette& palette, const WorldDefinition& definition);

/// Nothing solid and no water stands above, voxels.
double landscape_height_bound(const WorldDefinition& definition, const LayerStack& stack);

}  // namespace terrane
