#include "server/http/openapi.h"

#include "protocol/base/coords.h"
#include "server/chunks/chunk_key.h"
#include "server/http/http_message.h"
#include "server/http/router.h"
#include "server/render/map_tile.h"
#include "server/render/section.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace terrane {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kOwnPath = "/v1/openapi.json";

struct Described {
    std::string_view path;  ///< versioned ones without "/v1/w/{W}"
    bool versioned = true;
    std::string_view tag;
    std::string_view summary;
    std::string_view content_type;
    /// Query parameters, by name.
    std::array<std::string_view, 2> query = {};
    bool asks_service = false;  ///< may be busy
    bool needs_token = true;
};

constexpr std::array kDescribed = {
    Described{.path = "/",
              .versioned = false,
              .tag = "server",
              .summary = "The viewer, or a page that links to this interface",
              .content_type = "text/html",
              .needs_token = false},
    Described{.path = "/healthz",
              .versioned = false,
              .tag = "server",
              .summary = "200 while the process lives",
              .content_type = "text/plain",
              .needs_token = false},
    Described{.path = "/readyz",
              .versioned = false,
              .tag = "server",
              .summary = "200 while requests are accepted, 503 when draining",
              .content_type = "text/plain",
              .needs_token = false},
    Described{.path = "/metrics",
              .versioned = false,
              .tag = "server",
              .summary = "Counters and histograms in Prometheus' text format",
              .content_type = "text/plain"},
    Described{.path = kOwnPath,
              .versioned = false,
              .tag = "server",
              .summary = "This document",
              .content_type = "application/json"},
    Described{.path = "/v1/world",
              .versioned = false,
              .tag = "world",
              .summary = "The world: name, content id, sizes, levels, materials, links",
              .content_type = "application/json"},
    Described{.path = "/world.toml",
              .tag = "world",
              .summary = "The canonical world file, if the server publishes it",
              .content_type = "application/toml"},
    Described{.path = "/textures/{name}",
              .tag = "world",
              .summary = "A texture that the world's materials name",
              .content_type = "image/png"},
    Described{.path = "/chunks/{lod}/{x}/{y}/{z}.drc",
              .tag = "chunks",
              .summary = "A chunk's smooth mesh as Draco",
              .content_type = "application/octet-stream",
              .asks_service = true},
    Described{.path = "/chunks/{lod}/{x}/{y}/{z}.blocky.drc",
              .tag = "chunks",
              .summary = "A level-0 chunk's mesh of blocks as Draco",
              .content_type = "application/octet-stream",
              .asks_service = true},
    Described{.path = "/chunks/{lod}/{x}/{y}/{z}.glb",
              .tag = "chunks",
              .summary = "A chunk's smooth mesh as binary glTF with Draco inside",
              .content_type = "model/gltf-binary",
              .asks_service = true},
    Described{.path = "/chunks/{lod}/{x}/{y}/{z}.columns",
              .tag = "chunks",
              .summary = "A chunk's limits, in Terrane's own coding; with `flow=0` without flow",
              .content_type = "application/octet-stream",
              .query = {"flow"},
              .asks_service = true},
    Described{.path = "/columns/{x}/{z}.json",
              .tag = "chunks",
              .summary = "One column's limits with composition and flow, bottom first",
              .content_type = "application/json",
              .asks_service = true},
    Described{.path = "/sections/{x0},{z0}/{x1},{z1}.png",
              .tag = "pictures",
              .summary = "A vertical cut along a line, both ends included",
              .content_type = "image/png",
              .query = {"height", "scale"},
              .asks_service = true},
    Described{.path = "/map/{zoom}/{x}/{y}.png",
              .tag = "pictures",
              .summary = "256 x 256 pixels of the hill-shaded map, numbered as slippy maps are",
              .content_type = "image/png",
              .asks_service = true},
    Described{.path = "/3dtiles/tileset.json",
              .tag = "3d-tiles",
              .summary = "The implicit tileset, metres around column (0, 0)",
              .content_type = "application/json"},
    Described{.path = "/3dtiles/tileset-geo.json",
              .tag = "3d-tiles",
              .summary = "The same laid on the globe at longitude 0, latitude 0",
              .content_type = "application/json"},
    Described{.path = "/3dtiles/content/{level}/{x}/{y}.glb",
              .tag = "3d-tiles",
              .summary = "A tile's content",
              .content_type = "model/gltf-binary",
              .asks_service = true},
    Described{.path = "/3dtiles/subtrees/{level}/{x}/{y}.subtree",
              .tag = "3d-tiles",
              .summary = "A binary subtree; they begin at every third level",
              .content_type = "application/octet-stream"},
    Described{.path = "/3dtiles/explicit/tileset.json",
              .tag = "3d-tiles",
              .summary = "The first explicit tileset, for clients that expand implicit ones whole",
              .content_type = "application/json"},
    Described{.path = "/3dtiles/explicit/tileset-geo.json",
              .tag = "3d-tiles",
              .summary = "The same laid on the globe",
              .content_type = "application/json"},
    Described{.path = "/3dtiles/explicit/{level}/{x}/{y}.json",
              .tag = "3d-tiles",
              .summary = "The explicit tileset whose root is this tile",
              .content_type = "application/json"},
};

std::string full_path(const Described& route) {
    return (route.versioned ? "/v1/w/{W}" : "") + std::string(route.path);
}

Json integer(std::int64_t least, std::int64_t most, std::int64_t example) {
    return {{"type", "integer"},
            {"minimum", least},
            {"maximum", most},
            {"examples", Json::array({example})}};
}

/// What the document says of the world that is served.
struct OpenApiContext {
    std::string content_id;
    std::int32_t tileset_levels = 0;
};

/// What a name of a path or query may be.
Json schema_of(std::string_view name, const Described& route, const OpenApiContext& context) {
    constexpr std::int64_t kInt32Min = std::numeric_limits<std::int32_t>::min();
    constexpr std::int64_t kInt32Max = std::numeric_limits<std::int32_t>::max();
    constexpr std::int64_t kColumnMax = kColumnCoordinateLimit - 1;
    if (name == "W") {
        return {{"type", "string"},
                {"pattern", "^[0-9a-f]{32}$"},
                {"examples", Json::array({context.content_id})}};
    }
    if (name == "name") {
        return {{"type", "string"}};
    }
    if (name == "lod") {
        return integer(0, levels_supported() - 1, 0);
    }
    if (name == "level") {
        return integer(0, context.tileset_levels - 1, 0);
    }
    if (name == "zoom") {
        return integer(0, kMapZoomMax, 0);
    }
    if (name == "height") {
        return integer(1, kSectionHeightMax, 100);
    }
    if (name == "scale") {
        return integer(1, kSectionScaleMax, 2);
    }
    if (name == "flow") {
        return integer(0, 1, 1);
    }
    if (route.tag == "chunks" && route.path.starts_with("/chunks/")) {
        return integer(kInt32Min, kInt32Max, 0);
    }
    if (route.tag == "3d-tiles" || route.path.starts_with("/map/")) {
        return integer(0, (1 << kMapZoomMax) - 1, 0);
    }
    return integer(-kColumnMax, kColumnMax, name == "x1" ? 40 : 0);
}

/// The names in a pattern's braces.
std::vector<std::string> names_in(std::string_view pattern) {
    std::vector<std::string> names;
    for (std::size_t open = pattern.find('{'); open != std::string_view::npos;
         open = pattern.find('{', open + 1)) {
        const std::size_t close = pattern.find('}', open);
        names.emplace_back(pattern.substr(open + 1, close - open - 1));
    }
    return names;
}

Json parameters_of(const Described& route, const OpenApiContext& context) {
    Json parameters = Json::array();
    for (const std::string& name : names_in(full_path(route))) {
        parameters.push_back({{"name", name},
                              {"in", "path"},
                              {"required", true},
                              {"schema", schema_of(name, route, context)}});
    }
    for (const std::string_view name : route.query) {
        if (!name.empty()) {
            parameters.push_back({{"name", name},
                                  {"in", "query"},
                                  {"required", false},
                                  {"schema", schema_of(name, route, context)}});
        }
    }
    return parameters;
}

Json problem_reference(std::string_view name) {
    return {{"$ref", "#/components/responses/" + std::string(name)}};
}

Json responses_of(const Described& route) {
    const bool is_state = route.path == "/healthz" || route.path == "/readyz";
    Json ok = {{"description", "OK"}};
    if (route.versioned) {
        ok["headers"]["Cache-Control"] = {
            {"schema", {{"const", "public, max-age=31536000, immutable"}}}};
        ok["headers"]["ETag"] = {{"schema", {{"type", "string"}}}};
    }
    if (route.path.starts_with("/chunks/")) {
        ok["description"] = route.path.ends_with(".glb")
                                ? "The chunk; a file with an empty scene if it is empty or uniform"
                                : "The chunk; of length 0 if it is empty or uniform";
        ok["headers"]["Terrane-Status"] = {
            {"description", "`empty`, or `uniform; material=...`; absent if there is a surface"},
            {"schema", {{"type", "string"}}}};
    }
    ok["content"][std::string(route.content_type)] = Json::object();
    Json responses = {{"200", std::move(ok)}};
    if (!is_state && route.path != "/metrics") {
        responses["304"] = {{"description", "If-None-Match names the answer's ETag; no body"}};
    }
    if (!names_in(route.path).empty()) {
        responses["400"] = problem_reference("BadRequest");
    }
    if (route.needs_token) {
        responses["401"] = problem_reference("Unauthorized");
    }
    if (route.versioned) {
        responses["404"] = problem_reference("NotFound");
    }
    if (route.asks_service) {
        responses["429"] = problem_reference("Busy");
    }
    if (route.asks_service || route.path == "/readyz") {
        responses["503"] = problem_reference("Draining");
    }
    return responses;
}

Json operation_of(const Described& route, const OpenApiContext& context) {
    Json operation = {{"tags", Json::array({route.tag})}, {"summary", route.summary}};
    if (Json parameters = parameters_of(route, context); !parameters.empty()) {
        operation["parameters"] = std::move(parameters);
    }
    operation["responses"] = responses_of(route);
    if (!route.needs_token) {
        operation["security"] = Json::array();
    }
    return operation;
}

Json problem_response(std::string_view description) {
    return {
        {"description", description},
        {"content",
         {{"application/problem+json", {{"schema", {{"$ref", "#/components/schemas/Problem"}}}}}}}};
}

Json components() {
    Json busy = problem_response("Too much is asked for now; `Retry-After` says when to come back");
    busy["headers"]["Retry-After"] = {{"schema", {{"type", "integer"}, {"minimum", 1}}}};
    return {{"schemas",
             {{"Problem",
               {{"description", "RFC 9457"},
                {"type", "object"},
                {"required", Json::array({"type", "title", "status", "detail"})},
                {"properties",
                 {{"type", {{"type", "string"}}},
                  {"title", {{"type", "string"}}},
                  {"status", {{"type", "integer"}}},
                  {"detail", {{"type", "string"}}},
                  {"code", {{"type", "string"}}}}}}}}},
            {"responses",
             {{"BadRequest", problem_response("A number is none, or out of its range")},
              {"Unauthorized", problem_response("A token is missing, wrong or expired")},
              {"NotFound", problem_response("No such thing, or another world's content id")},
              {"Busy", std::move(busy)},
              {"Draining", problem_response("The server is shutting down")}}},
            {"securitySchemes", {{"token", {{"type", "http"}, {"scheme", "bearer"}}}}}};
}

}  // namespace

std::vector<std::string> described_paths() {
    std::vector<std::string> paths;
    paths.reserve(kDescribed.size());
    for (const Described& route : kDescribed) {
        paths.push_back(full_path(route));
    }
    return paths;
}

std::string openapi_json(const Router& router, std::int32_t tileset_levels) {
    const OpenApiContext context = {.content_id = router.content_id(),
                                    .tileset_levels = tileset_levels};
    std::vector<std::string> served = router.paths();
    served.emplace_back(kOwnPath);
    served.emplace_back("/");
    Json paths = Json::object();
    for (const Described& route : kDescribed) {
        const std::string path = full_path(route);
        if (std::find(served.begin(), served.end(), path) != served.end()) {
            paths[path]["get"] = operation_of(route, context);
        }
    }
    const Json json = {
        {"openapi", "3.1.0"},
        {"info",
         {{"title", "Terrane"},
          {"version", TERRANE_VERSION},
          {"summary", "Volumetric terrain on request"},
          {"description",
           "`W` is the world's content id (/v1/world tells): what lies under it never changes. "
           "Paths under /v1/w/{W}/ may be asked for as /v1/... too and are redirected (307). HEAD "
           "and OPTIONS are answered everywhere. Messages of the native protocol are at /ws, as "
           "binary WebSocket frames."}}},
        {"servers", Json::array({{{"url", "/"}}})},
        {"security", Json::array({Json::object(), {{"token", Json::array()}}})},
        {"paths", std::move(paths)},
        {"components", components()}};
    return json.dump(2) + "\n";
}

void add_openapi_route(Router& router, std::int32_t tileset_levels) {
    router.add({.path = std::string(kOwnPath),
                .handler = [response = http_ok("application/json",
                                               http_body(openapi_json(router, tileset_levels)))](
                               const HttpRequest&, const RouteParams&, const HttpLater&) {
                    return response;
                }});
}

}  // namespace terrane
