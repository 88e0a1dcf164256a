// The commented world file that `terrane world init` writes.
#pragma once

#include <string_view>

namespace terrane {

/// A world file that has no faults; it explains every key.
std::string_view example_world();

}  // namespace terrane
