// The version of the generator: part of every world's name.
#pragma once

#include <cstdint>

namespace terrane {

/// Raised whenever the same world file gives other limits than in the release before. There is none
/// before 0.1.0: until then a store made by an older build is to be deleted.
inline constexpr std::uint32_t kGeneratorVersion = 1;

}  // namespace terrane
