#include "server/http/core_routes.h"

#include "generator/mesh/glb.h"
#include "generator/terrain/world.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"
#include "server/chunks/answer.h"
#include "server/chunks/chunk_key.h"
#include "server/http/ask_service.h"
#include "server/http/http_message.h"
#include "server/http/problem.h"
#include "server/http/router.h"

#include <nlohmann/json.hpp>

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace terrane {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::int64_t kChunkMin = std::numeric_limits<std::int32_t>::min();
constexpr std::int64_t kChunkMax = std::numeric_limits<std::int32_t>::max();
constexpr std::int64_t kColumnMax = kColumnCoordinateLimit - 1;

Json color_json(Rgb8 color) {
    return Json::array({color.r, color.g, color.b});
}

/// "rock 0.750, sand 0.250", for a header.
std::string composition_text(const Composition& composition, const World& world) {
    std::string text;
    for (const Share& share : composition.shares()) {
        text += text.empty() ? "" : ", ";
        text += world.definition.materials[share.material].name;
        if (composition.count > 1) {
            text += ' ';
            text += std::to_string(share.concentration);
        }
    }
    return text;
}

Result<ChunkPos> position_of(const RouteParams& params) {
    const auto lod = params.integer("lod", 0, levels_supported() - 1);
    const auto x = params.integer("x", kChunkMin, kChunkMax);
    const auto y = params.integer("y", kChunkMin, kChunkMax);
    const auto z = params.integer("z", kChunkMin, kChunkMax);
    for (const auto* number : {&lod, &x, &y, &z}) {
        if (!*number) {
            return tl::unexpected(number->error());
        }
    }
    return ChunkPos{.lod = static_cast<std::int32_t>(*lod),
                    .x = static_cast<std::int32_t>(*x),
                    .y = static_cast<std::int32_t>(*y),
                    .z = static_cast<std::int32_t>(*z)};
}

std::string_view content_type_of(ChunkFormat format) {
    return format == ChunkFormat::glb ? "model/gltf-binary" : "application/octet-stream";
}

/// Whether columns come with their flow plane: "flow=1", or nothing said. Meshes have none.
Result<bool> with_flow(const HttpRequest& request, ChunkFormat format) {
    if (format != ChunkFormat::columns || request.query.empty()) {
        return true;
    }
    const std::string text = query_value(request.query, "flow").value_or("1");
    if (text != "0" && text != "1") {
        return fail(ErrorCode::invalid_argument, "flow: 0 (without) or 1 (with)");
    }
    return text == "1";
}

HttpHandler chunk_handler(const RouteContext& context, ChunkFormat format) {
    return [&context, format](const HttpRequest& request, const RouteParams& params,
                              const HttpLater& later) -> std::optional<HttpResponse> {
        const auto position = position_of(params);
        if (!position) {
            return http_problem(position.error());
        }
        const auto flow = with_flow(request, format);
        if (!flow) {
            return http_problem(flow.error());
        }
        return ask_service(
            *context.service,
            ChunkKey{.position = *position, .format = format, .without_flow = !*flow}, request,
            later, [&context, format](const Result<Answer>& answer) {
                return answer ? chunk_response(*std::get<ServedChunk>(*answer).chunk, format,
                                               *context.world)
                              : http_problem(answer.error(), context.service->retry_after_ms());
            });
    };
}

std::string column_json(const ServedColumn& column, const World& world) {
    Json json = {{"x", column.column.x}, {"z", column.column.z}, {"limits", Json::array()}};
    for (const ColumnLimit& limit : *column.limits) {
        Json composition = Json::object();
        for (const Share& share : limit.composition.shares()) {
            composition[world.definition.materials[share.material].name] = share.concentration;
        }
        json["limits"].push_back({{"y256", limit.y256},
                                  {"flow", {limit.flow.x, limit.flow.y, limit.flow.z}},
                                  {"composition", std::move(composition)}});
    }
    return json.dump();
}

std::optional<HttpResponse> answer_column(const RouteContext& context, const HttpRequest& request,
                                          const RouteParams& params, const HttpLater& later) {
    const auto x = params.integer("x", -kColumnMax, kColumnMax);
    const auto z = params.integer("z", -kColumnMax, kColumnMax);
    if (!x || !z) {
        return http_problem(x ? z.error() : x.error());
    }
    return ask_service(
        *context.service, ColumnPos{.x = *x, .z = *z}, request, later,
        [&context](const Result<Answer>& answer) {
            return answer ? http_ok("application/json",
                                    http_body(column_json(std::get<ServedColumn>(*answer),
                                                          *context.world)))
                          : http_problem(answer.error(), context.service->retry_after_ms());
        });
}

/// The same bytes each time.
HttpHandler fixed(std::string_view content_type, std::string_view text) {
    return fixed_answer(content_type, http_body(text));
}

}  // namespace

HttpResponse chunk_response(const EncodedChunk& chunk, ChunkFormat format, const World& world) {
    HttpResponse response = http_ok(content_type_of(format), chunk.payload);
    if (format == ChunkFormat::glb && !chunk.payload) {  // a loader is given a file in any case
        response.body = std::make_shared<const Bytes>(empty_glb());
    } else {
        response.etag = chunk.etag;
    }
    if (chunk.status == ChunkStatus::empty) {
        response.headers.emplace_back("Terrane-Status", "empty");
    } else if (chunk.status == ChunkStatus::uniform) {
        response.headers.emplace_back(
            "Terrane-Status", "uniform; material=" + composition_text(chunk.uniform, world));
    }
    return response;
}

void add_chunk_routes(Router& router, const RouteContext& context) {
    // The longer ending first: {z} would take "1.blocky" for a coordinate.
    router.add_versioned({.path = "/chunks/{lod}/{x}/{y}/{z}.blocky.drc",
                          .handler = chunk_handler(context, ChunkFormat::draco_blocky)});
    router.add_versioned({.path = "/chunks/{lod}/{x}/{y}/{z}.drc",
                          .handler = chunk_handler(context, ChunkFormat::draco)});
    router.add_versioned({.path = "/chunks/{lod}/{x}/{y}/{z}.glb",
                          .handler = chunk_handler(context, ChunkFormat::glb)});
    router.add_versioned({.path = "/chunks/{lod}/{x}/{y}/{z}.columns",
                          .handler = chunk_handler(context, ChunkFormat::columns)});
}

std::string world_json(const RouteContext& context, const std::string& versioned_prefix) {
    const ServerHello& hello = *context.hello;
    const WorldDefinition& definition = context.world->definition;
    Json materials = Json::array();
    for (const Material& material : definition.materials) {
        Json entry = {{"name", material.name}, {"color", color_json(material.color)}};
        if (!material.texture.empty()) {
            entry["texture"] = versioned_prefix + "/textures/" + material.texture;
        }
        entry["kind"] = to_string(material.kind);
        entry["solid"] = is_solid(material.kind);
        materials.push_back(std::move(entry));
    }
    Json links = {{"self", "/v1/world"}, {"content", versioned_prefix}};
    if (!context.world_file.empty()) {
        links["world_file"] = versioned_prefix + "/world.toml";
    }
    links["chunk"] = versioned_prefix + "/chunks/{lod}/{x}/{y}/{z}.drc";
    links["glb"] = versioned_prefix + "/chunks/{lod}/{x}/{y}/{z}.glb";
    links["columns"] = versioned_prefix + "/chunks/{lod}/{x}/{y}/{z}.columns";
    links["column"] = versioned_prefix + "/columns/{x}/{z}.json";
    links["map"] = versioned_prefix + "/map/{zoom}/{x}/{y}.png";
    links["section"] = versioned_prefix + "/sections/{x0},{z0}/{x1},{z1}.png";
    links["tileset"] = versioned_prefix + "/3dtiles/tileset.json";
    links["tileset_on_globe"] = versioned_prefix + "/3dtiles/tileset-geo.json";
    links["tileset_explicit"] = versioned_prefix + "/3dtiles/explicit/tileset.json";
    links["openapi"] = "/v1/openapi.json";
    links["websocket"] = "/ws";
    const Json json = {{"name", hello.world_name},
                       {"fingerprint", to_hex(hello.fingerprint)},
                       {"content_id", to_hex(hello.content_id)},
                       {"server_version", hello.server_version},
                       {"generator_version", hello.generator_version},
                       {"encoding_version", hello.encoding_version},
                       {"chunk_side_columns", hello.chunk_side},
                       {"chunk_height_voxels", hello.chunk_height},
                       {"voxel_size_m", hello.voxel_size_m},
                       {"levels", hello.levels},
                       {"tileset_levels", context.tileset_levels},
                       {"bounds",
                        {{"height_voxels", hello.height_bound_voxels},
                         {"column_min", -kColumnMax},
                         {"column_max", kColumnMax},
                         {"chunk_min", kChunkMin},
                         {"chunk_max", kChunkMax}}},
                       {"mesh_parts", hello.mesh_parts},
                       {"materials", std::move(materials)},
                       {"links", std::move(links)}};
    return json.dump(2) + "\n";
}

void add_world_routes(Router& router, const RouteContext& context) {
    router.add(
        {.path = "/v1/world",
         .handler = fixed("application/json", world_json(context, router.versioned_prefix()))});
    if (!context.world_file.empty()) {
        router.add_versioned(
            {.path = "/world.toml", .handler = fixed("application/toml", context.world_file)});
    }
    router.add_versioned({.path = "/columns/{x}/{z}.json",
                          .handler = [&context](const HttpRequest& request,
                                                const RouteParams& params, const HttpLater& later) {
                              return answer_column(context, request, params, later);
                          }});
}

void add_state_routes(Router& router, const RouteContext& context) {
    router.add({.path = "/healthz",
                .caching = HttpCaching::none,
                .needs_token = false,
                .handler = fixed("text/plain", "ok\n")});
    router.add({.path = "/readyz",
                .caching = HttpCaching::none,
                .needs_token = false,
                .handler = [&context](const HttpRequest&, const RouteParams&, const HttpLater&) {
                    return context.is_ready()
                               ? http_ok("text/plain", http_body("ready\n"))
                               : http_problem({.code = ErrorCode::draining,
                                               .message = "the server is shutting down"});
                }});
    router.add({.path = "/metrics",
                .caching = HttpCaching::none,
                .handler = [&context](const HttpRequest&, const RouteParams&, const HttpLater&) {
                    return http_ok("text/plain; version=0.0.4; charset=utf-8",
                                   http_body(context.metrics()));
                }});
}

}  // namespace terrane
