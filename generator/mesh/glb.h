// A mesh as a binary glTF 2.0 file (GLB) with Draco inside: what 3D Tiles and glTF viewers read.
//
//     "glTF" u32 | version u32 2 | bytes u32
//     bytes u32 | "JSON" | one node that places one mesh, padded with spaces
//     bytes u32 | "BIN\0" | a Draco mesh for each primitive, padded with zeros
//
// Vertices are relative to the centre of the mesh's box, in columns of the level for x and z and in
// voxels for y; the node's scale makes metres of them and its translation puts the centre where it
// is in the world, in doubles. glTF is y up as the world is, so axes stay as they are.
//
// A mesh has a primitive for each part that it has: ground, caves, water. `extras.part` names them
// ("ground", "caves", "water") unless ground is all there is; water's material is translucent.
//
// Positions are quantised as in draco_codec.h, in steps of 1/32 from a fixed corner of the box with
// as many bits for every tile of a level: what two tiles share is the same point in both.
#pragma once

#include "generator/mesh/draco_codec.h"
#include "generator/mesh/mesh.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"

#include <array>
#include <cstdint>

namespace terrane {

using Vector3 = std::array<double, 3>;

/// Where a mesh's box lies: its corner of least x and z at the mesh's height 0, and what a unit of
/// the mesh is along each axis. Metres.
struct GlbPlace {
    Vector3 corner_m{};
    Vector3 unit_m{};

    friend bool operator==(const GlbPlace&, const GlbPlace&) = default;
};

/// The place of a mesh that begins at `first` in x and z and at height `y_voxels`.
GlbPlace glb_place_of(ColumnPos first, std::int64_t y_voxels, std::int32_t lod,
                      double voxel_size_m);

/// Encodes a mesh: POSITION with min and max, NORMAL, COLOR_0 (u8 x 4 normalised, linear). Equal
/// vertices are merged and triangles without area left out; if none is left, it is `empty_glb`. The
/// same mesh gives the same bytes. Fails with `out_of_range` for positions outside the settings'
/// box.
Result<Bytes> encode_glb(const Mesh& mesh, const DracoSettings& settings, const GlbPlace& place);

/// A valid file with an empty scene: the tile of a place without a surface.
Bytes empty_glb();

/// Hangs a strip two voxels deep under the edges that a level-0 mesh of a whole stack has on its
/// four sides, where the solid is below them: against a coarser neighbour no hole can be seen. It
/// never reaches below y = -1. Positions are as SurfaceNetsMesher gives them; `side` is in columns.
void add_side_skirts(Mesh& mesh, std::int32_t side);

}  // namespace terrane
