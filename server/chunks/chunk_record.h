// An encoded chunk as the store keeps it (family `meshes`): so that an empty or uniform chunk, too,
// is known after a restart without making its stack.
//
//     u8 record version = 1 | u8 status: 0 full, 1 empty, 2 uniform
//     uniform: u8 materials 1..6, then each u16 material | f64 concentration
//     full: u32 payload size | payload
//     u64 low | u64 high: XXH3-128 of all bytes before
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "server/chunks/answer.h"

#include <cstddef>
#include <span>

namespace terrane {

inline constexpr std::uint8_t kChunkRecordVersion = 1;

/// The etag that belongs to these contents; see EncodedChunk.
Hash128 etag_of(const EncodedChunk& chunk);

Bytes encode_chunk_record(const EncodedChunk& chunk);

/// Fails with `version_mismatch` for another record version and `corrupt` for everything else;
/// `materials` is how many the world has.
Result<EncodedChunk> decode_chunk_record(std::span<const std::byte> bytes, std::size_t materials);

}  // namespace terrane
