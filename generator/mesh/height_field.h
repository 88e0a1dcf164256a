// The mesh of a level of detail above 0: the height field of the top of the solid.
//
// Caves and overhangs are for near, so a coarse tile is one vertex a column, (N + 1) x (N + 1) of
// them at the level's own columns, which have level 0's heights. x and z are in columns of the
// level, y in voxels, at every level: scale x and z by 2^lod to get voxels.
//
// Where tiles of different levels meet, their edges follow different columns; skirts hang from the
// four sides so that no hole can be seen between them. Open water has its own surface over its bed.
//
// Level 0's caves end where level 1 begins, as open tubes in the plane between them. So level 1's
// tiles of a landscape go on under their skirts, down to y = 0, in rock of part `cave`: whoever
// sees caves sees them end at a wall. Who leaves caves out leaves it out too, and then sees tubes
// end open that have less rock over them than makes a cave of them (kCaveRoofVoxels).
#pragma once

#include "generator/mesh/mesh.h"
#include "generator/mesh/shade.h"
#include "generator/mesh/water_surface.h"
#include "generator/volume/stack.h"
#include "generator/world/world_definition.h"

#include <cstdint>
#include <vector>

namespace terrane {

/// A skirt hangs this many cells of its level deep, but never below y = 0.
inline constexpr std::int32_t kSkirtCells = 2;

/// One worker's; belongs to one thread at a time; its contents never change results.
class HeightFieldMesher {
  public:
    explicit HeightFieldMesher(const WorldDefinition& definition);

    /// Overwrites `out` with the stack's tile. Positions are relative to the stack's corner and
    /// y = 0. Vertices on a shared side have the same position, normal, colour and material in both
    /// tiles: normals are differences to the columns before, which both have. Needs lod >= 1.
    void mesh(Mesh& out, const Stack& stack, bool with_skirts);

  private:
    std::vector<LinearColor> material_colors_;
    bool is_landscape_;  ///< all that clients know too: with caves or without
    std::vector<PaletteShade> shades_;
    std::vector<std::int32_t> tops256_;
    WaterSurface water_;
};

}  // namespace terrane
