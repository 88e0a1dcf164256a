// The seam between Terrane and a disk: opaque records under a key.
//
// A store only saves time. Every record can be made again from the world file, so a record that is
// missing, corrupt or of an older version is a miss, never a failure of a request. Two families:
// `stacks` (encode_stack bytes, one per chunk stack) and `meshes` (encoded meshes, one per chunk).
//
// Threads: every call from any thread at any time.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace terrane {

enum class Family : std::uint8_t { stacks, meshes };

/// `position.y` is 0 in the family `stacks`. `format` tells encodings of one chunk apart.
struct RecordKey {
    Family family = Family::stacks;
    std::uint8_t format = 0;
    ChunkPos position;

    friend bool operator==(const RecordKey&, const RecordKey&) = default;
};

/// Whose records a store holds: a store opened for one identity never shows another's.
struct StoreIdentity {
    Hash128 fingerprint;  ///< names stacks
    Hash128 content_id;   ///< names meshes
    std::uint32_t generator_version = 0;
    std::string world_name;  ///< for messages only
};

struct StoreStats {
    std::uint64_t gets = 0;
    std::uint64_t hits = 0;
    std::uint64_t puts = 0;
    std::uint64_t corrupt = 0;   ///< records found damaged (and treated as missing)
    std::uint64_t failures = 0;  ///< reads or writes the disk refused
    // What the database holds and has yet to do; 0 for a store that has no such thing.
    std::uint64_t disk_bytes = 0;         ///< its tables
    std::uint64_t memtable_bytes = 0;     ///< written, and not yet in a table; a memory store: all
    std::uint64_t block_cache_bytes = 0;  ///< tables' blocks in memory
    std::uint64_t pending_compaction_bytes = 0;  ///< what its tables' merging has yet to read
    std::uint64_t stalled_writes = 0;            ///< 1 while it slows or stops writes to catch up
};

struct RecordToPut {
    RecordKey key;
    std::span<const std::byte> value;
};

class ChunkStore {
  public:
    ChunkStore() = default;
    ChunkStore(const ChunkStore&) = delete;
    ChunkStore& operator=(const ChunkStore&) = delete;
    virtual ~ChunkStore() = default;

    /// The record, nothing if there is none (or it is damaged: counted), or `io_error`.
    virtual Result<std::optional<Bytes>> get(const RecordKey& key) = 0;
    /// As many answers as keys, in their order.
    virtual Result<std::vector<std::optional<Bytes>>> get_many(std::span<const RecordKey> keys) = 0;
    /// Overwrites. When it returns, the records outlive the process; after `flush`, a power cut.
    virtual Result<void> put(std::span<const RecordToPut> records) = 0;
    virtual Result<void> erase(const RecordKey& key) = 0;
    virtual Result<void> flush() = 0;
    virtual StoreStats stats() const = 0;
};

}  // namespace terrane
