// A mesh as Wavefront OBJ text, for looking at a chunk in any 3D program.
#pragma once

#include "generator/mesh/mesh.h"
#include "protocol/base/coords.h"
#include "protocol/wire/messages.h"

#include <string>

namespace terrane {

/// Vertices in world metres (y up) with sRGB colours behind them as most programs read them,
/// normals, triangles.
std::string obj_of(const Mesh& mesh, ChunkPos key, const ServerHello& world);

}  // namespace terrane
