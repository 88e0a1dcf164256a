// The store on disk: RocksDB, zstd, one column family for each family of records.
//
// A directory looks like this (STORE_FORMAT.md has the bytes):
//     TERRANE_STORE        says that the directory is ours and of which format
//     rocksdb/             the database: column families stacks, meshes, metadata
//     rocksdb.damaged/     the last database that could not be opened any more, if there was one
// Nothing outside these three is ever touched, and a directory that has anything else in it and no
// TERRANE_STORE is refused as it stands.
//
// Threads: every call from any thread at any time.
#pragma once

#include "protocol/base/result.h"
#include "storage/chunk_store.h"

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>

namespace terrane {

struct RocksdbOptions {
    /// Uncompressed blocks kept for reading, and memory for writes not yet in a file. With indexes
    /// of at most kOpenFilesMax files, that is what the database takes.
    std::size_t block_cache_bytes = std::size_t{64} << 20U;
    std::size_t write_buffer_bytes = std::size_t{64} << 20U;
    /// Told in a sentence when a damaged database is set aside or the disk fails in the background.
    /// Called from any thread; must not call the store. Empty: standard error.
    std::function<void(std::string_view)> on_notice;
};

/// Opens the store in `directory`, or makes one, parent directories too.
///
/// A database damaged beyond opening is set aside as `rocksdb.damaged` (of which only the latest is
/// kept) and a new one begun: everything in it can be made again.
///
/// After a failed write, such as on a full disk, the store reads on and refuses every further write
/// with `io_error`; what it took before is found again by a later process. Its database is then
/// never closed (see Database), so that the same process cannot open the directory again.
///
/// Fails with `wrong_world` if it holds another fingerprint, `version_mismatch` if a later build
/// made it, `invalid_argument` if the directory holds something else, and `io_error` if it cannot
/// be read, written or locked, or if less than 16 MiB, and room for what is in its logs, are free.
/// Every message says what to do.
Result<std::unique_ptr<ChunkStore>> open_rocksdb_store(const std::filesystem::path& directory,
                                                       const StoreIdentity& identity,
                                                       const RocksdbOptions& options = {});

}  // namespace terrane
