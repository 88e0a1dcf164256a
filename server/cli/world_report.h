// What `terrane world show` says about a built world.
#pragma once

#include "generator/terrain/world.h"

#include <string>

namespace terrane {

/// For people: general facts, then the layer stack as a table, the surface on top.
std::string world_report_text(const World& world);

/// For programs: one JSON object; layers bottom first, lengths in voxels.
std::string world_report_json(const World& world);

}  // namespace terrane
