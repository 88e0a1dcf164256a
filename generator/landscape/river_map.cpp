#include "generator/landscape/river_map.h"

#include "generator/landscape/channels.h"
#include "generator/landscape/relief.h"
#include "generator/terrain/kernels/kernel_choice.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/world.h"

#include <algorithm>
#include <cstddef>
#include <span>

namespace terrane {

RiverMap::RiverMap(const World& world)
    : has_rivers_(world.definition.relief.height > 0 && world.definition.relief.rivers > 0),
      relief_(world.definition),
      channels_(world.definition) {}

std::span<const float> RiverMap::distances(const RectangleShape& shape, float within) {
    const std::size_t size = shape.padded_size();
    distances_.assign(size, within);
    // Farther levels have no channels either: rivers would lie side by side.
    if (!has_rivers_ || !is_smooth_step(relief_, shape.step)) {
        return distances_;
    }
    builder_.find_rivers(relief_, shape);
    const RowKernels& kernels = chosen_row_kernels();
    wander_.wander_x.resize(size);
    wander_.wander_z.resize(size);
    noise_rectangle(wander_.wander_x.data(), relief_.rivers.wander_x, shape, kernels, noise_);
    noise_rectangle(wander_.wander_z.data(), relief_.rivers.wander_z, shape, kernels, noise_);
    for (std::size_t i = 0; i < size; ++i) {
        wander_.wander_x[i] *= relief_.rivers.wander;
        wander_.wander_z[i] *= relief_.rivers.wander;
    }
    find_near(near_, channels_, wander_, builder_.rivers(), shape, kernels, within);
    for (const NearReach& near : near_) {
        const float beyond = std::max(0.0F, near.distance - kWetWidths * near.half_width);
        distances_[near.column] = std::min(distances_[near.column], beyond);
    }
    return distances_;
}

}  // namespace terrane
