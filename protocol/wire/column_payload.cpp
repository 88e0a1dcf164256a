#include "protocol/wire/column_payload.h"

#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/result.h"
#include "protocol/wire/limits.h"

#include <zstd.h>

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>

namespace terrane {

Bytes encode_column_payload(std::span<const std::byte> chunk_bytes, int level) {
    TERRANE_ASSERT(!chunk_bytes.empty() && chunk_bytes.size() <= kColumnChunkBytesMax);
    Bytes payload(1 + std::max(ZSTD_compressBound(chunk_bytes.size()), chunk_bytes.size()));
    const std::size_t compressed_bytes = ZSTD_compress(
        payload.data() + 1, payload.size() - 1, chunk_bytes.data(), chunk_bytes.size(), level);
    if (ZSTD_isError(compressed_bytes) == 0 && compressed_bytes < chunk_bytes.size()) {
        payload[0] = static_cast<std::byte>(PayloadTag::zstd);
        payload.resize(1 + compressed_bytes);
    } else {
        payload[0] = static_cast<std::byte>(PayloadTag::plain);
        std::ranges::copy(chunk_bytes, payload.begin() + 1);
        payload.resize(1 + chunk_bytes.size());
    }
    payload.shrink_to_fit();
    return payload;
}

Result<Bytes> decode_column_payload(std::span<const std::byte> payload, std::size_t bytes_max) {
    if (payload.empty()) {
        return fail(ErrorCode::malformed, "columns payload: empty, even its tag is missing");
    }
    const auto rest = payload.subspan(1);
    const bool is_plain = payload[0] == static_cast<std::byte>(PayloadTag::plain);
    if (!is_plain && payload[0] != static_cast<std::byte>(PayloadTag::zstd)) {
        return fail(ErrorCode::malformed,
                    "columns payload: unknown tag " + std::to_string(static_cast<int>(payload[0])));
    }
    unsigned long long size_bytes = rest.size();
    if (!is_plain) {
        size_bytes = ZSTD_getFrameContentSize(rest.data(), rest.size());
        if (size_bytes == ZSTD_CONTENTSIZE_UNKNOWN || size_bytes == ZSTD_CONTENTSIZE_ERROR) {
            return fail(ErrorCode::malformed, "columns payload: a zstd frame without its size");
        }
    }
    if (size_bytes > bytes_max) {
        return fail(ErrorCode::too_large, "columns payload: " + std::to_string(size_bytes) +
                                              " bytes when unpacked, at most " +
                                              std::to_string(bytes_max) + " are accepted");
    }
    if (is_plain) {
        return Bytes(rest.begin(), rest.end());
    }
    Bytes chunk_bytes(static_cast<std::size_t>(size_bytes));
    const std::size_t unpacked_bytes =
        ZSTD_decompress(chunk_bytes.data(), chunk_bytes.size(), rest.data(), rest.size());
    if (ZSTD_isError(unpacked_bytes) != 0 || unpacked_bytes != chunk_bytes.size()) {
        return fail(ErrorCode::malformed, "columns payload: the zstd frame is broken");
    }
    return chunk_bytes;
}

}  // namespace terrane
