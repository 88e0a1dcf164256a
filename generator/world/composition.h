// A mix of materials with concentrations, and the palette that limits refer to.
#pragma once

#include "generator/world/world_definition.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {

inline constexpr std::size_t kCompositionMaterialsMax = 6;

/// `material` is an index into WorldDefinition::materials; `concentration` is in (0, 1].
struct Share {
    std::uint16_t material = 0;
    double concentration = 0;

    friend bool operator==(const Share&, const Share&) = default;
};

/// Shares in the order in which they were chosen: the main material is first. They sum to 1.
struct Composition {
    std::array<Share, kCompositionMaterialsMax> storage{};
    std::uint8_t count = 0;

    std::span<const Share> shares() const { return {storage.data(), count}; }

    void add(std::uint16_t material, double concentration) {
        storage[count++] = {.material = material, .concentration = concentration};
    }

    friend bool operator==(const Composition& a, const Composition& b) {
        if (a.count != b.count) {
            return false;
        }
        for (std::size_t i = 0; i < a.count; ++i) {
            if (a.storage[i] != b.storage[i]) {
                return false;
            }
        }
        return true;
    }
};

/// Linear-light colour, 0..1 a channel.
struct LinearColor {
    float r = 0;
    float g = 0;
    float b = 0;

    friend bool operator==(const LinearColor&, const LinearColor&) = default;
};

enum class PaletteKind : std::uint8_t { layer, void_, vein, cave };

/// One composition that limits may show.
struct PaletteEntry {
    Composition composition;
    PaletteKind kind = PaletteKind::layer;
    bool alone = false;  ///< main material is `alone`: frontiers against it are always sharp

    bool is_solid() const { return kind == PaletteKind::layer || kind == PaletteKind::vein; }

    friend bool operator==(const PaletteEntry&, const PaletteEntry&) = default;
};

/// Ids are positions: 0..K-1 the world's layers bottom first, K the void, K+1.. elements, every
/// element its own entry even where two have equal compositions.
using Palette = std::vector<PaletteEntry>;

}  // namespace terrane
