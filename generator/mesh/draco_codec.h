// Draco bytes of a mesh: edgebreaker, explicit quantisation so that neighbouring chunks agree.
//
// Positions are quantised in steps of 1/32 voxel counted from the fixed point (0, -1, 0) of the
// chunk, with the fewest bits that reach as far as any chunk of the world does: the same for every
// chunk, so a point that two chunks share is the same point after decoding. The mesh's 1/256 voxel
// are rounded to 1/32, half upwards, before Draco sees them; nothing depends on its own rounding.
#pragma once

#include "generator/mesh/mesh.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace terrane {

/// Part of the encoding version: raised whenever a byte of a served mesh or chunk changes.
inline constexpr std::uint32_t kEncodingVersion = 4;

inline constexpr std::int32_t kDracoStepsPerVoxel = 32;
/// The largest input that decode_draco looks at; a chunk's mesh is a few kB to a few hundred.
inline constexpr std::size_t kDracoBytesMax = std::size_t{64} << 20;

/// What all chunks of a world share, so that one value has one quantised step everywhere.
struct DracoSettings {
    std::int32_t side = 32;           ///< N, columns: x and z are 0..N voxels
    std::int32_t height_voxels = 33;  ///< y is -1..height_voxels - 1; chunk height + 1 at level 0
    int speed = 7;                    ///< Draco's encoder and decoder speed, 0..10
};

/// A position as decoding gives it back: rounded to 1/32 voxel, half upwards; still 1/256 voxel.
constexpr std::int32_t rounded_to_draco_step(std::int32_t position256) {
    constexpr std::int32_t kStep256 = 256 / kDracoStepsPerVoxel;
    return (position256 + kStep256 / 2) & ~(kStep256 - 1);
}

/// Bits of a quantised coordinate: the fewest b with (2^b - 1) / 32 >= the longest side, in voxels.
int draco_position_bits(const DracoSettings& settings);

/// Encodes a mesh of at least one triangle. Draco orders vertices and triangles anew; the same mesh
/// gives the same bytes. Attributes: POSITION (float x 3, voxels), NORMAL (float x 3, 8 bits),
/// COLOR (u8 x 3 normalised, linear), GENERIC (u8 x 1): the material id, and, if anything is not
/// ground, a second GENERIC (u8 x 1): the MeshPart. Fails with
/// `invalid_argument` for an empty mesh, `out_of_range` for positions outside the settings' box.
Result<Bytes> encode_draco(const Mesh& mesh, const DracoSettings& settings);

/// Decodes what encode_draco wrote (or any such mesh from a trusted server). Positions come back in
/// 1/256 voxel, rounded. Bytes that promise more than they can hold are refused before Draco reads
/// them, but Draco itself is no guard against an enemy: never feed it a client's bytes. Fails with
/// `malformed`, or `too_large` above kDracoBytesMax.
Result<Mesh> decode_draco(std::span<const std::byte> bytes);

}  // namespace terrane
