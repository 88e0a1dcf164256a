// Which materials a layer or element is made of, and the properties that follow from the mix.
// Source: the paper, 4.2.1, eq. 1 (affinity), eq. 2 (choice), eq. 3 (properties).
#pragma once

#include "generator/terrain/random.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"

#include <cstdint>
#include <optional>

namespace terrane {

/// What is being filled: the first layer, a later layer, a vein, a cave.
enum class Filling : std::uint8_t { base, regular, vein, cave };

/// Chooses materials for a thing that rests on `previous` (null for the first layer) at relative
/// depth `depth`, 1 at the bottom and 0 at the surface. Nothing if no material fits.
std::optional<Composition> choose_composition(RandomStream& random,
                                              const WorldDefinition& definition, Filling filling,
                                              const Composition* previous, double depth);

/// Triangular distribution by its inverse; `u` in [0, 1).
double triangular(const Range& range, double u);

struct DrawnProperties {
    double thickness = 0;  ///< relative, 0..1
    double roughness = 0;  ///< relative, 0..1
};

/// Eq. 3 for the two properties that are drawn: two draws a material, in composition order.
DrawnProperties draw_properties(RandomStream& random, const WorldDefinition& definition,
                                const Composition& composition);

/// Eq. 3 for a property that every material has a fixed value of.
template <typename Property>
double mixed_property(const WorldDefinition& definition, const Composition& composition,
                      Property property) {
    double value = 0;
    for (const Share& share : composition.shares()) {
        value += share.concentration * property(definition.materials[share.material]);
    }
    return value;
}

/// Whether the main material is never mixed; frontiers against it are sharp.
bool is_alone(const WorldDefinition& definition, const Composition& composition);

/// Share of an interval that blends, in 1/256.
std::int32_t blend256(double blend);

}  // namespace terrane
