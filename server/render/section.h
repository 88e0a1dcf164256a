// Sections: pictures of vertical cuts. Colours are mixed by composition in linear light, blends run
// smoothly, veins and caves stand out, above it all is the sky. Frontiers run straight from column
// to column and are drawn with soft edges.
#pragma once

#include "protocol/base/result.h"
#include "server/render/drawing.h"
#include "server/render/picture_keys.h"
#include "server/render/png.h"

#include <cstdint>

namespace terrane {

inline constexpr std::int32_t kSectionScaleMax = 64;
inline constexpr std::int64_t kSectionHeightMax = 32768;  ///< voxels

/// Fails with `too_large` for a line of more columns than a picture may be wide, and `out_of_range`
/// for a scale or height that no picture can have.
Result<void> check_section(const Section& section);

/// Fails as check_section does, with `too_large` when the picture would be, `out_of_range` when a
/// column is, and `cancelled` when the drawing is stopped.
Result<Image> draw_section(const Drawing& drawing, const Section& section);

}  // namespace terrane
