#include "generator/landscape/landscape_palette.h"

#include "generator/landscape/fold.h"
#include "generator/landscape/fractures.h"
#include "generator/landscape/river_graph.h"
#include "generator/terrain/layer_stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace terrane {
namespace {

std::optional<std::uint16_t> material_of(const WorldDefinition& definition, MaterialKind kind) {
    for (std::size_t i = 0; i < definition.materials.size(); ++i) {
        if (definition.materials[i].kind == kind) {
            return static_cast<std::uint16_t>(i);
        }
    }
    return std::nullopt;
}

std::vector<std::uint16_t> filling_materials(const WorldDefinition& definition) {
    std::vector<std::uint16_t> all;
    std::vector<std::uint16_t> without_area;
    for (std::size_t i = 0; i < definition.materials.size(); ++i) {
        if (definition.materials[i].kind == MaterialKind::vein) {
            all.push_back(static_cast<std::uint16_t>(i));
            if (definition.materials[i].area == 0) {
                without_area.push_back(static_cast<std::uint16_t>(i));
            }
        }
    }
    return without_area.empty() ? all : without_area;
}

std::uint16_t append(Palette& palette, std::uint16_t material, PaletteKind kind) {
    PaletteEntry entry{.composition = {}, .kind = kind, .alone = false};
    entry.composition.add(material, 1);
    palette.push_back(entry);
    return static_cast<std::uint16_t>(palette.size() - 1);
}

std::uint16_t append_mix(Palette& palette, std::uint16_t gangue, std::uint16_t ore, double share) {
    PaletteEntry entry{.composition = {}, .kind = PaletteKind::vein, .alone = false};
    entry.composition.add(share > 0.5 ? ore : gangue, std::max(share, 1 - share));
    entry.composition.add(share > 0.5 ? gangue : ore, std::min(share, 1 - share));
    palette.push_back(entry);
    return static_cast<std::uint16_t>(palette.size() - 1);
}

}  // namespace

LandscapePalette append_landscape_palette(Palette& palette, const WorldDefinition& definition) {
    LandscapePalette ids;
    const std::uint16_t air = material_of(definition, MaterialKind::void_).value_or(0);
    ids.cave_air = append(palette, air, PaletteKind::cave);
    ids.open_air = append(palette, air, PaletteKind::cave);
    const auto append_kind = [&](MaterialKind kind, PaletteKind as) {
        const auto material = material_of(definition, kind);
        return material ? append(palette, *material, as) : LandscapePalette::kNoEntry;
    };
    ids.water = append_kind(MaterialKind::water, PaletteKind::cave);
    ids.soil = append_kind(MaterialKind::soil, PaletteKind::vein);
    ids.sand = append_kind(MaterialKind::sand, PaletteKind::vein);
    ids.snow = append_kind(MaterialKind::snow, PaletteKind::vein);
    if (definition.structure.sheet <= 0) {
        return ids;
    }
    const std::vector<std::uint16_t> materials = filling_materials(definition);
    if (materials.size() == 1) {
        const std::uint16_t only = append(palette, materials[0], PaletteKind::vein);
        ids.fillings.push_back({.primary = only, .enriched = only});
    }
    for (std::size_t i = 1; i < materials.size(); ++i) {
        const std::uint16_t primary = append_mix(palette, materials[0], materials[i], kOrePrimary);
        const std::uint16_t enriched =
            append_mix(palette, materials[0], materials[i], kOreEnriched);
        ids.fillings.push_back({.primary = primary, .enriched = enriched});
    }
    return ids;
}

double landscape_height_bound(const WorldDefinition& definition, const LayerStack& stack) {
    const ReliefParameters& relief = definition.relief;
    const double rock = stack.height_bound +
                        static_cast<double>(FoldConstants(definition).bound()) +
                        FractureConstants(definition).bound();
    double bound = rock;
    if (relief.height > 0) {
        // The resistance map is a detour from raw height to rock and back: no higher than either.
        // Crests reach 1.24 of the height; each octave of gullies adds up to its amplitude.
        const double raw =
            RiverConstants(definition).level_max() + 1.25 * relief.height + 3 * relief.gullies;
        bound = std::max(rock, raw);
    }
    return std::max(bound + 0.5 * relief.gullies, relief.sea_level.value_or(0)) + 2;
}

}  // namespace terrane
