// The payload of a COLUMNS chunk: one tag byte, then the chunk's bytes
// (generator/volume/CHUNK_FORMAT.md) plain or zstd-compressed. The only place that knows the tag,
// for server and clients alike.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <cstddef>
#include <span>

namespace terrane {

enum class PayloadTag : std::uint8_t { plain = 0, zstd = 1 };

inline constexpr int kColumnPayloadZstdLevel = 3;

/// Compresses with zstd at `level` (1..19) and keeps whichever form is smaller. A pure function of
/// its arguments and zstd's version. Needs: 1..kColumnChunkBytesMax bytes. Any thread.
Bytes encode_column_payload(std::span<const std::byte> chunk_bytes,
                            int level = kColumnPayloadZstdLevel);

/// The chunk's bytes. The decompressed size is checked against `bytes_max` before it is allocated:
/// fails with `too_large`, and with `malformed` for an unknown tag or a broken frame. Any thread.
Result<Bytes> decode_column_payload(std::span<const std::byte> payload, std::size_t bytes_max);

}  // namespace terrane
