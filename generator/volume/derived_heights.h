// Heights that follow from the limits beside them: where intervals and blends begin.
#pragma once

#include "generator/volume/signatures.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace terrane {

inline constexpr std::int32_t kBlendMost = 256;

/// The paper's 4.3: a layer blends over its own local thickness times its blend value.
inline std::uint32_t blended(std::uint32_t bottom_bits, std::uint32_t top_bits,
                             std::int32_t blend) {
    const auto bottom = static_cast<std::int32_t>(bottom_bits);
    const auto top = static_cast<std::int32_t>(top_bits);
    const std::int64_t thickness = std::int64_t{top} - bottom;
    const std::int64_t end = bottom + std::max<std::int64_t>(1, (thickness * blend + 128) >> 8);
    return static_cast<std::uint32_t>(std::min<std::int64_t>(end, top));
}

/// `at` is a height of a slot that is derived, those of the slots beside it lie `distance` away.
inline std::uint32_t predicted_height(const std::uint32_t* at, std::size_t distance,
                                      const HeightSlot& slot) {
    const std::uint32_t bottom = *(at - distance);
    return slot.role == HeightRole::floor ? bottom : blended(bottom, at[distance], slot.blend);
}

}  // namespace terrane
