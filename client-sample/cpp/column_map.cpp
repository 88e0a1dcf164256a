#include "client-sample/cpp/column_map.h"

#include "client-sample/cpp/chunk_reader.h"
#include "client-sample/cpp/view_set.h"
#include "generator/mesh/mesh.h"
#include "generator/mesh/mesh_world.h"
#include "generator/volume/chunk.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/volume/voxel.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace terrane {

namespace {

/// Voxels below and above a chunk that its mesh depends on: a cell, and kDistanceMax256 of it.
constexpr std::int32_t kReachVoxels = 5;

/// All that the meshers read of a definition.
WorldDefinition mesh_world_of(const ServerHello& world) {
    static_assert(static_cast<int>(MaterialKind::water) ==
                  static_cast<int>(WireMaterialKind::water));
    std::vector<Material> materials;
    for (const WireMaterial& wire : world.materials) {
        Material material;
        material.color = {.r = static_cast<std::uint8_t>(wire.color_rgb >> 16U),
                          .g = static_cast<std::uint8_t>(wire.color_rgb >> 8U),
                          .b = static_cast<std::uint8_t>(wire.color_rgb)};
        material.kind = static_cast<MaterialKind>(wire.kind);
        materials.push_back(std::move(material));
    }
    return mesh_world(std::move(materials), world.mesh_parts);
}

std::string to_text(ChunkPos key) {
    return "chunk " + std::to_string(key.lod) + "/" + std::to_string(key.x) + "/" +
           std::to_string(key.y) + "/" + std::to_string(key.z);
}

/// A stack of consecutive heights, and where each chunk's palette begins in the joined one.
struct Piece {
    const Chunk* chunk = nullptr;
    std::size_t palette_first = 0;
};

/// Appends what a chunk knows of a column to what those below it know. Both have the limits next to
/// the floor between them, which must not come twice; and a chunk above a column's top ends it with
/// a void at its ceiling, which is no limit of the column.
template <typename LimitList>
void append_part(LimitList& column, std::size_t first, const Piece& piece, std::int32_t x,
                 std::int32_t z, const Palette& palette) {
    const auto add = [&](Limit limit) {
        limit.palette_id = static_cast<std::uint16_t>(limit.palette_id + piece.palette_first);
        const bool is_known = column.size() > first && column.back().y256 == limit.y256 &&
                              column.back().flow == limit.flow &&
                              palette[column.back().palette_id] == palette[limit.palette_id];
        if (!is_known) {
            column.push_back(limit);
        }
    };
    const Chunk& chunk = *piece.chunk;
    const std::int64_t floor256 = std::int64_t{chunk.position.y} * chunk.height * kUnitsPerVoxel;
    const auto limits = chunk.uniform ? std::span<const Limit>() : chunk.columns.column(x, z);
    const std::int64_t begin256 = chunk.uniform ? floor256 : limits.front().y256;
    while (column.size() > first && column.back().y256 > begin256) {
        column.pop_back();
    }
    if (chunk.uniform) {
        const std::int64_t ceiling256 = floor256 + std::int64_t{chunk.height} * kUnitsPerVoxel;
        for (const std::int64_t y256 : {floor256, ceiling256}) {
            add({.y256 = static_cast<std::int32_t>(y256), .palette_id = 0, .flow = {}});
        }
        return;
    }
    for (const Limit& limit : limits) {
        add(limit);
    }
}

}  // namespace

/// Joins pieces to columns; finds each stack's pieces once.
class ColumnMap::Gathering {
  public:
    Gathering(const ColumnMap& map, Palette& palette) : map_(map), palette_(palette) {}

    /// The stack's chunks; null if one from `first` to `last` is not held.
    const std::vector<Piece>* find(StackPos stack, Heights heights) {
        const auto known = pieces_.find(stack);
        if (known != pieces_.end()) {
            const std::optional<std::vector<Piece>>& held = known->second;
            return held ? &*held : nullptr;
        }
        std::optional<std::vector<Piece>>& pieces = pieces_[stack];
        const auto chunks = chunks_of(stack, heights);
        if (chunks.empty()) {
            return nullptr;
        }
        pieces.emplace();
        for (const Chunk* chunk : chunks) {
            pieces->push_back({.chunk = chunk, .palette_first = palette_.size()});
            if (chunk->uniform) {
                palette_.push_back(chunk->uniform_content);
            } else {
                palette_.insert(palette_.end(), chunk->palette.begin(), chunk->palette.end());
            }
        }
        return &*pieces;
    }

    /// The column that is number (x, z) of level `lod`, from that level or a finer one, which has
    /// the same column (in a landscape with caves and overhangs too). False if none is held.
    bool append(Limits& out, std::int32_t lod, ColumnPos place, Heights heights) {
        for (std::int32_t level = lod; level >= 0; --level) {
            const std::int64_t x = place.x << (lod - level);
            const std::int64_t z = place.z << (lod - level);
            const StackPos stack{.lod = level,
                                 .x = static_cast<std::int32_t>(floor_div(x, map_.side_)),
                                 .z = static_cast<std::int32_t>(floor_div(z, map_.side_))};
            const Heights own = level == lod ? heights : map_.whole_stack(level);
            if (const auto* pieces = find(stack, own)) {
                append(out, *pieces,
                       {.x = floor_mod(x, map_.side_), .z = floor_mod(z, map_.side_)});
                return true;
            }
        }
        return false;
    }

    template <typename LimitList>
    void append(LimitList& out, std::span<const Piece> pieces, ColumnPos local) const {
        const std::size_t first = out.size();
        for (const Piece& piece : pieces) {
            append_part(out, first, piece, static_cast<std::int32_t>(local.x),
                        static_cast<std::int32_t>(local.z), palette_);
        }
        // Water is a void of another content: its surface stays.
        const auto entry = [&](std::size_t i) -> const PaletteEntry& {
            return palette_[out[i].palette_id];
        };
        while (out.size() > first + 1 && entry(out.size() - 1).kind == PaletteKind::void_ &&
               entry(out.size() - 2).kind == PaletteKind::void_ &&
               entry(out.size() - 1).composition == entry(out.size() - 2).composition) {
            out.pop_back();
        }
    }

  private:
    /// Bottom first; none if one that must be is not held. Of the air over all that is there one
    /// chunk is enough.
    std::vector<const Chunk*> chunks_of(StackPos stack, Heights heights) const {
        std::vector<const Chunk*> chunks;
        const auto held = map_.stacks_.find(stack);
        if (held == map_.stacks_.end()) {
            return chunks;
        }
        for (std::int32_t y = heights.first; y <= heights.highest; ++y) {
            const auto chunk = held->second.find(y);
            if (chunk == held->second.end()) {
                if (y <= heights.last) {
                    return {};
                }
                break;
            }
            chunks.push_back(&chunk->second);
        }
        const auto is_air = [&](const Chunk& chunk) {
            return chunk.uniform && chunk.uniform_content.kind == PaletteKind::void_ &&
                   !map_.is_water(chunk.uniform_content);
        };
        while (chunks.size() > 1 && is_air(*chunks.back()) && is_air(*chunks[chunks.size() - 2])) {
            chunks.pop_back();
        }
        return chunks;
    }

    const ColumnMap& map_;
    Palette& palette_;
    std::map<StackPos, std::optional<std::vector<Piece>>> pieces_;
};

ColumnMap::ColumnMap(const ServerHello& world)
    : side_(world.chunk_side),
      height_(world.chunk_height),
      heights_(heights_of(0, world)),
      hello_(world),
      surface_mesher_(mesh_world_of(world)),
      tile_mesher_(mesh_world_of(world)) {}

Result<void> ColumnMap::put(const ChunkAnswer& answer, std::span<const std::byte> payload) {
    if (answer.format != ChunkFormat::columns) {
        return fail(ErrorCode::invalid_argument, to_text(answer.key) + " is " +
                                                     std::string(to_string(answer.format)) +
                                                     ", the column map takes columns");
    }
    auto content = read_chunk(answer, payload, hello_);
    if (!content) {
        return tl::unexpected(content.error());
    }
    if (std::optional<Chunk>& chunk = content->chunk) {
        put(*std::move(chunk));
    } else if (answer.status == ChunkStatus::uniform || answer.status == ChunkStatus::empty) {
        put(uniform_chunk(answer));
    }
    return {};
}

void ColumnMap::put(Chunk chunk) {
    const ChunkPos key = chunk.position;
    size_ += stacks_[stack_of(key)].insert_or_assign(key.y, std::move(chunk)).second ? 1U : 0U;
}

void ColumnMap::forget(ChunkPos key) {
    const auto stack = stacks_.find(stack_of(key));
    if (stack == stacks_.end()) {
        return;
    }
    size_ -= stack->second.erase(key.y);
    if (stack->second.empty()) {
        stacks_.erase(stack);
    }
}

/// Its kind follows from its main material: void and caves are the ones that are not solid.
Chunk ColumnMap::uniform_chunk(const ChunkAnswer& answer) const {
    Chunk chunk;
    chunk.position = answer.key;
    chunk.side = side_;
    chunk.height = height_;
    chunk.uniform = true;
    for (const WireShare& share : answer.uniform) {
        if (chunk.uniform_content.composition.count < kCompositionMaterialsMax &&
            share.material < hello_.materials.size()) {
            chunk.uniform_content.composition.add(share.material, share.concentration);
        }
    }
    const auto shares = chunk.uniform_content.composition.shares();
    const bool is_solid = !shares.empty() && hello_.materials[shares[0].material].solid;
    chunk.uniform_content.kind = is_solid ? PaletteKind::layer : PaletteKind::void_;
    return chunk;
}

bool ColumnMap::is_water(const PaletteEntry& entry) const {
    const auto shares = entry.composition.shares();
    return !entry.is_solid() && !shares.empty() &&
           hello_.materials[shares[0].material].kind == WireMaterialKind::water;
}

const Chunk* ColumnMap::find(ChunkPos key) const {
    const auto stack = stacks_.find(stack_of(key));
    if (stack == stacks_.end()) {
        return nullptr;
    }
    const auto found = stack->second.find(key.y);
    return found == stack->second.end() ? nullptr : &found->second;
}

std::optional<Voxel> ColumnMap::voxel(VoxelPos place) const {
    const StackPos stack = stack_of(ColumnPos{.x = place.x, .z = place.z}, side_);
    const std::int64_t y = floor_div(place.y, height_);
    if (y < 0 || y >= heights_) {
        return std::nullopt;
    }
    const Chunk* const chunk =
        find({.lod = 0, .x = stack.x, .y = static_cast<std::int32_t>(y), .z = stack.z});
    if (chunk == nullptr) {
        return std::nullopt;
    }
    if (chunk->uniform) {
        Voxel voxel;
        for (const Share& share : chunk->uniform_content.composition.shares()) {
            voxel.storage[voxel.count++] = share;
        }
        return voxel;
    }
    return voxel_of(*chunk, static_cast<std::int32_t>(floor_mod(place.x, side_)),
                    static_cast<std::int32_t>(floor_mod(place.y, height_)),
                    static_cast<std::int32_t>(floor_mod(place.z, side_)));
}

std::optional<bool> ColumnMap::is_solid(VoxelPos place) const {
    const auto there = voxel(place);
    if (!there) {
        return std::nullopt;
    }
    const auto main = std::ranges::max_element(there->shares(), {}, &Share::concentration);
    return main != there->shares().end() && main->material < hello_.materials.size() &&
           hello_.materials[main->material].solid;
}

std::optional<HeldColumn> ColumnMap::column(ColumnPos place) const {
    HeldColumn column;
    Gathering gathering(*this, column.palette);
    const auto* const pieces = gathering.find(stack_of(place, side_), whole_stack(0));
    if (pieces == nullptr) {
        return std::nullopt;
    }
    gathering.append(column.limits, *pieces,
                     {.x = floor_mod(place.x, side_), .z = floor_mod(place.z, side_)});
    return column;
}

std::optional<double> ColumnMap::ground_under(ColumnPos place, double from_y) const {
    const auto held = column(place);
    if (!held) {
        return std::nullopt;
    }
    const auto is_solid_at = [&](std::size_t i) {
        return held->palette[held->limits[i].palette_id].is_solid();
    };
    double ground = 0;  // the base goes down for ever
    for (std::size_t i = 0; i + 1 < held->limits.size(); ++i) {
        const Limit& low = held->limits[i];
        const Limit& high = held->limits[i + 1];
        if (low.y256 / 256.0 > from_y) {
            break;
        }
        const bool is_interval = low.y256 < high.y256 && is_solid_at(i) && is_solid_at(i + 1);
        const bool has_solid_over =
            i + 2 < held->limits.size() && is_solid_at(i + 1) && is_solid_at(i + 2);
        if (is_interval && !has_solid_over && high.y256 / 256.0 <= from_y) {
            ground = high.y256 / 256.0;
        }
    }
    return ground;
}

ColumnMap::Heights ColumnMap::whole_stack(std::int32_t lod) const {
    const std::int32_t top = lod == 0 ? heights_ - 1 : 0;
    return {.first = 0, .last = top, .highest = top};
}

/// The chunks of each stack that a mesh depends on; none if it is of heights that no stack has.
ColumnMap::Heights ColumnMap::heights_for_mesh(ChunkPos key) const {
    const std::int32_t top = key.lod > 0 ? 0 : heights_ - 1;
    if (key.y < 0 || key.y > top) {
        return {.first = 0, .last = -1, .highest = -1};
    }
    if (key.lod > 0) {
        return {};
    }
    const std::int32_t reach = (kReachVoxels + height_ - 1) / height_;
    const std::int32_t last = std::min(key.y + reach, top);
    return {.first = std::max(key.y - reach, 0),
            .last = last,
            .highest = hello_.mesh_parts ? top : last};
}

std::vector<ChunkPos> ColumnMap::missing_for_mesh(ChunkPos key) const {
    std::vector<ChunkPos> missing;
    const Heights heights = heights_for_mesh(key);
    for (std::int32_t z = -1; z <= 1; ++z) {
        for (std::int32_t x = -1; x <= 1; ++x) {
            const std::int64_t at_x = std::int64_t{key.x} + x;
            const std::int64_t at_z = std::int64_t{key.z} + z;
            if (at_x != static_cast<std::int32_t>(at_x) ||
                at_z != static_cast<std::int32_t>(at_z)) {
                continue;
            }
            const StackPos beside{.lod = key.lod,
                                  .x = static_cast<std::int32_t>(at_x),
                                  .z = static_cast<std::int32_t>(at_z)};
            const auto held = stacks_.find(beside);
            for (std::int32_t y = heights.first; y <= heights.highest; ++y) {
                if (held == stacks_.end() || !held->second.contains(y)) {
                    missing.push_back({.lod = beside.lod, .x = beside.x, .y = y, .z = beside.z});
                }
            }
        }
    }
    return missing;
}

Result<Mesh> ColumnMap::mesh(ChunkPos key, MissingNeighbour missing) {
    const Heights heights = heights_for_mesh(key);
    const auto lacking = missing_for_mesh(key);
    const auto is_fatal = [&](ChunkPos lacked) {
        return missing == MissingNeighbour::refuse ||
               (stack_of(lacked) == stack_of(key) && lacked.y <= heights.last);
    };
    if (const auto found = std::ranges::find_if(lacking, is_fatal); found != lacking.end()) {
        return fail(ErrorCode::not_found, to_text(key) + ": its mesh needs " + to_text(*found) +
                                              ", which is not held; ask for it");
    }
    Mesh mesh;
    if (heights.first > heights.last) {
        return mesh;
    }
    Stack stack;
    stack.position = stack_of(key);
    stack.side = side_;
    stack.columns = {.x_first = -1,
                     .z_first = -1,
                     .width = side_ + 2,
                     .length = side_ + 2,
                     .offsets = {0},
                     .limits = {}};
    Gathering gathering(*this, stack.palette);
    for (std::int32_t z = -1; z <= side_; ++z) {
        for (std::int32_t x = -1; x <= side_; ++x) {
            const ColumnPos place{.x = std::int64_t{key.x} * side_ + x,
                                  .z = std::int64_t{key.z} * side_ + z};
            if (!gathering.append(stack.columns.limits, key.lod, place, heights)) {
                const ColumnPos inside{
                    .x = std::int64_t{key.x} * side_ + std::clamp(x, 0, side_ - 1),
                    .z = std::int64_t{key.z} * side_ + std::clamp(z, 0, side_ - 1)};
                gathering.append(stack.columns.limits, key.lod, inside, heights);
            }
            stack.columns.offsets.push_back(
                static_cast<std::uint32_t>(stack.columns.limits.size()));
            stack.highest_y256 = std::max(stack.highest_y256, stack.columns.limits.back().y256);
        }
    }
    if (stack.palette.size() > std::numeric_limits<std::uint16_t>::max()) {
        return fail(ErrorCode::too_large, to_text(key) + ": " +
                                              std::to_string(stack.palette.size()) +
                                              " compositions around it are too many for one mesh");
    }
    if (key.lod > 0) {
        tile_mesher_.mesh(mesh, stack, true);
    } else {
        surface_mesher_.mesh(mesh, stack, key.y, height_);
    }
    return mesh;
}

}  // namespace terrane
