// The data directory around a database: whose it is, what may be done in it. Knows files, no
// RocksDB.
//
// One thread at a time per directory; DirectoryLock keeps other processes out.
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

/// Keeps every other store, of this process or another, out of a data directory for as long as it
/// lives. It is the kernel's lock on the directory itself: it leaves no file and ends with the
/// process. Any thread.
class DirectoryLock {
  public:
    /// Fails with `io_error` if somebody has it. A file system that knows no such lock gives one
    /// that holds nothing; the database's own lock is left then.
    static Result<DirectoryLock> take(const StoreDirectory& directory);
    ~DirectoryLock();
    DirectoryLock(DirectoryLock&& other) noexcept;
    DirectoryLock& operator=(DirectoryLock&&) = delete;

  private:
    explicit DirectoryLock(int descriptor) : descriptor_(descriptor) {}

    int descriptor_;
};

/// True if no database was begun here yet.
Result<bool> is_database_absent(const StoreDirectory& directory);

/// Renames the database to `rocksdb.damaged`, over an older one.
Result<void> set_database_aside(const StoreDirectory& directory);

}  // namespace terrane
