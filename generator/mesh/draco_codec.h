// Draco bytes of a mesh: edgebreaker, explicit quantisation so that neighbouring chunks agree.
#pragma once

#include <cstdint>

#include "generator/mesh/mesh.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

namespace terrane {

/// Part of the encoding version: raised whenever a byte of a served mesh or chunk changes.
inline constexpr std::uint32_t kEncodingVersion = 1;

/// What all chunks of a world share, so that one value has one quantised step everywhere.
struct DracoSettings {
    std::int32_t side = 32;             ///< N, columns
    std::int32_t height_voxels = 32;    ///< tallest y of a mesh: chunk height + 1 at level 0
    int speed = 7;                      ///< Draco's encoder and decoder speed
};

/// Encodes a mesh of at least one triangle. Position steps are 1/32 voxel from a fixed origin.
/// Attributes: POSITION, NORMAL, COLOR (u8 x 3, linear), and GENERIC (u8 x 1): the material id.
Result<Bytes> encode_draco(const Mesh& mesh, const DracoSettings& settings);

/// Decodes what encode_draco wrote (or any such mesh from a trusted server). Positions come back in
/// 1/256 voxel, rounded. Fails with `malformed`.
Result<Mesh> decode_draco(std::span<const std::byte> bytes);

}  // namespace terrane
