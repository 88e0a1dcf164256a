// OGC 3D Tiles 1.1: the world as a quadtree of GLB tiles that any such viewer can walk.
//
// A tile is a whole stack at one level of detail: every height, level 0 volumetric, coarser levels
// height fields. With L levels, tile level t has 2^t tiles a side and is level of detail L - 1 - t.
// The quadtree has the world's column (0, 0) in its middle, so the root, which no stack is, is a
// square of a stack's size around it (TileKey::centred).
//
// 3D Tiles are z up: world (x, y, z) is (x, -z, y) there, so tile y counts against z. At tile level
// t > 0, stack x is tile x - 2^(t-1) and stack z is 2^(t-1) - 1 - tile y.
//
// Two ways to the same tiles: one implicit tileset, and explicit ones three levels at a time for
// clients that expand an implicit tree whole before they look.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "server/chunks/chunk_key.h"

#include <cstdint>
#include <string>

namespace terrane {

/// Levels of a subtree file, and of an explicit tileset.
inline constexpr std::int32_t kSubtreeLevels = 3;
/// Of a quadtree, unless a setting says fewer: as many as can be generated, so that the tiles reach
/// as far as the coordinates of 3D Tiles' clients do.
inline constexpr std::int32_t kTilesetLevels = levels_supported() / kSubtreeLevels * kSubtreeLevels;

/// What /v1/w/{W} names: the world, and the numbering of its tiles where that is not the usual. So
/// no URL ever means two things, whatever a server is set to.
Hash128 served_content_id(Hash128 content_id, std::int32_t tileset_levels);

/// What the documents need to know of a world.
struct TilesetShape {
    Hash128 fingerprint;
    std::int32_t levels = kTilesetLevels;  ///< a multiple of kSubtreeLevels, at most that
    std::int32_t side = 32;                ///< columns of a stack
    double voxel_size_m = 1;
    std::int32_t height_voxels = 0;  ///< a tile's box is y -1 .. height_voxels - 1
};

/// A tile of the quadtree, as 3D Tiles number them.
struct TileIndex {
    std::int32_t level = 0;
    std::int32_t x = 0;
    std::int32_t y = 0;

    friend bool operator==(const TileIndex&, const TileIndex&) = default;
};

/// Fails with `out_of_range` for a tile that there is not.
Result<void> check_tile(const TilesetShape& shape, const TileIndex& tile);

/// What to ask the service for. Needs a tile that check_tile accepts.
TileKey tile_key_of(const TilesetShape& shape, const TileIndex& tile);

/// The implicit tileset, in metres around column (0, 0).
std::string tileset_json(const TilesetShape& shape);

/// The same, laid on the globe at longitude 0, latitude 0: east is x, north is -z, up is y.
std::string tileset_geo_json(const TilesetShape& shape);

/// The binary subtree whose root is `tile`. Fails with `out_of_range` where no subtree begins.
Result<Bytes> subtree_of(const TilesetShape& shape, const TileIndex& tile);

/// The explicit tileset whose root is `tile`: kSubtreeLevels levels and links to those below. Its
/// own URL is `explicit/{level}/{x}/{y}.json`, and `explicit/tileset.json` for the first. Fails
/// with `out_of_range` where no subtree begins.
Result<std::string> explicit_tileset_json(const TilesetShape& shape, const TileIndex& tile);

/// The first explicit tileset laid on the globe; it links to the same ones below.
std::string explicit_tileset_geo_json(const TilesetShape& shape);

}  // namespace terrane
