// Answers: what a worker makes and every waiter shares. Immutable once made.
#pragma once

#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"
#include "server/chunks/chunk_key.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <variant>
#include <vector>

namespace terrane {

/// A chunk as it is sent. A function of (world, key) only, so it may be kept for ever.
struct EncodedChunk {
    ChunkStatus status = ChunkStatus::empty;  ///< full, empty (meshes only) or uniform
    Composition uniform;                      ///< what it consists of, if `uniform`
    Hash128 etag;         ///< XXH3-128 of the payload if `full`, else of status and composition
    SharedBytes payload;  ///< null unless `full`

    std::size_t payload_bytes() const { return payload ? payload->size() : 0; }
};

struct ServedChunk {
    ChunkKey key;
    std::shared_ptr<const EncodedChunk> chunk;
    /// `generated`: the stack was made for this answer; `store`: nothing was generated; `cache`:
    /// the encoded bytes were at hand.
    ChunkSource source = ChunkSource::cache;
    AnswerTimings timings;  ///< generate: getting the stack, from the store or made
};

struct ColumnLimit {
    std::int32_t y256 = 0;
    Flow flow;
    Composition composition;
};

struct ServedColumn {
    ColumnPos column;
    std::shared_ptr<const std::vector<ColumnLimit>> limits;  ///< bottom first
    ChunkSource source = ChunkSource::generated;             ///< never `cache`
};

/// A file that is no chunk: a tile of 3D Tiles (GLB), a map or a section (PNG).
struct ServedFile {
    std::shared_ptr<const EncodedChunk> file;  ///< its status is `full`
    ChunkSource source = ChunkSource::cache;
};

using Answer = std::variant<ServedChunk, ServedColumn, ServedFile>;

inline ChunkSource source_of(const Answer& answer) {
    return std::visit([](const auto& served) { return served.source; }, answer);
}

/// Called once, on a worker's thread or the caller's: must only hand the answer on.
using AnswerCallback = std::function<void(const Result<Answer>&)>;

}  // namespace terrane
