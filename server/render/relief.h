// Hill shading: a raster of heights and colours becomes a picture seen from above.
//
// Source: the sum of soft lights from several directions is that of R. Mark, "Multidirectional,
// oblique-weighted, shaded-relief image", USGS Open-File Report 92-422, 1992. Added are the shadow
// that a hill throws, less light of the sky in hollows than on ridges, and a tint by slope and
// height. All sums are made in linear light, only with + - * / and sqrt, so that a picture is the
// same on every machine.
#pragma once

#include "generator/world/composition.h"
#include "server/render/png.h"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {

/// Pixels around a picture that its shading looks at.
inline constexpr std::int32_t kReliefApron = 24;

/// Samples, row by row, north (-z) first: 2^detail a pixel along each side, and kReliefApron pixels
/// more all around.
struct Relief {
    std::int32_t width = 0;   ///< pixels of the picture
    std::int32_t height = 0;  ///< likewise
    std::int32_t detail = 0;
    float step_voxels = 1;       ///< from one sample to the next
    float bound_voxels = 1;      ///< no height is above
    std::vector<float> heights;  ///< voxels
    std::vector<LinearColor> colors;

    std::int32_t columns() const { return (width + 2 * kReliefApron) << detail; }

    std::int32_t rows() const { return (height + 2 * kReliefApron) << detail; }

    std::size_t index_of(std::int32_t x, std::int32_t y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(columns()) +
               static_cast<std::size_t>(x);
    }
};

/// Draws the picture into `out`, whose pixel (x0, y0) is its first; `out` is large enough.
void shade_relief(Image& out, std::int32_t x0, std::int32_t y0, const Relief& relief);

}  // namespace terrane
