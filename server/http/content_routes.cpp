#include "server/http/content_routes.h"

#include "generator/terrain/world.h"
#include "generator/world/world_definition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/chunks/answer.h"
#include "server/chunks/build_chunk.h"
#include "server/chunks/chunk_key.h"
#include "server/chunks/chunk_service.h"
#include "server/http/ask_service.h"
#include "server/http/core_routes.h"
#include "server/http/http_message.h"
#include "server/http/problem.h"
#include "server/http/router.h"
#include "server/http/tiles3d.h"
#include "server/http/viewer_files.h"
#include "server/render/picture_keys.h"
#include "server/render/section.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace terrane {
namespace {

constexpr std::int64_t kInt32Max = std::numeric_limits<std::int32_t>::max();
constexpr std::int64_t kColumnMax = kColumnCoordinateLimit - 1;
constexpr std::string_view kGlbType = "model/gltf-binary";
constexpr std::string_view kJsonType = "application/json";

/// Three numbers of a path, such as {level}/{x}/{y}.
Result<std::array<std::int32_t, 3>> three_of(const RouteParams& params,
                                             const std::array<std::string_view, 3>& names) {
    std::array<std::int32_t, 3> numbers{};
    for (std::size_t i = 0; i < names.size(); ++i) {
        const auto number = params.integer(names[i], -kInt32Max, kInt32Max);
        if (!number) {
            return tl::unexpected(number.error());
        }
        numbers[i] = static_cast<std::int32_t>(*number);
    }
    return numbers;
}

Result<TileIndex> tile_of(const TilesetShape& shape, const RouteParams& params) {
    const auto numbers = three_of(params, {"level", "x", "y"});
    if (!numbers) {
        return tl::unexpected(numbers.error());
    }
    const TileIndex tile{.level = (*numbers)[0], .x = (*numbers)[1], .y = (*numbers)[2]};
    return check_tile(shape, tile).map([&tile] { return tile; });
}

/// Asks for a file and answers with it, whenever it comes.
std::optional<HttpResponse> answer_file(ChunkService& service, const WorkKey& key,
                                        std::int32_t priority, std::string_view content_type,
                                        const HttpRequest& request, const HttpLater& later) {
    return ask_service(
        service, key, request, later,
        [&service, content_type](const Result<Answer>& answer) {
            if (!answer) {
                return http_problem(answer.error(), service.retry_after_ms());
            }
            const EncodedChunk& file = *std::get<ServedFile>(*answer).file;
            HttpResponse response = http_ok(content_type, file.payload);
            response.etag = file.etag;
            return response;
        },
        priority);
}

/// A document that is made anew for each request: it takes microseconds.
auto document(TilesetShape shape, std::string_view content_type,
              Result<Bytes> (*make)(const TilesetShape&, const TileIndex&)) {
    return [shape, content_type, make](const HttpRequest&, const RouteParams& params,
                                       const HttpLater&) {
        const auto tile = tile_of(shape, params);
        if (!tile) {
            return http_problem(tile.error());
        }
        auto bytes = make(shape, *tile);
        return bytes ? http_ok(content_type, std::make_shared<const Bytes>(*std::move(bytes)))
                     : http_problem(bytes.error());
    };
}

HttpHandler fixed(std::string_view content_type, std::string_view text) {
    return fixed_answer(content_type, http_body(text));
}

Result<Bytes> explicit_bytes(const TilesetShape& shape, const TileIndex& tile) {
    return explicit_tileset_json(shape, tile).map([](const std::string& text) {
        const auto bytes = bytes_of(text);
        return Bytes(bytes.begin(), bytes.end());
    });
}

std::optional<HttpResponse> answer_map(const RouteContext& context, const HttpRequest& request,
                                       const RouteParams& params, const HttpLater& later) {
    const auto numbers = three_of(params, {"zoom", "x", "y"});
    if (!numbers) {
        return http_problem(numbers.error());
    }
    return answer_file(*context.service,
                       MapTile{.zoom = (*numbers)[0], .x = (*numbers)[1], .y = (*numbers)[2]},
                       kPicturePriority, "image/png", request, later);
}

/// A number of a query; 0 if it is not there.
Result<std::int32_t> query_integer(std::string_view query, std::string_view name,
                                   std::int64_t most) {
    const auto text = query_value(query, name);
    if (!text || text->empty()) {
        return 0;
    }
    RouteParams params;
    params.add(name, *text);
    return params.integer(name, 1, most).map([](std::int64_t value) {
        return static_cast<std::int32_t>(value);
    });
}

Result<Section> section_of(const HttpRequest& request, const RouteParams& params) {
    const auto x0 = params.integer("x0", -kColumnMax, kColumnMax);
    const auto z0 = params.integer("z0", -kColumnMax, kColumnMax);
    const auto x1 = params.integer("x1", -kColumnMax, kColumnMax);
    const auto z1 = params.integer("z1", -kColumnMax, kColumnMax);
    for (const auto* number : {&x0, &z0, &x1, &z1}) {
        if (!*number) {
            return tl::unexpected(number->error());
        }
    }
    const auto height = query_integer(request.query, "height", kSectionHeightMax);
    const auto scale = query_integer(request.query, "scale", kSectionScaleMax);
    if (!height || !scale) {
        return tl::unexpected(height ? scale.error() : height.error());
    }
    return Section{.from = {.x = *x0, .z = *z0},
                   .to = {.x = *x1, .z = *z1},
                   .height_voxels = *height,
                   .scale = *scale};
}

/// Refuses what would be too large a picture before a worker begins with it.
Result<void> check_size(const Section& section, const World& world) {
    const std::int64_t columns = 1 + std::max(std::abs(section.to.x - section.from.x),
                                              std::abs(section.to.z - section.from.z));
    if (columns > kSectionColumnsMax) {
        return fail(ErrorCode::out_of_range, "a line of " + std::to_string(columns) +
                                                 " columns is too long: at most " +
                                                 std::to_string(kSectionColumnsMax));
    }
    const std::int64_t scale = std::max(1, section.scale);
    const auto bound = static_cast<std::int64_t>(std::ceil(world.stack.height_bound));
    const std::int64_t voxels =
        section.height_voxels > 0 ? section.height_voxels : bound + bound / 6 + 4;
    if (columns * scale * voxels * scale > kSectionPixelsMax) {
        return fail(ErrorCode::out_of_range,
                    "a picture of up to " + std::to_string(columns * scale) + " x " +
                        std::to_string(voxels * scale) + " pixels is too large: at most " +
                        std::to_string(kSectionPixelsMax) +
                        " in all; ask for a shorter line, less height or a smaller scale");
    }
    return {};
}

std::optional<HttpResponse> answer_section(const RouteContext& context, const HttpRequest& request,
                                           const RouteParams& params, const HttpLater& later) {
    const auto section = section_of(request, params);
    if (!section) {
        return http_problem(section.error());
    }
    if (const auto checked = check_size(*section, *context.world); !checked) {
        return http_problem(checked.error());
    }
    return answer_file(*context.service, *section, kPicturePriority, "image/png", request, later);
}

}  // namespace

TilesetShape tileset_shape_of(const World& world, std::int32_t levels) {
    const Grid& grid = world.definition.grid;
    return {.fingerprint = world.fingerprint,
            .levels = levels,
            .side = grid.side,
            .voxel_size_m = grid.voxel_size_m,
            .height_voxels = tile_height_voxels(world)};
}

void add_tiles3d_routes(Router& router, const RouteContext& context) {
    const TilesetShape shape = tileset_shape_of(*context.world, context.tileset_levels);
    router.add_versioned(
        {.path = "/3dtiles/tileset.json", .handler = fixed(kJsonType, tileset_json(shape))});
    router.add_versioned({.path = "/3dtiles/tileset-geo.json",
                          .handler = fixed(kJsonType, tileset_geo_json(shape))});
    router.add_versioned({.path = "/3dtiles/content/{level}/{x}/{y}.glb",
                          .handler = [shape, service = context.service](
                                         const HttpRequest& request, const RouteParams& params,
                                         const HttpLater& later) -> std::optional<HttpResponse> {
                              const auto tile = tile_of(shape, params);
                              if (!tile) {
                                  return http_problem(tile.error());
                              }
                              return answer_file(*service, tile_key_of(shape, *tile), 0, kGlbType,
                                                 request, later);
                          }});
    router.add_versioned({.path = "/3dtiles/subtrees/{level}/{x}/{y}.subtree",
                          .handler = document(shape, "application/octet-stream", subtree_of)});
    router.add_versioned(
        {.path = "/3dtiles/explicit/tileset.json",
         .handler = fixed(kJsonType, explicit_tileset_json(shape, {}).value_or(std::string()))});
    router.add_versioned({.path = "/3dtiles/explicit/tileset-geo.json",
                          .handler = fixed(kJsonType, explicit_tileset_geo_json(shape))});
    router.add_versioned({.path = "/3dtiles/explicit/{level}/{x}/{y}.json",
                          .handler = document(shape, kJsonType, explicit_bytes)});
}

void add_picture_routes(Router& router, const RouteContext& context) {
    router.add_versioned({.path = "/map/{zoom}/{x}/{y}.png",
                          .handler = [&context](const HttpRequest& request,
                                                const RouteParams& params, const HttpLater& later) {
                              return answer_map(context, request, params, later);
                          }});
    router.add_versioned({.path = "/sections/{x0},{z0}/{x1},{z1}.png",
                          .handler = [&context](const HttpRequest& request,
                                                const RouteParams& params, const HttpLater& later) {
                              return answer_section(context, request, params, later);
                          }});
}

void add_texture_routes(Router& router, const RouteContext& context) {
    router.add_versioned(
        {.path = "/textures/{name}",
         .handler = [world = context.world](const HttpRequest&, const RouteParams& params,
                                            const HttpLater&) {
             const auto& textures = world->definition.textures;
             const std::string_view name = params["name"];
             const auto found =
                 std::find_if(textures.begin(), textures.end(),
                              [name](const Texture& texture) { return texture.name == name; });
             if (found == textures.end()) {
                 return http_problem({.code = ErrorCode::not_found,
                                      .message = "this world has no texture \"" +
                                                 std::string(name.substr(0, 64)) + "\""});
             }
             // The world outlives every answer: its bytes are shared, not copied.
             return http_ok(content_type_of(found->name),
                            SharedBytes(SharedBytes(), &found->bytes));
         }});
}

}  // namespace terrane
