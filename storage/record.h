// Records as bytes: the key that a store sorts by, and the frame that shows whether a value is
// whole.
//
// The layout, byte by byte, is in STORE_FORMAT.md. Every store uses both functions below, so a
// damaged or misplaced record is found the same way whatever lies underneath.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "storage/chunk_store.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace terrane {

/// Raised whenever keys, frames or column families change; an older build refuses a newer store.
inline constexpr std::uint32_t kStoreFormat = 1;

/// Version byte of a framed value.
inline constexpr std::uint8_t kRecordVersion = 1;

/// Bytes of a frame before the value: version, XXH3-128.
inline constexpr std::size_t kRecordHeadBytes = 17;

/// The key as bytes. Keys of one family, identity, format and level sort along a Morton curve, so
/// that chunks near each other in the world lie near each other on disk. Any position, also invalid
/// ones, has a key of its own. Needs 0 <= lod <= 255; `position.y` is left out for `stacks`.
std::string encode_key(const StoreIdentity& identity, const RecordKey& key);

/// The value behind its version and its checksum, which covers the key too. Overwrites `out`.
void frame_value(Bytes& out, std::string_view key, std::span<const std::byte> value);

/// The value inside a frame: a view into `framed`. Fails with `corrupt` if a byte of it changed, if
/// it was cut short or belongs to another key, and with `version_mismatch` if a later build wrote
/// it.
Result<std::span<const std::byte>> unframe_value(std::string_view key,
                                                 std::span<const std::byte> framed);

/// What a store says about itself, kept under one fixed key in the family `metadata`.
struct StoreMetadata {
    std::uint32_t format = kStoreFormat;
    StoreIdentity identity;
};

inline constexpr std::string_view kMetadataKey = "identity";
inline constexpr std::size_t kStoredNameBytesMax = 256;

/// The metadata record, framed. Overwrites `out`. A longer world name is cut.
void encode_metadata(Bytes& out, const StoreMetadata& metadata);

/// Fails with `corrupt`, or `version_mismatch` if the format is newer than this build's.
Result<StoreMetadata> decode_metadata(std::span<const std::byte> framed);

/// May a store that says `stored` be used for `wanted`? Fails with `wrong_world` if it holds
/// another world; `place` names the store in the message, which says what to do. Another
/// `content_id` or generator version is no obstacle: keys carry both, so old records are simply
/// never found.
Result<void> check_identity(const StoreIdentity& stored, const StoreIdentity& wanted,
                            std::string_view place);

}  // namespace terrane
