// Surface nets straight from limits: a smooth mesh of the solid's surface in one chunk.
#pragma once

#include "generator/mesh/mesh.h"
#include "generator/mesh/water_surface.h"
#include "generator/volume/stack.h"
#include "generator/world/world_definition.h"

#include <cstdint>
#include <memory>

namespace terrane {

struct MeshKernels;

/// One worker's mesher and its buffers. Belongs to one thread at a time; its contents never change
/// results. Once the buffers have grown to the largest stack seen, nothing is allocated.
class SurfaceNetsMesher {
  public:
    explicit SurfaceNetsMesher(const WorldDefinition& definition);
    /// With kernels of one's own choice, for tests: all give the same mesh.
    SurfaceNetsMesher(const WorldDefinition& definition, const MeshKernels& kernels);
    ~SurfaceNetsMesher();
    SurfaceNetsMesher(SurfaceNetsMesher&&) noexcept;
    SurfaceNetsMesher& operator=(SurfaceNetsMesher&&) noexcept;

    /// Overwrites `out` with the mesh of the lattice edges that start in heights
    /// [y * height, (y + 1) * height) at the stack's own N x N columns. Neighbouring chunks,
    /// sideways and above, meet without cracks. `out` is empty where there is no surface; that a
    /// chunk lies above all of its own columns does not make it so: a higher column next door may
    /// need a wall.
    void mesh(Mesh& out, const Stack& stack, std::int32_t y, std::int32_t height);

    /// The same for any range of heights, the whole stack's too: {0, height bound + 1} is every
    /// surface there is, in one mesh. Positions are relative to heights.first, and lie at
    /// -256 <= y < 256 * (last - first). Needs: first <= last, at most 2^22 apart.
    void mesh(Mesh& out, const Stack& stack, HeightRange heights);

  private:
    struct Buffers;
    std::unique_ptr<Buffers> buffers_;
};

}  // namespace terrane
