#include "server/http/tiles3d.h"

#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "server/chunks/chunk_key.h"

#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

namespace terrane {
namespace {

// Members in the order in which they are written down here: easier to read for people.
using Json = nlohmann::ordered_json;

/// 3D Tiles' column-major matrix that turns x east, y north, z up at (0, 0) of the ellipsoid into
/// earth-centred metres: its radius there is 6,378,137 m.
constexpr std::array<double, 16> kAtLongitude0Latitude0 = {0, 1, 0, 0, 0,       0, 1, 0,
                                                           1, 0, 0, 0, 6378137, 0, 0, 1};

/// 2^n as a number; exact.
double power_of_2(std::int32_t n) {
    return static_cast<double>(std::int64_t{1} << n);
}

/// A tile's error: half as much at each level, a voxel at the last.
double error_m(const TilesetShape& shape, std::int32_t level) {
    return shape.voxel_size_m * power_of_2(shape.levels - 1 - level);
}

Json box_of(const TilesetShape& shape, const TileIndex& tile) {
    const double tile_m =
        shape.voxel_size_m * shape.side * power_of_2(shape.levels - 1 - tile.level);
    const double half_m = tile_m / 2;
    const double tiles = power_of_2(tile.level);
    const double x = (tile.x + 0.5 - tiles / 2) * tile_m;
    const double y = (tile.y + 0.5 - tiles / 2) * tile_m;
    const double half_height = shape.voxel_size_m * shape.height_voxels / 2;
    const double z = half_height - shape.voxel_size_m;
    return {{"box", {x, y, z, half_m, 0.0, 0.0, 0.0, half_m, 0.0, 0.0, 0.0, half_height}}};
}

Json asset_of(const TilesetShape& shape) {
    return {{"version", "1.1"}, {"tilesetVersion", to_hex(shape.fingerprint)}};
}

Json implicit_root(const TilesetShape& shape) {
    return {{"boundingVolume", box_of(shape, {})},
            {"geometricError", error_m(shape, 0)},
            {"refine", "REPLACE"},
            {"content", {{"uri", "content/{level}/{x}/{y}.glb"}}},
            {"implicitTiling",
             {{"subdivisionScheme", "QUADTREE"},
              {"subtreeLevels", kSubtreeLevels},
              {"availableLevels", shape.levels},
              {"subtrees", {{"uri", "subtrees/{level}/{x}/{y}.subtree"}}}}}};
}

std::string document(const TilesetShape& shape, std::int32_t level, Json root) {
    // What is missing if nothing of this tileset is drawn: more than its root's error.
    const Json json = {{"asset", asset_of(shape)},
                       {"geometricError", 2 * error_m(shape, level)},
                       {"root", std::move(root)}};
    return json.dump(2) + "\n";
}

std::string path_of(const TileIndex& tile) {
    return std::to_string(tile.level) + "/" + std::to_string(tile.x) + "/" + std::to_string(tile.y);
}

Result<void> check_subtree(const TilesetShape& shape, const TileIndex& tile) {
    if (auto checked = check_tile(shape, tile); !checked) {
        return checked;
    }
    if (tile.level % kSubtreeLevels != 0) {
        return fail(ErrorCode::out_of_range, "level " + std::to_string(tile.level) +
                                                 ": subtrees begin at every " +
                                                 std::to_string(kSubtreeLevels) + "rd level");
    }
    return {};
}

/// How an explicit tileset refers to others: from `explicit/`, or from `explicit/{level}/{x}/`.
struct Links {
    std::string content;
    std::string tilesets;
};

Links first_links() {
    return {.content = "../content/", .tilesets = ""};
}

Json explicit_tile(const TilesetShape& shape, const TileIndex& tile, std::int32_t levels,
                   const Links& links) {
    Json json = {{"boundingVolume", box_of(shape, tile)},
                 {"geometricError", error_m(shape, tile.level)},
                 {"refine", "REPLACE"}};
    if (levels == 0) {
        json["content"] = {{"uri", links.tilesets + path_of(tile) + ".json"}};
        return json;
    }
    json["content"] = {{"uri", links.content + path_of(tile) + ".glb"}};
    if (tile.level + 1 < shape.levels) {
        json["children"] = Json::array();
        for (std::int32_t i = 0; i < 4; ++i) {
            json["children"].push_back(explicit_tile(
                shape, {.level = tile.level + 1, .x = 2 * tile.x + i % 2, .y = 2 * tile.y + i / 2},
                levels - 1, links));
        }
    }
    return json;
}

}  // namespace

Hash128 served_content_id(Hash128 content_id, std::int32_t tileset_levels) {
    if (tileset_levels == kTilesetLevels) {
        return content_id;
    }
    Bytes bytes;
    ByteWriter out(bytes);
    out.fixed(content_id.high);
    out.fixed(content_id.low);
    out.fixed(tileset_levels);
    return hash128(bytes);
}

Result<void> check_tile(const TilesetShape& shape, const TileIndex& tile) {
    if (tile.level < 0 || tile.level >= shape.levels) {
        return fail(ErrorCode::out_of_range, "level " + std::to_string(tile.level) +
                                                 ": this tileset has 0 to " +
                                                 std::to_string(shape.levels - 1));
    }
    const std::int32_t tiles = 1 << tile.level;
    if (tile.x < 0 || tile.x >= tiles || tile.y < 0 || tile.y >= tiles) {
        return fail(ErrorCode::out_of_range, "tile " + std::to_string(tile.x) + "/" +
                                                 std::to_string(tile.y) + ": level " +
                                                 std::to_string(tile.level) + " has 0 to " +
                                                 std::to_string(tiles - 1) + " along each side");
    }
    return {};
}

TileKey tile_key_of(const TilesetShape& shape, const TileIndex& tile) {
    const std::int32_t lod = shape.levels - 1 - tile.level;
    if (tile.level == 0) {
        return {.position = {.lod = lod, .x = 0, .z = 0}, .centred = true};
    }
    const std::int32_t half = 1 << (tile.level - 1);
    return {.position = {.lod = lod, .x = tile.x - half, .z = half - 1 - tile.y}, .centred = false};
}

std::string tileset_json(const TilesetShape& shape) {
    return document(shape, 0, implicit_root(shape));
}

std::string tileset_geo_json(const TilesetShape& shape) {
    Json root = implicit_root(shape);
    root["transform"] = kAtLongitude0Latitude0;
    return document(shape, 0, std::move(root));
}

Result<Bytes> subtree_of(const TilesetShape& shape, const TileIndex& tile) {
    if (auto checked = check_subtree(shape, tile); !checked) {
        return tl::unexpected(checked.error());
    }
    const int has_children = tile.level + kSubtreeLevels < shape.levels ? 1 : 0;
    const Json json = {{"tileAvailability", {{"constant", 1}}},
                       {"contentAvailability", Json::array({{{"constant", 1}}})},
                       {"childSubtreeAvailability", {{"constant", has_children}}}};
    std::string text = json.dump();
    text.resize((text.size() + 7) / 8 * 8, ' ');
    Bytes bytes;
    ByteWriter out(bytes);
    out.raw(bytes_of("subt"));
    out.fixed(std::uint32_t{1});                         // version
    out.fixed(static_cast<std::uint64_t>(text.size()));  // of the JSON
    out.fixed(std::uint64_t{0});                         // of the binary part
    out.raw(bytes_of(text));
    return bytes;
}

Result<std::string> explicit_tileset_json(const TilesetShape& shape, const TileIndex& tile) {
    if (auto checked = check_subtree(shape, tile); !checked) {
        return tl::unexpected(checked.error());
    }
    const Links links = tile.level == 0
                            ? first_links()
                            : Links{.content = "../../../content/", .tilesets = "../../"};
    return document(shape, tile.level, explicit_tile(shape, tile, kSubtreeLevels, links));
}

std::string explicit_tileset_geo_json(const TilesetShape& shape) {
    Json root = explicit_tile(shape, {}, kSubtreeLevels, first_links());
    root["transform"] = kAtLongitude0Latitude0;
    return document(shape, 0, std::move(root));
}

}  // namespace terrane
