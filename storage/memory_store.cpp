#include "storage/memory_store.h"

#include "protocol/base/bytes.h"
#include "protocol/base/mutex.h"
#include "protocol/base/result.h"
#include "storage/chunk_store.h"
#include "storage/record.h"

#include <cstddef>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

namespace terrane {

MemoryStore::MemoryStore(StoreIdentity identity, std::size_t bytes_max)
    : identity_(std::move(identity)), bytes_max_(bytes_max) {}

std::optional<Bytes> MemoryStore::find(const RecordKey& key) {
    ++gets_;
    const std::string encoded = encode_key(identity_, key);
    SharedBytes framed;
    {
        const MutexLock lock(mutex_);
        const auto found = by_key_.find(encoded);
        if (found == by_key_.end()) {
            return std::nullopt;
        }
        framed = found->second->framed;
    }
    const auto value = unframe_value(encoded, *framed);
    if (!value) {
        ++corrupt_;
        return std::nullopt;
    }
    ++hits_;
    return Bytes(value->begin(), value->end());
}

Result<std::optional<Bytes>> MemoryStore::get(const RecordKey& key) {
    return find(key);
}

Result<std::vector<std::optional<Bytes>>> MemoryStore::get_many(std::span<const RecordKey> keys) {
    std::vector<std::optional<Bytes>> values;
    values.reserve(keys.size());
    for (const RecordKey& key : keys) {
        values.push_back(find(key));
    }
    return values;
}

void MemoryStore::remove(std::unordered_map<std::string_view, Entries::iterator>::iterator found) {
    const Entries::iterator entry = found->second;
    bytes_ -= entry->bytes();
    by_key_.erase(found);
    oldest_first_.erase(entry);
}

void MemoryStore::insert(Entry entry) {
    const MutexLock lock(mutex_);
    if (const auto found = by_key_.find(entry.key); found != by_key_.end()) {
        remove(found);
    }
    if (entry.bytes() > bytes_max_) {
        return;
    }
    while (bytes_ + entry.bytes() > bytes_max_) {
        remove(by_key_.find(oldest_first_.front().key));
    }
    bytes_ += entry.bytes();
    oldest_first_.push_back(std::move(entry));
    const Entries::iterator last = std::prev(oldest_first_.end());
    by_key_.emplace(last->key, last);
}

Result<void> MemoryStore::put(std::span<const RecordToPut> records) {
    for (const RecordToPut& record : records) {
        std::string key = encode_key(identity_, record.key);
        Bytes framed;
        frame_value(framed, key, record.value);
        insert({.key = std::move(key), .framed = std::make_shared<const Bytes>(std::move(framed))});
        ++puts_;
    }
    return {};
}

Result<void> MemoryStore::erase(const RecordKey& key) {
    const std::string encoded = encode_key(identity_, key);
    const MutexLock lock(mutex_);
    if (const auto found = by_key_.find(encoded); found != by_key_.end()) {
        remove(found);
    }
    return {};
}

Result<void> MemoryStore::flush() {
    return {};
}

StoreStats MemoryStore::stats() const {
    return {.gets = gets_,
            .hits = hits_,
            .puts = puts_,
            .corrupt = corrupt_,
            .failures = 0,
            .memtable_bytes = bytes()};
}

std::size_t MemoryStore::bytes() const {
    const MutexLock lock(mutex_);
    return bytes_;
}

}  // namespace terrane
