// Pictures of terrain: a pinhole camera over a scene.
#pragma once

#include "generator/terrain/world.h"
#include "protocol/base/result.h"
#include "server/render/draw_pieces.h"
#include "server/render/png.h"
#include "server/render/scene.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <optional>

namespace terrane {

/// Where to stand and what to look at, in voxels of the world.
struct PictureView {
    glm::dvec3 eye{};
    glm::dvec3 look{};
    std::int32_t width = 1280;         ///< pixels
    std::int32_t height = 720;         ///< pixels
    double field_of_view = 55;         ///< degrees, of the picture's longer side
    std::optional<ColumnBlock> block;  ///< draw this block alone, cut out of the terrain
};

/// Draws with `threads` >= 1 threads; the pixels do not depend on how many. Fails with
/// `invalid_argument` when eye and look are one place, the eye is inside the ground or the block
/// has no or too large an area, `out_of_range` for an eye at or beyond the world's edge,
/// `too_large` for a picture above make_image's limits. Tells of rows.
Result<Image> render_picture(const World& world, const PictureView& view, std::int32_t threads,
                             const TellDrawn& tell = {});

}  // namespace terrane
