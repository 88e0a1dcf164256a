// Maps: the world seen from above, with the colours of what is on top and hill shading.
//
// Tiles are numbered as in slippy maps: 2^zoom a side, x to the east, y to the south (z grows to
// the south). Column (0, 0) is the north-west corner of tile (2^(zoom - 1), 2^(zoom - 1)); at zoom
// 0 it is in the middle of the only tile. At the deepest zoom a pixel is a column, at each zoom
// above twice as many a side.
#pragma once

#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/render/draw_pieces.h"
#include "server/render/drawing.h"
#include "server/render/picture_keys.h"
#include "server/render/png.h"

#include <cstdint>

namespace terrane {

inline constexpr std::int32_t kMapZoomMax = 18;
inline constexpr std::int32_t kMapTilePixels = 256;

/// Fails with `out_of_range` for a zoom or tile that there is not.
Result<void> check_map_tile(const MapTile& tile);

/// The column at the tile's north-west corner. Needs a tile that check_map_tile accepts.
ColumnPos first_column_of(const MapTile& tile);

/// `width` x `height` pixels from column `first` on, 2^lod columns a pixel.
struct MapArea {
    ColumnPos first;
    std::int32_t width = 0;
    std::int32_t height = 0;
    std::int32_t lod = 0;  ///< 0..kMapZoomMax
};

/// Draws any area; a tile is one. Neighbouring areas fit. Fails with `too_large` beyond
/// make_image's limits, `out_of_range` when a column is, `cancelled` when the drawing is stopped.
Result<Image> draw_map(const Drawing& drawing, const MapArea& area);

/// The same with `threads` >= 1 threads that share the blocks of the picture; the pixels do not
/// depend on how many. `internal`: there is no memory or no such thread. Tells of blocks.
Result<Image> draw_map(const World& world, const MapArea& area, std::int32_t threads,
                       const TellDrawn& tell = {});

Result<Image> draw_map_tile(const Drawing& drawing, const MapTile& tile);

}  // namespace terrane
