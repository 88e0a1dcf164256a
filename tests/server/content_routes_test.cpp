// 3D Tiles, pictures, textures and the API's description, over HTTP from whole servers.
#include "server/http/content_routes.h"

#include "generator/mesh/glb.h"
#include "server/chunks/build_chunk.h"
#include "server/http/openapi.h"
#include "server/server.h"
#include "tests/server/http_client.h"
#include "tests/storage/temporary_folder.h"
#include "tests/support/test_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <set>

namespace terrane {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::json;
using testing::HasSubstr;

constexpr std::string_view kTextureBytes = "\x89PNG not a real one";

/// paper-B2 with a texture.
std::shared_ptr<const World> textured_world() {
    const auto plain = load_shipped_world("paper-B2");
    WorldDefinition definition = plain->definition;
    definition.materials.back().texture = "moss.png";
    const auto bytes = bytes_of(kTextureBytes);
    definition.textures.push_back({.name = "moss.png", .bytes = {bytes.begin(), bytes.end()}});
    return std::make_shared<const World>(World::build(std::move(definition)).value());
}

struct Running {
    explicit Running(const std::filesystem::path& data = {},
                     std::int32_t tileset_levels = kTilesetLevels) {
        options.tileset_levels = tileset_levels;
        options.world = textured_world();
        options.listen.endpoint = {.address = "127.0.0.1", .port = 0};
        options.http = Endpoint{.address = "127.0.0.1", .port = 0};
        options.listen.tick = 20ms;
        options.workers = 2;
        options.store = data.empty() ? StoreKind::memory : StoreKind::rocksdb;
        options.data_directory = data;
        auto started = Server::start(options, log);
        if (!started) {
            ADD_FAILURE() << started.error().message;
            std::abort();
        }
        server = *std::move(started);
        prefix =
            "/v1/w/" + to_hex(served_content_id(content_id_of(*options.world), tileset_levels));
        client = std::make_unique<HttpClient>(server->http_endpoint()->port);
    }

    HttpReply get(const std::string& path, std::string_view headers = {}) const {
        const auto reply = client->get(path, headers);
        EXPECT_TRUE(reply) << path;
        return reply.value_or(HttpReply{});
    }

    HttpReply content(const std::string& path) const { return get(prefix + path); }

    ServerOptions options;
    const Log log{LogFormat::text, LogLevel::error};
    std::unique_ptr<Server> server;
    std::string prefix;
    std::unique_ptr<HttpClient> client;
};

/// Every path of the server's own description, its names replaced by their examples.
std::vector<std::string> described_urls(const Running& r) {
    const Json document = Json::parse(r.get("/v1/openapi.json").body);
    std::vector<std::string> urls;
    for (const auto& [path, item] : document["paths"].items()) {
        std::string url = path;
        for (const Json& parameter : item["get"].value("parameters", Json::array())) {
            if (parameter["in"] != "path") {
                continue;
            }
            const std::string name = "{" + parameter["name"].get<std::string>() + "}";
            const Json example = parameter["schema"].value("examples", Json({"moss.png"}))[0];
            EXPECT_THAT(url, HasSubstr(name));
            url.replace(url.find(name), name.size(),
                        example.is_string() ? example.get<std::string>() : example.dump());
        }
        urls.push_back(url);
    }
    return urls;
}

TEST(ContentRoutes, ASmallerTilesetHasOtherUrlsAndTheSameGround) {
    const Running usual;
    const Running small({}, 9);
    EXPECT_NE(usual.prefix, small.prefix) << "no URL means two things";
    EXPECT_EQ(small.get(usual.prefix + "/3dtiles/tileset.json").status, 404U);
    EXPECT_EQ(Json::parse(small.get("/v1/world").body)["tileset_levels"], 9);
    const Json root = Json::parse(small.content("/3dtiles/tileset.json").body)["root"];
    EXPECT_EQ(root["implicitTiling"]["availableLevels"], 9);
    EXPECT_EQ(small.content("/3dtiles/content/0/0/0.glb").status, 200U);
    EXPECT_EQ(small.content("/3dtiles/content/9/0/0.glb").status, 400U);
    EXPECT_EQ(small.content("/3dtiles/subtrees/6/31/32.subtree").status, 200U);
    // The leaf south east of the origin.
    const HttpReply leaf = small.content("/3dtiles/content/8/128/127.glb");
    EXPECT_EQ(leaf.status, 200U);
    EXPECT_EQ(leaf.body, usual.content("/3dtiles/content/17/65536/65535.glb").body);
}

TEST(OpenApi, DescribesEveryRouteOfTheTableAndNoOther) {
    // What the server's own router has, viewer files apart.
    RouteContext context;
    const auto world = textured_world();
    const ServerHello hello;
    context.world = world.get();
    context.hello = &hello;
    context.world_file = "a world";
    Router router(content_id_of(*world));
    add_chunk_routes(router, context);
    add_world_routes(router, context);
    add_state_routes(router, context);
    add_tiles3d_routes(router, context);
    add_picture_routes(router, context);
    add_texture_routes(router, context);
    add_openapi_route(router, 9);
    add_viewer_routes(router, {});
    std::set<std::string> table;
    for (const std::string& path : router.paths()) {
        table.insert(path == "/index.html" ? "/" : path);
    }
    const Json document = Json::parse(openapi_json(router, 9));
    std::set<std::string> documented;
    for (const auto& [path, item] : document["paths"].items()) {
        documented.insert(path);
    }
    EXPECT_EQ(documented, table);
    const Json& tile = document["paths"]["/v1/w/{W}/3dtiles/content/{level}/{x}/{y}.glb"];
    const Json& parameters = tile["get"]["parameters"];
    const auto level = std::find_if(parameters.begin(), parameters.end(),
                                    [](const Json& one) { return one["name"] == "level"; });
    ASSERT_NE(level, parameters.end());
    EXPECT_EQ((*level)["schema"]["maximum"], 8);
    const auto all = described_paths();
    EXPECT_EQ(std::set<std::string>(all.begin(), all.end()), table);
}

TEST(OpenApi, TheServersOwnDocumentHasEveryPath) {
    const Running r;
    const Json document = Json::parse(r.get("/v1/openapi.json").body);
    EXPECT_EQ(document["openapi"], "3.1.0");
    std::set<std::string> documented;
    for (const auto& [path, item] : document["paths"].items()) {
        documented.insert(path);
    }
    const auto all = described_paths();
    EXPECT_EQ(documented, std::set<std::string>(all.begin(), all.end()));
}

TEST(OpenApi, EveryDescribedUrlAnswersAsDescribed) {
    const Running r;
    const Json document = Json::parse(r.get("/v1/openapi.json").body);
    std::size_t i = 0;
    const auto urls = described_urls(r);
    for (const auto& [path, item] : document["paths"].items()) {
        const std::string& url = urls[i++];
        const HttpReply reply = r.get(url);
        EXPECT_EQ(reply.status, 200U) << url << ": " << reply.body;
        const std::string type = reply.header("content-type");
        const Json& content = item["get"]["responses"]["200"]["content"];
        EXPECT_TRUE(content.contains(type.substr(0, type.find(';')))) << url << ": " << type;
        EXPECT_EQ(reply.header("access-control-allow-origin"), "*") << url;
    }
}

TEST(ContentRoutes, WhatIsKnownIsNotSentAgain) {
    const Running r;
    std::size_t conditional = 0;
    for (const std::string& url : described_urls(r)) {
        const HttpReply first = r.get(url);
        const std::string etag = first.header("etag");
        if (etag.empty()) {
            continue;
        }
        ++conditional;
        EXPECT_FALSE(etag.starts_with("W/")) << "strong";
        const HttpReply again = r.get(url, "If-None-Match: " + etag + "\r\n");
        EXPECT_EQ(again.status, 304U) << url;
        EXPECT_TRUE(again.body.empty()) << url;
        EXPECT_EQ(again.header("etag"), etag) << url;
        if (url.starts_with("/v1/w/")) {
            EXPECT_EQ(first.header("cache-control"), "public, max-age=31536000, immutable") << url;
        }
    }
    EXPECT_GE(conditional, 16U);
}

std::vector<std::string> sample_paths() {
    return {"/3dtiles/tileset.json",
            "/3dtiles/tileset-geo.json",
            "/3dtiles/subtrees/3/1/2.subtree",
            "/3dtiles/subtrees/15/16384/16383.subtree",
            "/3dtiles/explicit/tileset.json",
            "/3dtiles/explicit/15/16384/16383.json",
            "/3dtiles/content/0/0/0.glb",
            "/3dtiles/content/9/256/255.glb",
            "/3dtiles/content/17/65536/65535.glb",
            "/3dtiles/content/17/65530/65535.glb",
            "/chunks/0/0/2/0.glb",
            "/chunks/4/-1/0/0.glb",
            "/chunks/0/0/2/0.drc",
            "/columns/5/-5.json",
            "/map/18/131072/131071.png",
            "/map/12/2048/2047.png",
            "/sections/-20,3/20,-9.png?scale=3&height=90",
            "/sections/0,0/50,0.png",
            "/textures/moss.png",
            "/world.toml"};
}

std::vector<std::string> bodies_of(const Running& r) {
    std::vector<std::string> bodies;
    for (const std::string& path : sample_paths()) {
        const HttpReply reply = r.content(path);
        EXPECT_EQ(reply.status, 200U) << path << reply.body;
        bodies.push_back(reply.header("etag") + reply.body);
    }
    return bodies;
}

TEST(ContentRoutes, EveryUrlUnderTheContentIdIsTheSameAfterARestart) {
    const TemporaryFolder folder;
    std::vector<std::string> first;
    {
        const Running r(folder.path());
        first = bodies_of(r);
    }
    const Running from_store(folder.path());
    EXPECT_EQ(bodies_of(from_store), first) << "from the store";
    const Running anew;
    EXPECT_EQ(bodies_of(anew), first) << "made anew";
}

TEST(ContentRoutes, QueryStringsOfTilesAreIgnored) {
    const Running r;
    EXPECT_EQ(r.content("/3dtiles/content/5/16/15.glb?v=1.2").body,
              r.content("/3dtiles/content/5/16/15.glb").body);
    EXPECT_EQ(r.content("/3dtiles/tileset.json?v=abc").status, 200U);
}

TEST(ContentRoutes, ATileIsMadeOnceAndThenCached) {
    const Running r;
    const auto generations = [&] { return count_of(r.server->counters().generations); };
    const std::uint64_t before = generations();
    for (int i = 0; i < 3; ++i) {
        const HttpReply reply = r.content("/3dtiles/content/17/65540/65530.glb");
        EXPECT_EQ(reply.status, 200U);
        EXPECT_EQ(reply.header("content-type"), "model/gltf-binary");
    }
    EXPECT_EQ(generations(), before + 1);
}

TEST(ContentRoutes, RefuseWhatThereIsNot) {
    const Running r;
    for (const char* path :
         {"/3dtiles/content/18/0/0.glb", "/3dtiles/content/3/8/0.glb",
          "/3dtiles/content/3/-1/0.glb", "/3dtiles/content/3/x/0.glb",
          "/3dtiles/subtrees/1/0/0.subtree", "/3dtiles/explicit/4/0/0.json", "/map/19/0/0.png",
          "/map/2/4/0.png", "/map/2/01/0.png", "/sections/0,0/9000,0.png",
          "/sections/0,0/9007199254740992,0.png", "/sections/0,0/5,0.png?scale=65",
          "/sections/0,0/5,0.png?scale=-1", "/sections/0,0/5,0.png?height=0",
          "/sections/0,0/8000,0.png?scale=8"}) {
        const HttpReply reply = r.content(path);
        EXPECT_EQ(reply.status, 400U) << path;
        EXPECT_EQ(reply.header("content-type"), "application/problem+json") << path;
        EXPECT_GT(Json::parse(reply.body)["detail"].get<std::string>().size(), 10U) << path;
    }
    for (const char* path : {"/textures/none.png", "/sections/0,0.png", "/3dtiles/", "/map/1/0.png",
                             "/3dtiles/content/3/1/1.b3dm"}) {
        EXPECT_EQ(r.content(path).status, 404U) << path;
    }
}

TEST(ContentRoutes, TexturesAreTheFilesBytes) {
    const Running r;
    const HttpReply reply = r.content("/textures/moss.png");
    EXPECT_EQ(reply.body, kTextureBytes);
    EXPECT_EQ(reply.header("content-type"), "image/png");
}

TEST(ContentRoutes, UnversionedPathsRedirectWithTheirQuery) {
    const Running r;
    const HttpReply reply = r.get("/v1/sections/0,0/9,0.png?scale=2");
    EXPECT_EQ(reply.status, 307U);
    EXPECT_EQ(reply.header("location"), r.prefix + "/sections/0,0/9,0.png?scale=2");
    EXPECT_EQ(r.get("/v1/3dtiles/tileset.json").status, 307U);
}

}  // namespace
}  // namespace terrane
