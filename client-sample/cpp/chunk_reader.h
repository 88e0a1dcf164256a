// Payloads to what a game needs: a mesh out of Draco bytes, columns out of a COLUMNS payload.
#pragma once

#include "generator/mesh/mesh.h"
#include "generator/volume/chunk.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"

#include <cstddef>
#include <optional>
#include <span>

namespace terrane {

/// At most one of the two; none for an empty, uniform or unmodified chunk.
struct ChunkContent {
    std::optional<Mesh> mesh;    ///< of a Draco chunk
    std::optional<Chunk> chunk;  ///< of a COLUMNS chunk

    std::size_t triangle_count() const { return mesh ? mesh->triangle_count() : 0; }
};

/// Decodes and checks that it is what the answer says: a Draco mesh has triangles and all its
/// indices are vertices; a chunk has the key and the size of the world. Fails with `malformed` or
/// `too_large`. Any thread.
Result<ChunkContent> read_chunk(const ChunkAnswer& answer, std::span<const std::byte> payload,
                                const ServerHello& world);

}  // namespace terrane
