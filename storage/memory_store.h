// A store that forgets: records in memory up to a byte limit, the oldest leave first.
//
// For `--store memory`, for tests and for builds that cannot have RocksDB. It goes through the same
// keys and frames as the disk does. Threads: every call from any thread; one mutex, under which
// only pointers move.
#pragma once

#include "protocol/base/mutex.h"
#include "storage/chunk_store.h"

#include <atomic>
#include <cstddef>
#include <list>
#include <memory>
#include <string>
#include <unordered_map>

namespace terrane {

/// About 10,000 stacks: what a small server keeps without a disk.
inline constexpr std::size_t kMemoryStoreBytesMax = std::size_t{256} << 20U;

class MemoryStore final : public ChunkStore {
  public:
    /// Keys and frames together stay at or below `bytes_max`; a record above it alone is not kept.
    explicit MemoryStore(StoreIdentity identity, std::size_t bytes_max = kMemoryStoreBytesMax);

    Result<std::optional<Bytes>> get(const RecordKey& key) override;
    Result<std::vector<std::optional<Bytes>>> get_many(std::span<const RecordKey> keys) override;
    Result<void> put(std::span<const RecordToPut> records) override;
    Result<void> erase(const RecordKey& key) override;
    Result<void> flush() override;
    StoreStats stats() const override;

    /// What keys and frames occupy now.
    std::size_t bytes() const;

  private:
    struct Entry {
        std::string key;
        SharedBytes framed;

        std::size_t bytes() const { return key.size() + framed->size(); }
    };

    using Entries = std::list<Entry>;

    std::optional<Bytes> find(const RecordKey& key);
    void insert(Entry entry);
    void remove(std::unordered_map<std::string_view, Entries::iterator>::iterator found)
        TERRANE_REQUIRES(mutex_);

    const StoreIdentity identity_;
    const std::size_t bytes_max_;
    mutable Mutex mutex_;
    Entries oldest_first_ TERRANE_GUARDED_BY(mutex_);
    /// Views into the keys of `oldest_first_`, whose nodes never move.
    std::unordered_map<std::string_view, Entries::iterator> by_key_ TERRANE_GUARDED_BY(mutex_);
    std::size_t bytes_ TERRANE_GUARDED_BY(mutex_) = 0;
    std::atomic<std::uint64_t> gets_ = 0;
    std::atomic<std::uint64_t> hits_ = 0;
    std::atomic<std::uint64_t> puts_ = 0;
    std::atomic<std::uint64_t> corrupt_ = 0;
};

}  // namespace terrane
