// The columns that a client holds: COLUMNS chunks put together to whole stacks again, and what can
// be read from them: meshes, cuts, single columns.
//
// A chunk has its own N x N columns only, cut at its floor and ceiling. Meshing needs one column
// more on each side, so the room keeps every stack it has and takes that apron from the neighbours:
// from the same level, else from a finer one, whose columns include ours, else from a coarser one.
// A stack is complete once all chunks of its height have come.
//
// All stacks share one palette, in which equal contents have equal ids. No threads, no files, no
// exceptions: this runs in a browser.
#pragma once

#include "generator/mesh/height_field.h"
#include "generator/mesh/mesh.h"
#include "generator/mesh/surface_nets.h"
#include "generator/volume/chunk.h"
#include "generator/volume/stack.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

namespace terrane {

/// What a mesh is made of. Caves and veins are made as if they alone were solid.
enum class MeshOf : std::uint8_t { surface, caves, veins };

/// Beyond this number of stacks a chunk is refused: some 150 KB each.
inline constexpr std::size_t kStacksMax = 8192;

/// A stack that is on its way or here: `columns` has the N x N columns, ids of the room's palette.
struct HeldStack {
    std::vector<std::optional<Chunk>> chunks;  ///< by y; emptied when put together
    std::size_t missing = 0;
    ColumnGrid columns;

    bool is_complete() const { return missing == 0; }
};

class ColumnRoom {
  public:
    /// `heights_per_stack`: chunks that a stack of level 0 has, from y = 0 up. Of the world its
    /// grid is read and what mesh_world() takes.
    ColumnRoom(WorldDefinition world, std::int32_t heights_per_stack);

    /// Decodes the chunk and keeps it; true if its stack is complete now. Chunks below the ground
    /// or above the height bound are accepted and forgotten.
    Result<bool> put(std::span<const std::byte> chunk_bytes);

    /// The same for a chunk that is one content throughout.
    Result<bool> put_uniform(ChunkPos position, const PaletteEntry& content);

    /// Forgets a stack and all its chunks.
    void drop(StackPos position);

    /// The stack's columns, or null if it is not complete.
    const HeldStack* find(StackPos position) const;

    const Palette& palette() const { return palette_; }

    const WorldDefinition& world() const { return world_; }

    std::size_t stack_count() const { return stacks_.size(); }

    /// The columns that are held take this much memory.
    std::size_t column_bytes() const;

    /// Overwrites `out`; false if the stack is not complete. Level 0: `heights` of surface nets,
    /// positions relative to heights.first. Levels above: the height field with its skirts. The
    /// surface is the server's, water and parts included; caves and veins have no parts.
    bool mesh(Mesh& out, StackPos position, MeshOf what, HeightRange heights);

    /// A column of level 0 from the finest stack that is held there, or empty. From a coarser
    /// level it is the nearest column before it.
    std::span<const Limit> column_at(std::int64_t x, std::int64_t z) const;

  private:
    using StackKey = std::uint64_t;

    Result<HeldStack*> stack_to_fill(ChunkPos position);
    Result<bool> put_chunk(Chunk chunk);
    Result<void> join(HeldStack& stack, std::span<const Chunk> chunks);
    Result<std::uint16_t> intern(const PaletteEntry& entry);
    void find_tile(Stack& out, StackPos position, MeshOf what) const;
    std::span<const Limit> lattice_column(std::int32_t lod, std::int64_t x, std::int64_t z) const;

    WorldDefinition world_;
    std::int32_t heights_per_stack_;
    Palette palette_;
    std::unordered_multimap<std::uint64_t, std::uint16_t> ids_by_hash_;
    std::map<StackPos, HeldStack> stacks_;
    SurfaceNetsMesher surface_mesher_;
    HeightFieldMesher tile_mesher_;
    SurfaceNetsMesher inside_mesher_;  ///< of caves and veins: knows no water and no parts
    Stack tile_;
};

}  // namespace terrane
