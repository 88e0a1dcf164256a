#include "generator/landscape/resistance.h"

#include "generator/terrain/choose_composition.h"
#include "generator/terrain/kernels/landscape_kernels.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/layer_stack.h"
#include "generator/world/world_definition.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

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

bool ResistanceWalk::pass(const LayerResistance& layer, const LayerHeights& layers, std::size_t k,
                          const RowKernels& kernels) {
    const float* const top = layers.first + k * layers.plane;
    return kernels.landscape->resist(height_, rest_, k > 0 ? top - layers.plane : nullptr, top,
                                     layer, static_cast<std::int32_t>(count_));
}

}  // namespace terrane
