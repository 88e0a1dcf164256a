// A map from keys to shared immutable values, bounded by bytes, that forgets what was used longest
// ago. Sharded by the key's hash, so that threads seldom meet: each shard has its own lock and its
// own equal part of the bound. A value larger than one shard's part is not kept at all.
#pragma once

#include "protocol/base/mutex.h"

#include <array>
#include <cstddef>
#include <list>
#include <memory>
#include <unordered_map>
#include <utility>

namespace terrane {

/// What an entry costs beside its value: list and map nodes, measured at 150 to 200 bytes.
inline constexpr std::size_t kLruEntryOverheadBytes = 200;

/// Any thread. A lock is held for a lookup or an insertion, never while a value is freed.
template <typename Key, typename Value, typename Hash, std::size_t kShards>
class ShardedLru {
  public:
    explicit ShardedLru(std::size_t bytes_max) : shard_bytes_max_(bytes_max / kShards) {}

    /// The value, or null. Counts as a use.
    std::shared_ptr<const Value> get(const Key& key) {
        Shard& shard = shard_of(key);
        const MutexLock lock(shard.mutex);
        const auto found = shard.places.find(key);
        if (found == shard.places.end()) {
            return nullptr;
        }
        shard.entries.splice(shard.entries.begin(), shard.entries, found->second);
        return found->second->value;
    }

    /// Keeps `value`, which takes `value_bytes`; replaces what stood under the key.
    void put(const Key& key, std::shared_ptr<const Value> value, std::size_t value_bytes) {
        const std::size_t bytes = value_bytes + kLruEntryOverheadBytes;
        if (bytes > shard_bytes_max_) {
            return;
        }
        std::list<Entry> forgotten;  // freed after the lock
        Shard& shard = shard_of(key);
        const MutexLock lock(shard.mutex);
        if (const auto found = shard.places.find(key); found != shard.places.end()) {
            shard.bytes -= found->second->bytes;
            forgotten.splice(forgotten.end(), shard.entries, found->second);
            shard.places.erase(found);
        }
        while (shard.bytes + bytes > shard_bytes_max_) {
            const auto last = std::prev(shard.entries.end());
            shard.bytes -= last->bytes;
            shard.places.erase(last->key);
            forgotten.splice(forgotten.end(), shard.entries, last);
        }
        forgotten.push_front({.key = key, .value = std::move(value), .bytes = bytes});
        shard.places.emplace(key, forgotten.begin());  // if this throws, nothing has been kept
        shard.entries.splice(shard.entries.begin(), forgotten, forgotten.begin());
        shard.bytes += bytes;
    }

    /// Bytes held now, overhead included; never above the bound.
    std::size_t size_bytes() {
        std::size_t sum = 0;
        for (Shard& shard : shards_) {
            const MutexLock lock(shard.mutex);
            sum += shard.bytes;
        }
        return sum;
    }

  private:
    struct Entry {
        Key key;
        std::shared_ptr<const Value> value;
        std::size_t bytes = 0;
    };

    struct Shard {
        Mutex mutex;
        std::list<Entry> entries TERRANE_GUARDED_BY(mutex);  // last used first
        std::unordered_map<Key, typename std::list<Entry>::iterator, Hash> places
            TERRANE_GUARDED_BY(mutex);
        std::size_t bytes TERRANE_GUARDED_BY(mutex) = 0;
    };

    // The map inside a shard uses the low bits of the hash; the shard takes the high ones.
    Shard& shard_of(const Key& key) { return shards_[(Hash{}(key) >> 48U) % kShards]; }

    const std::size_t shard_bytes_max_;
    std::array<Shard, kShards> shards_;
};

}  // namespace terrane
