#include "client-sample/typescript/wasm/column_room.h"

#include "generator/mesh/mesh.h"
#include "generator/mesh/mesh_world.h"
#include "generator/mesh/water_surface.h"
#include "generator/volume/chunk.h"
#include "generator/volume/chunk_codec.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace terrane {
namespace {

std::uint64_t hash_of(const PaletteEntry& entry) {
    std::uint64_t hash = static_cast<std::uint64_t>(entry.kind) * 2 + (entry.alone ? 1 : 0);
    for (const Share& share : entry.composition.shares()) {
        hash = (hash ^ share.material) * 0x9e3779b97f4a7c15U;
        hash = (hash ^ std::bit_cast<std::uint64_t>(share.concentration)) * 0xff51afd7ed558ccdU;
        hash ^= hash >> 32U;
    }
    return hash;
}

/// Appends what a chunk adds to a column that reaches up to its floor. The column's last limit may
/// be the first one at or above the floor; the chunk has it again.
void append_part(Limits& column, std::size_t first, std::span<const Limit> part,
                 std::int32_t floor256) {
    while (column.size() > first && column.back().y256 > floor256) {
        column.pop_back();
    }
    for (const Limit& limit : part) {
        const bool is_known =
            column.size() > first && limit.y256 <= floor256 &&
            (limit.y256 < floor256 ||
             (column.back().y256 == floor256 && column.back().palette_id == limit.palette_id));
        if (!is_known) {
            column.push_back(limit);
        }
    }
}

/// A chunk over a column's top ends it with a void at its ceiling, which is no limit of the column.
/// Water is a void of another content: its surface stays.
void trim_air(Limits& column, std::size_t first, const Palette& palette) {
    const auto is_air = [&](const PaletteEntry& entry, const PaletteEntry& below) {
        return entry.kind == PaletteKind::void_ && below.kind == PaletteKind::void_ &&
               entry.composition == below.composition;
    };
    while (column.size() > first + 1 && is_air(palette[column.back().palette_id],
                                               palette[column[column.size() - 2].palette_id])) {
        column.pop_back();
    }
}

std::vector<Material> plain(std::vector<Material> materials) {
    for (Material& material : materials) {
        material.kind = MaterialKind::regular;
    }
    return materials;
}

}  // namespace

ColumnRoom::ColumnRoom(WorldDefinition world, std::int32_t heights_per_stack)
    : world_(std::move(world)),
      heights_per_stack_(heights_per_stack),
      surface_mesher_(world_),
      tile_mesher_(world_),
      inside_mesher_(mesh_world(plain(world_.materials), false)) {}

Result<HeldStack*> ColumnRoom::stack_to_fill(ChunkPos position) {
    const StackPos key = stack_of(position);
    const auto found = stacks_.find(key);
    if (found != stacks_.end()) {
        return &found->second;
    }
    if (stacks_.size() >= kStacksMax) {
        return fail(ErrorCode::too_large,
                    "columns: " + std::to_string(kStacksMax) + " stacks are held; drop some first");
    }
    const std::size_t heights =
        position.lod == 0 ? static_cast<std::size_t>(heights_per_stack_) : std::size_t{1};
    HeldStack& stack = stacks_[key];
    stack.chunks.resize(heights);
    stack.missing = heights;
    return &stack;
}

Result<bool> ColumnRoom::put(std::span<const std::byte> chunk_bytes) {
    auto chunk = decode_chunk(chunk_bytes, world_.materials.size());
    if (!chunk) {
        return tl::unexpected(chunk.error());
    }
    if (!chunk->uniform && (chunk->side != world_.grid.side ||
                            (chunk->position.lod == 0 && chunk->height != world_.grid.height))) {
        return fail(ErrorCode::malformed, "columns: " + std::to_string(chunk->side) + " x " +
                                              std::to_string(chunk->height) +
                                              " voxels are not this world's chunks");
    }
    return put_chunk(std::move(*chunk));
}

Result<bool> ColumnRoom::put_uniform(ChunkPos position, const PaletteEntry& content) {
    Chunk chunk;
    chunk.position = position;
    chunk.side = world_.grid.side;
    chunk.height = world_.grid.height;
    chunk.uniform = true;
    chunk.uniform_content = content;
    return put_chunk(std::move(chunk));
}

Result<bool> ColumnRoom::put_chunk(Chunk chunk) {
    const ChunkPos position = chunk.position;
    if (position.lod < 0 || position.lod > kLodMax || position.y < 0 ||
        position.y >= (position.lod == 0 ? heights_per_stack_ : 1)) {
        return false;
    }
    const auto stack = stack_to_fill(position);
    if (!stack) {
        return tl::unexpected(stack.error());
    }
    HeldStack& held = **stack;
    if (held.is_complete()) {
        return true;
    }
    auto& place = held.chunks[static_cast<std::size_t>(position.y)];
    held.missing -= place ? 0 : 1;
    place = std::move(chunk);
    if (!held.is_complete()) {
        return false;
    }
    std::vector<Chunk> chunks;
    chunks.reserve(held.chunks.size());
    for (std::optional<Chunk>& chunk : held.chunks) {
        if (chunk) {  // as all are
            chunks.push_back(*std::move(chunk));
        }
    }
    held.chunks.clear();
    if (auto joined = join(held, chunks); !joined) {
        stacks_.erase(stack_of(position));
        return tl::unexpected(joined.error());
    }
    return true;
}

Result<std::uint16_t> ColumnRoom::intern(const PaletteEntry& entry) {
    const std::uint64_t hash = hash_of(entry);
    const auto [first, last] = ids_by_hash_.equal_range(hash);
    for (auto at = first; at != last; ++at) {
        if (palette_[at->second] == entry) {
            return at->second;
        }
    }
    if (palette_.size() >= kPaletteEntriesMax) {
        return fail(ErrorCode::too_large, "columns: more than " +
                                              std::to_string(kPaletteEntriesMax) +
                                              " different contents; start again");
    }
    const auto id = static_cast<std::uint16_t>(palette_.size());
    palette_.push_back(entry);
    ids_by_hash_.emplace(hash, id);
    return id;
}

Result<void> ColumnRoom::join(HeldStack& stack, std::span<const Chunk> chunks) {
    const std::int32_t side = world_.grid.side;
    std::vector<std::vector<std::uint16_t>> ids(chunks.size());
    for (std::size_t y = 0; y < chunks.size(); ++y) {
        const Chunk& chunk = chunks[y];
        const std::span<const PaletteEntry> entries =
            chunk.uniform ? std::span(&chunk.uniform_content, 1) : std::span(chunk.palette);
        for (const PaletteEntry& entry : entries) {
            const auto id = intern(entry);
            if (!id) {
                return tl::unexpected(id.error());
            }
            ids[y].push_back(*id);
        }
    }
    ColumnGrid& grid = stack.columns;
    grid = {
        .x_first = 0, .z_first = 0, .width = side, .length = side, .offsets = {0}, .limits = {}};
    Limits part;
    for (std::int32_t z = 0; z < side; ++z) {
        for (std::int32_t x = 0; x < side; ++x) {
            const std::size_t first = grid.limits.size();
            for (std::size_t y = 0; y < chunks.size(); ++y) {
                const Chunk& chunk = chunks[y];
                const std::int32_t height256 = chunk.height * kUnitsPerVoxel;
                const std::int32_t floor256 = static_cast<std::int32_t>(y) * height256;
                part.clear();
                if (chunk.uniform) {
                    const Flow flow = grid.limits.size() > first && chunk.uniform_content.is_solid()
                                          ? grid.limits.back().flow
                                          : Flow{};
                    part.push_back({.y256 = floor256, .palette_id = ids[y][0], .flow = flow});
                    part.push_back(
                        {.y256 = floor256 + height256, .palette_id = ids[y][0], .flow = flow});
                } else {
                    for (Limit limit : chunk.columns.column(x, z)) {
                        limit.palette_id = ids[y][limit.palette_id];
                        part.push_back(limit);
                    }
                }
                append_part(grid.limits, first, part, floor256);
            }
            trim_air(grid.limits, first, palette_);
            grid.offsets.push_back(static_cast<std::uint32_t>(grid.limits.size()));
        }
    }
    grid.limits.shrink_to_fit();
    return {};
}

void ColumnRoom::drop(StackPos position) {
    stacks_.erase(position);
}

const HeldStack* ColumnRoom::find(StackPos position) const {
    const auto found = stacks_.find(position);
    return found != stacks_.end() && found->second.is_complete() ? &found->second : nullptr;
}

std::size_t ColumnRoom::column_bytes() const {
    std::size_t bytes = 0;
    for (const auto& [position, stack] : stacks_) {
        bytes += stack.columns.limits.size() * sizeof(Limit) +
                 stack.columns.offsets.size() * sizeof(std::uint32_t);
        for (const auto& chunk : stack.chunks) {
            bytes += chunk ? chunk->columns.limits.size() * sizeof(Limit) : 0;
        }
    }
    return bytes;
}

std::span<const Limit> ColumnRoom::lattice_column(std::int32_t lod, std::int64_t x,
                                                  std::int64_t z) const {
    const std::int64_t side = world_.grid.side;
    const auto column_of = [&](std::int32_t level, std::int64_t cx,
                               std::int64_t cz) -> std::span<const Limit> {
        const HeldStack* const stack = find({.lod = level,
                                             .x = static_cast<std::int32_t>(floor_div(cx, side)),
                                             .z = static_cast<std::int32_t>(floor_div(cz, side))});
        return stack == nullptr
                   ? std::span<const Limit>()
                   : stack->columns.column(static_cast<std::int32_t>(floor_mod(cx, side)),
                                           static_cast<std::int32_t>(floor_mod(cz, side)));
    };
    for (std::int32_t level = lod; level >= 0; --level) {
        const std::int64_t scale = std::int64_t{1} << (lod - level);
        if (const auto found = column_of(level, x * scale, z * scale); !found.empty()) {
            return found;
        }
    }
    for (std::int32_t level = lod + 1; level <= kLodMax; ++level) {
        const std::int64_t scale = std::int64_t{1} << (level - lod);
        if (const auto found = column_of(level, floor_div(x, scale), floor_div(z, scale));
            !found.empty()) {
            return found;
        }
    }
    return {};
}

std::span<const Limit> ColumnRoom::column_at(std::int64_t x, std::int64_t z) const {
    return lattice_column(0, x, z);
}

void ColumnRoom::find_tile(Stack& out, StackPos position, MeshOf what) const {
    const std::int32_t side = world_.grid.side;
    const HeldStack& own = *find(position);
    out.position = position;
    out.side = side;
    out.palette = palette_;
    for (PaletteEntry& entry : out.palette) {
        if (what != MeshOf::surface) {
            const PaletteKind solid = what == MeshOf::caves ? PaletteKind::cave : PaletteKind::vein;
            entry.kind = entry.kind == solid ? PaletteKind::layer : PaletteKind::void_;
        }
    }
    ColumnGrid& grid = out.columns;
    grid.x_first = grid.z_first = -1;
    grid.width = grid.length = side + 2;
    grid.offsets.assign(1, 0);
    grid.limits.clear();
    out.highest_y256 = 0;
    for (std::int32_t z = -1; z <= side; ++z) {
        for (std::int32_t x = -1; x <= side; ++x) {
            const bool is_own = x >= 0 && x < side && z >= 0 && z < side;
            std::span<const Limit> column =
                is_own ? own.columns.column(x, z)
                       : lattice_column(position.lod, std::int64_t{position.x} * side + x,
                                        std::int64_t{position.z} * side + z);
            if (column.empty()) {
                column = own.columns.column(std::clamp(x, 0, side - 1), std::clamp(z, 0, side - 1));
            }
            grid.limits.insert(grid.limits.end(), column.begin(), column.end());
            grid.offsets.push_back(static_cast<std::uint32_t>(grid.limits.size()));
            out.highest_y256 = std::max(out.highest_y256, column.back().y256);
        }
    }
}

bool ColumnRoom::mesh(Mesh& out, StackPos position, MeshOf what, HeightRange heights) {
    out.clear();
    if (find(position) == nullptr) {
        return false;
    }
    find_tile(tile_, position, what);
    if (what != MeshOf::surface) {
        inside_mesher_.mesh(out, tile_, heights);
    } else if (position.lod == 0) {
        surface_mesher_.mesh(out, tile_, heights);
    } else {
        tile_mesher_.mesh(out, tile_, true);
    }
    return true;
}

}  // namespace terrane
