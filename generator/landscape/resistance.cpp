#include "generator/landscape/resistance.h"

#include "generator/terrain/choose_composition.h"

#include <algorithm>

namespace terrane {

ResistanceConstants::ResistanceConstants(const WorldDefinition& definition,
                                         const LayerStack& stack) {
    std::vector<double> resistances;
    double sum = 0;
    for (const Layer& layer : stack.layers) {
        const double hardness = mixed_property(definition, layer.composition,
                                               [](const Material& m) { return m.hardness; });
        const double a = (2 * hardness - 1) * definition.relief.cliffs;
        resistances.push_back((1 + a) / (1 - a));
        sum += layer.thickness / resistances.back();
    }
    for (const double resistance : resistances) {
        const double cost = definition.terrain.depth / sum / resistance;
        layers.push_back({.cost = static_cast<float>(cost),
                          .inverse_cost = static_cast<float>(1 / cost),
                          .resistance = static_cast<float>(resistance),
                          .concave = static_cast<float>(
                              resistance > 1 ? 0.3 * std::min(1.0, resistance - 1) : 0.0)});
    }
}

void resist(float* height, float* rest, const float* over, const ResistanceConstants& constants,
            const LayerHeights& layers, std::size_t count) {
    std::fill_n(height, count, 0.0F);
    std::copy_n(over, count, rest);
    for (std::size_t k = 0; k < constants.layers.size(); ++k) {
        const LayerResistance layer = constants.layers[k];
        const float* const top = layers.first + k * layers.plane;
        const float* const bottom = k > 0 ? top - layers.plane : nullptr;
        std::int32_t is_left = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const float thickness = bottom != nullptr ? top[i] - bottom[i] : top[i];
            const float limit = thickness * layer.cost;
            const float m = std::max(0.0F, std::min(rest[i], limit));
            height[i] += m * m * (1.0F + layer.concave) / (m + layer.concave * limit + 1e-9F) *
                         layer.inverse_cost;
            rest[i] -= limit;
            is_left |= static_cast<std::int32_t>(rest[i] > 0);
        }
        if (is_left == 0) {
            break;  // higher layers would add 0
        }
    }
}

}  // namespace terrane
