// The routes that every server has: chunks, columns, the world's description, and the server's
// state.
#pragma once

#include "generator/terrain/world.h"
#include "protocol/wire/messages.h"
#include "server/chunks/chunk_service.h"
#include "server/http/router.h"
#include "server/http/tiles3d.h"

#include <cstdint>
#include <functional>
#include <string>

namespace terrane {

/// What routes answer from; outlives the router.
struct RouteContext {
    ChunkService* service = nullptr;
    const World* world = nullptr;
    const ServerHello* hello = nullptr;
    std::string world_file;                        ///< canonical; empty: not published
    std::int32_t tileset_levels = kTilesetLevels;  ///< of 3D Tiles (tiles3d.h)
    std::function<bool()> is_ready;        ///< the store is open, and nobody has said to stop
    std::function<std::string()> metrics;  ///< in Prometheus' text format
};

/// /chunks/{lod}/{x}/{y}/{z}.drc, .blocky.drc, .glb, .columns under the content id.
void add_chunk_routes(Router& router, const RouteContext& context);
/// /v1/world, world.toml and columns/{x}/{z}.json.
void add_world_routes(Router& router, const RouteContext& context);
/// /healthz, /readyz and /metrics.
void add_state_routes(Router& router, const RouteContext& context);

/// /v1/world's body.
std::string world_json(const RouteContext& context, const std::string& versioned_prefix);

/// A chunk as an answer. Without a surface it is of length 0, as a GLB a file with an empty scene;
/// "Terrane-Status" says what that means.
HttpResponse chunk_response(const EncodedChunk& chunk, ChunkFormat format, const World& world);

}  // namespace terrane
