#include "client-sample/cpp/chunk_reader.h"

#include "generator/mesh/draco_codec.h"
#include "generator/volume/chunk_codec.h"
#include "generator/world/world_definition.h"
#include "protocol/base/result.h"
#include "protocol/wire/column_payload.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>

namespace terrane {

namespace {

Result<ChunkContent> read_mesh(std::span<const std::byte> payload) {
    auto mesh = decode_draco(payload);
    if (!mesh) {
        return tl::unexpected(mesh.error());
    }
    if (mesh->indices.empty() || mesh->indices.size() % 3 != 0) {
        return fail(ErrorCode::malformed, "draco: a full chunk without triangles");
    }
    if (std::ranges::any_of(mesh->indices,
                            [&](std::uint32_t index) { return index >= mesh->vertex_count(); })) {
        return fail(ErrorCode::malformed,
                    "draco: a triangle refers to a vertex that does not exist");
    }
    return ChunkContent{.mesh = std::move(*mesh), .chunk = std::nullopt};
}

Result<ChunkContent> read_columns(const ChunkAnswer& answer, std::span<const std::byte> payload,
                                  const ServerHello& world) {
    const auto chunk_bytes = decode_column_payload(payload, kColumnChunkBytesMax);
    if (!chunk_bytes) {
        return tl::unexpected(chunk_bytes.error());
    }
    auto chunk = decode_chunk(*chunk_bytes,
                              std::clamp<std::size_t>(world.materials.size(), 1, kMaterialsMax));
    if (!chunk) {
        return tl::unexpected(chunk.error());
    }
    if (chunk->position != answer.key) {
        return fail(ErrorCode::malformed, "columns: the payload is another chunk's");
    }
    if (chunk->side != world.chunk_side ||
        (answer.key.lod == 0 && chunk->height != world.chunk_height)) {
        return fail(ErrorCode::malformed, "columns: " + std::to_string(chunk->side) + " x " +
                                              std::to_string(chunk->height) +
                                              " voxels, the world's chunks are " +
                                              std::to_string(world.chunk_side) + " x " +
                                              std::to_string(world.chunk_height));
    }
    return ChunkContent{.mesh = std::nullopt, .chunk = std::move(*chunk)};
}

}  // namespace

Result<ChunkContent> read_chunk(const ChunkAnswer& answer, std::span<const std::byte> payload,
                                const ServerHello& world) {
    if (answer.status != ChunkStatus::full) {
        return ChunkContent{};
    }
    return answer.format == ChunkFormat::columns ? read_columns(answer, payload, world)
                                                 : read_mesh(payload);
}

}  // namespace terrane
