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

ResistanceWalk::ResistanceWalk(float* height, float* rest, const float* over, std::size_t count)
    : height_(height), rest_(rest), count_(count) {
    std::fill_n(height, count, 0.0F);
    std::copy_n(over, count, rest);
}

bool ResistanceWalk::pass(const LayerResistance& layer, const LayerHeights& layers, std::size_t k) {
    const float* __restrict const top = layers.first + k * layers.plane;
    const float* __restrict const bottom = k > 0 ? top - layers.plane : nullptr;
    float* __restrict const height = height_;
    float* __restrict const rest = rest_;
    const auto climb = [&](std::size_t i, float thickness) {
        const float limit = thickness * layer.cost;
        const float m = std::max(0.0F, std::min(rest[i], limit));
        height[i] += m * m * (1.0F + layer.concave) / (m + layer.concave * limit + 1e-9F) *
                     layer.inverse_cost;
        rest[i] -= limit;
        return static_cast<std::int32_t>(rest[i] > 0);
    };
    std::int32_t is_left = 0;
    if (bottom == nullptr) {
        for (std::size_t i = 0; i < count_; ++i) {
            is_left |= climb(i, top[i]);
        }
    } else {
        for (std::size_t i = 0; i < count_; ++i) {
            is_left |= climb(i, top[i] - bottom[i]);
        }
    }
    return is_left != 0;
}

}  // namespace terrane
