// Surface nets straight from limits: a smooth mesh of the solid's surface in one chunk.
#pragma once

#include <cstdint>
#include <memory>

#include "generator/mesh/mesh.h"
#include "generator/volume/stack.h"
#include "generator/world/world_definition.h"

namespace terrane {

/// One worker's mesher and its buffers. Belongs to one thread at a time; its contents never change
/// results.
class SurfaceNetsMesher {
  public:
    explicit SurfaceNetsMesher(const WorldDefinition& definition);
    ~SurfaceNetsMesher();
    SurfaceNetsMesher(SurfaceNetsMesher&&) noexcept;
    SurfaceNetsMesher& operator=(SurfaceNetsMesher&&) noexcept;

    /// Overwrites `out` with the mesh of the lattice edges that start in heights
    /// [y * height, (y + 1) * height) at the stack's own N x N columns. Neighbouring chunks, sideways
    /// and above, meet without cracks. `out` is empty where there is no surface.
    void mesh(Mesh& out, const Stack& stack, std::int32_t y, std::int32_t height);

  private:
    struct Buffers;
    std::unique_ptr<Buffers> buffers_;
};

}  // namespace terrane
