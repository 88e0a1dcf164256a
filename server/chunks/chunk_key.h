// What can be asked of the service: a chunk in a format, one column, a tile of 3D Tiles, a picture.
// Values, checked at the edge.
#pragma once

#include "protocol/base/coords.h"
#include "protocol/wire/messages.h"
#include "server/render/picture_keys.h"

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

/// A whole stack as one GLB, at level 0 too. `centred`: the square of that level's size around
/// column (0, 0) instead of a stack, which is what a quadtree of the world has for a root; x and z
/// are 0 then.
struct TileKey {
    StackPos position;
    bool centred = false;

    friend auto operator<=>(const TileKey&, const TileKey&) = default;
};

/// One thing to make: a chunk, the limits of one level-0 column, a tile of 3D Tiles, a picture.
/// kRequestKinds (counters.h) names them in this order.
using WorkKey = std::variant<ChunkKey, ColumnPos, TileKey, MapTile, Section>;

/// Where a key's job stands: work on one stack is one job, so that the stack is made once. Levels
/// from kJobsBesideStacks on are no stacks but names for what is made of many of them.
inline constexpr std::int32_t kJobsBesideStacks = 64;

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

    std::size_t operator()(const ColumnPos& column) const {
        return mix(mix(1, column.x), column.z);
    }

    std::size_t operator()(const TileKey& tile) const {
        return mix((*this)(tile.position), tile.centred ? 3 : 2);
    }

    std::size_t operator()(const MapTile& tile) const {
        return mix(mix(mix(4, tile.zoom), tile.x), tile.y);
    }

    std::size_t operator()(const Section& section) const {
        const std::size_t ends =
            mix((*this)(section.from), static_cast<std::int64_t>((*this)(section.to)));
        return mix(mix(ends, section.height_voxels), section.scale);
    }

    std::size_t operator()(const WorkKey& work) const { return std::visit(*this, work); }

  private:
    // The finaliser of MurmurHash3 (Austin Appleby, public domain): every bit reaches every bit.
    static constexpr std::uint64_t mix(std::uint64_t seed, std::int64_t value) {
        std::uint64_t h = (seed + 0x9e3779b97f4a7c15U) ^ static_cast<std::uint64_t>(value);
        h = (h ^ (h >> 33U)) * 0xff51afd7ed558ccdU;
        h = (h ^ (h >> 33U)) * 0xc4ceb9fe1a85ec53U;
        return h ^ (h >> 33U);
    }
};

/// The job that a piece of work belongs to. A column's stack must fit int32 (checked by the
/// service).
inline StackPos stack_of(const WorkKey& work, std::int32_t side_columns) {
    if (const auto* chunk = std::get_if<ChunkKey>(&work)) {
        return stack_of(chunk->position);
    }
    if (const auto* column = std::get_if<ColumnPos>(&work)) {
        return stack_of(*column, side_columns);
    }
    if (const auto* tile = std::get_if<TileKey>(&work)) {
        StackPos at = tile->position;
        at.lod += tile->centred ? kJobsBesideStacks : 0;
        return at;
    }
    if (const auto* map = std::get_if<MapTile>(&work)) {
        return {.lod = 2 * kJobsBesideStacks + map->zoom, .x = map->x, .z = map->y};
    }
    const std::uint64_t name = KeyHash{}(work);  // two of one name would only share a worker's turn
    return {.lod = 3 * kJobsBesideStacks,
            .x = static_cast<std::int32_t>(name >> 32U),
            .z = static_cast<std::int32_t>(name)};
}

}  // namespace terrane
