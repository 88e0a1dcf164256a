// Names of the pictures that can be asked for. Values; what they mean and their bounds are in
// map_tile.h and section.h.
#pragma once

#include "protocol/base/coords.h"

#include <compare>
#include <cstdint>

namespace terrane {

/// A square of the map seen from above: 2^zoom tiles a side, x to the east, y to the south.
struct MapTile {
    std::int32_t zoom = 0;
    std::int32_t x = 0;
    std::int32_t y = 0;

    friend auto operator<=>(const MapTile&, const MapTile&) = default;
};

/// A vertical cut along a line, both ends included.
struct Section {
    ColumnPos from;
    ColumnPos to;
    std::int32_t height_voxels = 0;  ///< of the picture from y = 0 up; 0 for all there is
    std::int32_t scale = 0;          ///< pixels a voxel; 0 to choose one that fits a screen

    friend auto operator<=>(const Section&, const Section&) = default;
};

}  // namespace terrane
