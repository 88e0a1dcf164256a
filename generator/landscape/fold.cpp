#include "generator/landscape/fold.h"

#include "generator/landscape/numbers.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/random.h"
#include "generator/world/world_definition.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace terrane {
namespace {

/// Columns to turns as 0.64 fixed point; negative ones wrap around.
std::uint64_t turns_a_column(double share) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(share * 0x1p62)) * 4U;
}

float fold_of(const FoldConstants& constants, std::uint64_t phase, float wander) {
    const float turns = static_cast<float>(static_cast<std::uint32_t>(phase >> 40U)) * 0x1p-24F;
    return constants.amplitude *
           (0.7F * sin_turn(wrap_turn(turns + 0.6F * wander)) + 0.6F * wander);
}

std::uint64_t phase_at(const FoldConstants& constants, std::int64_t x, std::int64_t z) {
    return static_cast<std::uint64_t>(x) * constants.turns_x +
           static_cast<std::uint64_t>(z) * constants.turns_z;
}

}  // namespace

FoldConstants::FoldConstants(const WorldDefinition& definition)
    : amplitude(static_cast<float>(definition.structure.fold)),
      noise(Noise::make(key(definition.seed, LandscapeTag::fold, 1),
                        2 * definition.structure.fold_length, 2)) {
    const Direction across = direction_of(definition.structure.fold_direction);
    turns_x = turns_a_column(across.x / definition.structure.fold_length);
    turns_z = turns_a_column(across.z / definition.structure.fold_length);
}

float fold_at(const FoldConstants& constants, std::int64_t x, std::int64_t z) {
    if (constants.amplitude == 0) {
        return 0;
    }
    return fold_of(constants, phase_at(constants, x, z), noise_at(constants.noise, x, z));
}

void fold_rectangle(float* out, const FoldConstants& constants, const RectangleShape& shape,
                    const RowKernels& kernels, NoiseBuffers& buffers) {
    if (constants.amplitude == 0) {
        std::fill_n(out, shape.padded_size(), 0.0F);
        return;
    }
    noise_rectangle(out, constants.noise, shape, kernels, buffers);
    const std::uint64_t step = static_cast<std::uint64_t>(shape.step);
    for (std::int32_t row = 0; row < shape.length; ++row) {
        std::uint64_t phase = phase_at(constants, shape.x0, shape.z0 + row * shape.step);
        float* const values = out + static_cast<std::ptrdiff_t>(row) * shape.stride();
        for (std::int32_t i = 0; i < shape.width; ++i) {
            values[i] = fold_of(constants, phase, values[i]);
            phase += step * constants.turns_x;
        }
    }
}

}  // namespace terrane
