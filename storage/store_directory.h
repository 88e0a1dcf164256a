// The data directory around a database: whose it is, what may be done in it. Knows files, no
// RocksDB.
//
// One thread at a time per directory; the database's own lock keeps other processes out.
#pragma once

#include "protocol/base/result.h"

#include <filesystem>

namespace terrane {

/// Where things are inside a data directory.
struct StoreDirectory {
    std::filesystem::path root;

    std::filesystem::path marker() const { return root / "TERRANE_STORE"; }

    std::filesystem::path database() const { return root / "rocksdb"; }

    std::filesystem::path damaged_database() const { return root / "rocksdb.damaged"; }

    /// Present in a database that was found damaged while in use: the next opening sets it aside.
    std::filesystem::path damage_note() const { return database() / "TERRANE_DAMAGED"; }
};

/// Makes the directory if need be and checks that it is empty or a store of a format this build
/// reads. Changes nothing when it refuses: `io_error`, `invalid_argument` (something else lives
/// there) or `version_mismatch`.
Result<StoreDirectory> prepare_store_directory(const std::filesystem::path& root);

/// True if no database was begun here yet.
Result<bool> is_database_absent(const StoreDirectory& directory);

/// Renames the database to `rocksdb.damaged`, over an older one.
Result<void> set_database_aside(const StoreDirectory& directory);

}  // namespace terrane
