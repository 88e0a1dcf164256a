#include "server/http/tiles3d.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <set>
#include <string>

namespace terrane {
namespace {

using Json = nlohmann::json;

constexpr TilesetShape kShape = {.fingerprint = {.high = 1, .low = 2},
                                 .levels = 18,
                                 .side = 32,
                                 .voxel_size_m = 0.5,
                                 .height_voxels = 300};

TEST(Tiles3d, TheTilesetDescribesTheQuadtree) {
    const Json json = Json::parse(tileset_json(kShape));
    EXPECT_EQ(json["asset"]["version"], "1.1");
    EXPECT_EQ(json["asset"]["tilesetVersion"], to_hex(kShape.fingerprint));
    const Json& root = json["root"];
    EXPECT_EQ(root["geometricError"], 0.5 * 131072);
    EXPECT_GT(json["geometricError"].get<double>(), root["geometricError"].get<double>());
    EXPECT_EQ(root["refine"], "REPLACE");
    EXPECT_EQ(root["content"]["uri"], "content/{level}/{x}/{y}.glb");
    EXPECT_EQ(root["implicitTiling"]["subdivisionScheme"], "QUADTREE");
    EXPECT_EQ(root["implicitTiling"]["availableLevels"], 18);
    EXPECT_EQ(root["implicitTiling"]["subtreeLevels"], 3);
    EXPECT_EQ(root["implicitTiling"]["subtrees"]["uri"], "subtrees/{level}/{x}/{y}.subtree");
    const double half = 0.5 * 32 * 131072 / 2;
    EXPECT_EQ(root["boundingVolume"]["box"],
              Json({0.0, 0.0, 74.5, half, 0, 0, 0, half, 0, 0, 0, 75.0}));
    EXPECT_FALSE(root.contains("transform"));
}

TEST(Tiles3d, TheGeoTilesetIsTheSameLaidOnTheGlobe) {
    Json geo = Json::parse(tileset_geo_json(kShape));
    EXPECT_EQ(geo["root"]["transform"],
              Json({0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 6378137, 0, 0, 1}));
    geo["root"].erase("transform");
    EXPECT_EQ(geo, Json::parse(tileset_json(kShape)));
    Json first = Json::parse(explicit_tileset_geo_json(kShape));
    EXPECT_EQ(first["root"]["transform"][12], 6378137);
    first["root"].erase("transform");
    EXPECT_EQ(first, Json::parse(explicit_tileset_json(kShape, {}).value()));
}

TEST(Tiles3d, TilesAreStacksAroundTheOrigin) {
    EXPECT_EQ(tile_key_of(kShape, {}), (TileKey{.position = {17, 0, 0}, .centred = true}));
    EXPECT_EQ(tile_key_of(kShape, {.level = 1, .x = 0, .y = 0}),
              (TileKey{.position = {16, -1, 0}, .centred = false}));
    EXPECT_EQ(tile_key_of(kShape, {.level = 1, .x = 1, .y = 1}),
              (TileKey{.position = {16, 0, -1}, .centred = false}));
    // The leaf east and south of the origin: x and z grow.
    EXPECT_EQ(tile_key_of(kShape, {.level = 17, .x = 65536, .y = 65535}),
              (TileKey{.position = {0, 0, 0}, .centred = false}));
    EXPECT_EQ(tile_key_of(kShape, {.level = 17, .x = 65539, .y = 65530}),
              (TileKey{.position = {0, 3, 5}, .centred = false}));
}

TEST(Tiles3d, ChildrenLieInTheirParents) {
    for (std::int32_t level = 1; level + 1 < kShape.levels; ++level) {
        const std::int32_t last = (1 << level) - 1;
        for (const TileIndex tile : {TileIndex{level, 0, last}, TileIndex{level, last / 2, last}}) {
            const StackPos parent = tile_key_of(kShape, tile).position;
            for (std::int32_t i = 0; i < 4; ++i) {
                const StackPos child =
                    tile_key_of(kShape, {level + 1, 2 * tile.x + i % 2, 2 * tile.y + i / 2})
                        .position;
                EXPECT_EQ(floor_div(child.x, 2), parent.x);
                EXPECT_EQ(floor_div(child.z, 2), parent.z);
            }
        }
    }
}

TEST(Tiles3d, RefusesTilesThatThereAreNot) {
    for (const TileIndex bad : {TileIndex{-1, 0, 0}, TileIndex{18, 0, 0}, TileIndex{0, 1, 0},
                                TileIndex{3, 0, 8}, TileIndex{3, -1, 0}}) {
        const auto checked = check_tile(kShape, bad);
        ASSERT_FALSE(checked);
        EXPECT_EQ(checked.error().code, ErrorCode::out_of_range);
        EXPECT_FALSE(subtree_of(kShape, bad));
        EXPECT_FALSE(explicit_tileset_json(kShape, bad));
    }
    EXPECT_FALSE(subtree_of(kShape, {.level = 4, .x = 0, .y = 0}));
    EXPECT_FALSE(explicit_tileset_json(kShape, {.level = 17, .x = 0, .y = 0}));
}

TEST(Tiles3d, SubtreesAreBinaryAndEndAtTheLastLevel) {
    for (std::int32_t level = 0; level < 18; level += 3) {
        const Bytes bytes = subtree_of(kShape, {.level = level, .x = 0, .y = 0}).value();
        ByteReader in(bytes);
        EXPECT_EQ(text_of(*in.take(4)), "subt");
        EXPECT_EQ(in.fixed<std::uint32_t>(), 1U);
        const auto json_bytes = in.fixed<std::uint64_t>();
        EXPECT_EQ(in.fixed<std::uint64_t>(), 0U);
        EXPECT_EQ(*json_bytes % 8, 0U);
        ASSERT_EQ(in.remaining(), *json_bytes);
        const Json json = Json::parse(text_of(*in.take(*json_bytes)));
        EXPECT_EQ(json["tileAvailability"]["constant"], 1);
        EXPECT_EQ(json["contentAvailability"], Json::parse(R"([{"constant":1}])"));
        EXPECT_EQ(json["childSubtreeAvailability"]["constant"], level == 15 ? 0 : 1);
    }
}

/// Walks an explicit tile, counts what it refers to and checks boxes and errors on the way.
void walk(const Json& tile, std::multiset<std::string>& uris) {
    uris.insert(tile["content"]["uri"].get<std::string>());
    if (!tile.contains("children")) {
        return;
    }
    const Json& box = tile["boundingVolume"]["box"];
    for (const Json& child : tile["children"]) {
        const Json& inner = child["boundingVolume"]["box"];
        EXPECT_EQ(inner[3].get<double>() * 2, box[3].get<double>());
        EXPECT_EQ(std::abs(inner[0].get<double>() - box[0].get<double>()), inner[3].get<double>());
        EXPECT_EQ(std::abs(inner[1].get<double>() - box[1].get<double>()), inner[3].get<double>());
        EXPECT_EQ(inner[11], box[11]);
        EXPECT_EQ(child["geometricError"].get<double>() * 2, tile["geometricError"].get<double>());
        walk(child, uris);
    }
}

TEST(Tiles3d, ExplicitTilesetsHaveThreeLevelsAndLinkTheNext) {
    std::multiset<std::string> uris;
    walk(Json::parse(explicit_tileset_json(kShape, {}).value())["root"], uris);
    EXPECT_EQ(uris.size(), 1U + 4 + 16 + 64);
    EXPECT_TRUE(uris.contains("../content/0/0/0.glb"));
    EXPECT_TRUE(uris.contains("../content/2/3/1.glb"));
    EXPECT_TRUE(uris.contains("3/7/0.json"));
    uris.clear();
    walk(Json::parse(explicit_tileset_json(kShape, {.level = 3, .x = 7, .y = 0}).value())["root"],
         uris);
    EXPECT_TRUE(uris.contains("../../../content/3/7/0.glb"));
    EXPECT_TRUE(uris.contains("../../../content/5/31/3.glb"));
    EXPECT_TRUE(uris.contains("../../6/63/7.json"));
    uris.clear();
    walk(Json::parse(explicit_tileset_json(kShape, {.level = 15, .x = 0, .y = 0}).value())["root"],
         uris);
    EXPECT_EQ(uris.size(), 1U + 4 + 16) << "the last tileset ends with the leaves";
}

}  // namespace
}  // namespace terrane
