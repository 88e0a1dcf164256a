// The version of the generator: part of every world's name.
#pragma once

#include <cstdint>

namespace terrane {

/// Raised whenever the same world file gives other limits.
inline constexpr std::uint32_t kGeneratorVersion = 1;

}  // namespace terrane
