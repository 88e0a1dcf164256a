// Voxels as blocks straight from limits: the mesh of a chunk with flat, square faces.
//
// A voxel is solid where its centre is in the solid, and has the material with the largest share
// there. Every frontier between a solid voxel and one that is not is a face; faces of one
// direction, plane and material are merged into rectangles.
#pragma once

#include "generator/mesh/mesh.h"
#include "generator/mesh/surface_nets.h"
#include "generator/volume/stack.h"
#include "generator/world/world_definition.h"

#include <cstdint>
#include <memory>

namespace terrane {

/// One worker's mesher and its buffers. Belongs to one thread at a time; its contents never change
/// results. Once the buffers have grown to the largest stack and mesh seen, nothing is allocated.
class BlockyMesher {
  public:
    explicit BlockyMesher(const WorldDefinition& definition);
    ~BlockyMesher();
    BlockyMesher(BlockyMesher&&) noexcept;
    BlockyMesher& operator=(BlockyMesher&&) noexcept;

    /// Overwrites `out` with the faces of the solid voxels in heights [y * height, (y + 1) *
    /// height) of the stack's own N x N columns: over all chunks every face is there once. What
    /// lies under y = 0 is solid ground; its tops at y = 0, where a column begins hollow, belong to
    /// the chunk y = 0, so chunks below have none. Four vertices a rectangle, on whole voxels from
    /// 0 to N and 0 to `height`, with a flat normal and the material's own colour. Water has the
    /// surface that the smooth style gives it.
    void mesh(Mesh& out, const Stack& stack, std::int32_t y, std::int32_t height);

    /// The same for any range of heights, positions being relative to heights.first. Needs:
    /// first <= last, at most 2^22 apart.
    void mesh(Mesh& out, const Stack& stack, HeightRange heights);

  private:
    struct Buffers;
    std::unique_ptr<Buffers> buffers_;
};

}  // namespace terrane
