// What can be asked of the service: a chunk in a format, or one column. Values, checked at the
// edge.
#pragma once

#include "protocol/base/coords.h"
#include "protocol/wire/messages.h"

#include <compare>
#include <cstddef>
#include <cstdint>
#include <variant>

namespace terrane {

/// Levels of detail that this build can generate: 0..levels_supported() - 1.
constexpr std::int32_t levels_supported() {
    return kLodMax + 1;
}

/// `without_flow` means something for columns only; `normalised` clears it elsewhere, so that equal
/// answers have equal keys.
struct ChunkKey {
    ChunkPos position;
    ChunkFormat format = ChunkFormat::draco;
    bool without_flow = false;

    ChunkKey normalised() const {
        ChunkKey key = *this;
        key.without_flow = without_flow && format == ChunkFormat::columns;
        return key;
    }

    friend auto operator<=>(const ChunkKey&, const ChunkKey&) = default;
};

/// One thing to make: a chunk, or the limits of one level-0 column.
using WorkKey = std::variant<ChunkKey, ColumnPos>;

/// The stack that the work is cut out of. A column's stack must fit int32 (checked by the service).
constexpr StackPos stack_of(const WorkKey& work, std::int32_t side_columns) {
    if (const auto* chunk = std::get_if<ChunkKey>(&work)) {
        return stack_of(chunk->position);
    }
    return stack_of(*std::get_if<ColumnPos>(&work), side_columns);
}

/// Spreads keys over shards and buckets; not stable between builds.
class KeyHash {
  public:
    std::size_t operator()(const StackPos& pos) const {
        return mix(mix(mix(0, pos.lod), pos.x), pos.z);
    }

    std::size_t operator()(const ChunkKey& key) const {
        const int kind = static_cast<int>(key.format) * 2 + (key.without_flow ? 1 : 0);
        return mix(mix((*this)(stack_of(key.position)), key.position.y), kind);
    }

    std::size_t operator()(const WorkKey& work) const {
        if (const auto* chunk = std::get_if<ChunkKey>(&work)) {
            return (*this)(*chunk);
        }
        const auto column = *std::get_if<ColumnPos>(&work);
        return mix(mix(1, column.x), column.z);
    }

  private:
    // The finaliser of MurmurHash3 (Austin Appleby, public domain): every bit reaches every bit.
    static constexpr std::uint64_t mix(std::uint64_t seed, std::int64_t value) {
        std::uint64_t h = (seed + 0x9e3779b97f4a7c15U) ^ static_cast<std::uint64_t>(value);
        h = (h ^ (h >> 33U)) * 0xff51afd7ed558ccdU;
        h = (h ^ (h >> 33U)) * 0xc4ceb9fe1a85ec53U;
        return h ^ (h >> 33U);
    }
};

}  // namespace terrane
