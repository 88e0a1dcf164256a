// The columns that a client has received: voxels, whole columns, ground under a foot, and meshes
// made here instead of on the server. No Draco is needed.
//
// A chunk carries its own N x N columns from its floor to its ceiling. A mesh needs a little more:
// one column on each side, since a surface's quads reach there, and five voxels below and above,
// since normals look that far. So a mesh is made of the chunk and its neighbours: the eight beside
// it at levels above 0, at level 0 those above and below them too.
//
// In a landscape a mesh tells ground, caves and water apart (mesh.h). A cave is what has
// kCaveRoofVoxels of rock overhead, all rock counted together however far up it lies. So at level 0
// such a mesh needs every chunk above, up to the height bound; most are empty and cost nothing.
//
// What the map does not hold of all these is named by `missing_for_mesh`; all of them together give
// exactly the server's mesh: its vertices, triangles and parts in its order.
#pragma once

#include "generator/mesh/height_field.h"
#include "generator/mesh/mesh.h"
#include "generator/mesh/surface_nets.h"
#include "generator/volume/chunk.h"
#include "generator/volume/stack.h"
#include "generator/volume/voxel.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

namespace terrane {

/// A place in voxels of level 0.
struct VoxelPos {
    std::int64_t x = 0;
    std::int64_t y = 0;
    std::int64_t z = 0;
};

/// One column as far as it is held: limits bottom first, ids of its own palette.
struct HeldColumn {
    std::vector<Limit> limits;
    Palette palette;
};

/// What a mesh does beside a neighbour that is not held.
enum class MissingNeighbour : std::uint8_t {
    refuse,  ///< no mesh
    repeat,  ///< the last column is repeated: at the rim of what is held, where a coarser level
             ///< begins and its skirts hide the seam. Takes finer columns where those are held.
             ///< Rock counts as overhead up to the first chunk that is not held, so that a cave
             ///< may be called ground.
};

/// One thread at a time. It holds what it is given until `forget`: the view bounds it.
class ColumnMap {
  public:
    /// Copies what it needs of the hello.
    explicit ColumnMap(const ServerHello& world);

    /// Keeps an answer of format COLUMNS, full, empty or uniform. Fails with `malformed` or
    /// `too_large` if the payload is not what the answer says, `invalid_argument` for another
    /// format.
    Result<void> put(const ChunkAnswer& answer, std::span<const std::byte> payload);

    /// Keeps a chunk that read_chunk gave.
    void put(Chunk chunk);

    void forget(ChunkPos key);

    bool holds(ChunkPos key) const { return find(key) != nullptr; }

    /// Null if it is not held.
    const Chunk* find(ChunkPos key) const;

    std::size_t size() const { return size_; }

    /// Nothing where no chunk of level 0 is held.
    std::optional<Voxel> voxel(VoxelPos place) const;

    /// True for rock, false for air and caves.
    std::optional<bool> is_solid(VoxelPos place) const;

    /// The whole column, put together from the chunks of its stack; nothing if one is missing.
    std::optional<HeldColumn> column(ColumnPos place) const;

    /// Height in voxels of the highest solid at or under `from_y` that has air or a cave over it:
    /// where a body standing at `from_y` or falling comes to rest. Nothing if the column isn't
    /// held.
    std::optional<double> ground_under(ColumnPos place, double from_y) const;

    /// The chunks that a mesh of `key` needs and the map lacks, itself included.
    std::vector<ChunkPos> missing_for_mesh(ChunkPos key) const;

    /// The mesh of a held chunk as the server would make it, parts included; empty where no surface
    /// is. Positions as in mesh.h. Fails with `not_found`, naming a chunk that is missing; `repeat`
    /// makes do with the chunk itself and those of its stack within five voxels of it.
    Result<Mesh> mesh(ChunkPos key, MissingNeighbour missing = MissingNeighbour::refuse);

  private:
    class Gathering;

    /// Chunks of a stack, all ends included.
    struct Heights {
        std::int32_t first = 0;
        std::int32_t last = 0;
        std::int32_t highest = 0;  ///< those over `last` are for the rock overhead
    };

    using HeldStack = std::map<std::int32_t, Chunk>;  ///< by y

    /// Its content throughout, as the answer to a uniform chunk says it.
    Chunk uniform_chunk(const ChunkAnswer& answer) const;
    bool is_water(const PaletteEntry& entry) const;
    Heights whole_stack(std::int32_t lod) const;
    Heights heights_for_mesh(ChunkPos key) const;

    std::int32_t side_;
    std::int32_t height_;
    std::int32_t heights_;  ///< chunks of a stack of level 0
    ServerHello hello_;
    std::map<StackPos, HeldStack> stacks_;
    std::size_t size_ = 0;
    SurfaceNetsMesher surface_mesher_;
    HeightFieldMesher tile_mesher_;
};

}  // namespace terrane
