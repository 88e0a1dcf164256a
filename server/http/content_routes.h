// The routes to what is made of a world beside chunks: 3D Tiles, maps and sections, textures.
#pragma once

#include "server/http/core_routes.h"
#include "server/http/router.h"
#include "server/http/tiles3d.h"

#include <cstdint>

namespace terrane {

/// Pictures wait behind every chunk.
inline constexpr std::int32_t kPicturePriority = -8;
/// A section's pixels at the most: 25 MB while it is drawn.
inline constexpr std::int64_t kSectionPixelsMax = std::int64_t{1} << 23;
inline constexpr std::int64_t kSectionColumnsMax = 8192;

TilesetShape tileset_shape_of(const World& world, std::int32_t levels);

/// 3dtiles/tileset.json, tileset-geo.json, content, subtrees, explicit, all under the content id.
void add_tiles3d_routes(Router& router, const RouteContext& context);
/// map/{zoom}/{x}/{y}.png and sections/{x0},{z0}/{x1},{z1}.png?height=&scale=.
void add_picture_routes(Router& router, const RouteContext& context);
/// textures/{name}.
void add_texture_routes(Router& router, const RouteContext& context);

}  // namespace terrane
