// A vertical cut through the columns of a room, as pixels.
#pragma once

#include "client-sample/typescript/wasm/column_room.h"

#include <cstdint>
#include <vector>

namespace terrane {

/// The cut runs from (x0, z0) to (x1, z1) and from y0 up to y1, in voxels; a column stands at its
/// own coordinates. The first row of pixels is the lowest.
struct SectionLine {
    double x0 = 0;
    double z0 = 0;
    double x1 = 0;
    double z1 = 0;
    double y0 = 0;
    double y1 = 0;
    std::int32_t width = 0;
    std::int32_t height = 0;
};

/// Four bytes each: sRGB and 255, or 0 where it is hollow or unknown.
struct SectionPixels {
    std::vector<std::uint8_t> colors;
    /// The main material, the kind + 1 (0: unknown), the flow along the line and up, -127..127 +
    /// 128.
    std::vector<std::uint8_t> contents;
};

/// Overwrites `out`. Heights between columns are mixed where they have the same contents in the
/// same order; elsewhere the nearest column counts.
void draw_section(SectionPixels& out, const ColumnRoom& room, const SectionLine& line);

}  // namespace terrane
