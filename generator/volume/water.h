// Water: a hollow for those who walk, filled to a surface of its own.
#pragma once

#include "generator/world/composition.h"
#include "generator/world/world_definition.h"

#include <span>

namespace terrane {

/// Whether an entry is water. `materials` is WorldDefinition::materials.
inline bool is_water(const PaletteEntry& entry, std::span<const Material> materials) {
    return !entry.is_solid() && entry.composition.count > 0 &&
           materials[entry.composition.storage[0].material].kind == MaterialKind::water;
}

}  // namespace terrane
