#include "server/chunks/chunk_record.h"

#include "generator/world/composition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"
#include "server/chunks/answer.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

namespace terrane {

namespace {

constexpr std::size_t kHashBytes = 16;

void write_composition(ByteWriter& out, const Composition& composition) {
    out.fixed(composition.count);
    for (const Share& share : composition.shares()) {
        out.fixed(share.material);
        out.f64(share.concentration);
    }
}

bool read_composition(Composition& out, ByteReader& in, std::size_t materials) {
    const auto count = in.fixed<std::uint8_t>();
    if (!count || *count == 0 || *count > kCompositionMaterialsMax) {
        return false;
    }
    for (std::uint8_t i = 0; i < *count; ++i) {
        const auto material = in.fixed<std::uint16_t>();
        const auto concentration = in.f64();
        if (!material || !concentration || *material >= materials || !(*concentration > 0) ||
            !(*concentration <= 1)) {
            return false;
        }
        out.add(*material, *concentration);
    }
    return true;
}

}  // namespace

Hash128 etag_of(const EncodedChunk& chunk) {
    if (chunk.status == ChunkStatus::full) {
        return hash128(*chunk.payload);
    }
    Bytes contents;
    ByteWriter out(contents);
    out.fixed(static_cast<std::uint8_t>(chunk.status));
    write_composition(out, chunk.uniform);
    return hash128(contents);
}

Bytes encode_chunk_record(const EncodedChunk& chunk) {
    Bytes bytes;
    bytes.reserve(chunk.payload_bytes() + 80);
    ByteWriter out(bytes);
    out.fixed(kChunkRecordVersion);
    out.fixed(static_cast<std::uint8_t>(chunk.status));
    if (chunk.status == ChunkStatus::uniform) {
        write_composition(out, chunk.uniform);
    }
    if (chunk.status == ChunkStatus::full) {
        out.fixed(static_cast<std::uint32_t>(chunk.payload->size()));
        out.raw(*chunk.payload);
    }
    const Hash128 hash = hash128(bytes);
    out.fixed(hash.low);
    out.fixed(hash.high);
    return bytes;
}

Result<EncodedChunk> decode_chunk_record(std::span<const std::byte> bytes, std::size_t materials) {
    if (bytes.size() < 2 + kHashBytes) {
        return fail(ErrorCode::corrupt, "chunk record: cut short");
    }
    const auto contents = bytes.first(bytes.size() - kHashBytes);
    ByteReader tail(bytes.last(kHashBytes));
    const auto low = tail.fixed<std::uint64_t>();
    const auto high = tail.fixed<std::uint64_t>();
    if (!low || !high || hash128(contents) != Hash128{.high = *high, .low = *low}) {
        return fail(ErrorCode::corrupt, "chunk record: checksum does not match");
    }
    ByteReader in(contents);
    const auto version = in.fixed<std::uint8_t>();
    const auto status = in.fixed<std::uint8_t>();
    if (!version || !status) {
        return fail(ErrorCode::corrupt, "chunk record: cut short");
    }
    if (*version != kChunkRecordVersion) {
        return fail(ErrorCode::version_mismatch,
                    "chunk record: version " + std::to_string(*version));
    }
    EncodedChunk chunk;
    if (*status == static_cast<std::uint8_t>(ChunkStatus::full)) {
        chunk.status = ChunkStatus::full;
        const auto size_bytes = in.fixed<std::uint32_t>();
        const bool is_rest = size_bytes && *size_bytes > 0 && *size_bytes == in.remaining();
        const auto payload = is_rest ? in.take(in.remaining()) : std::nullopt;
        if (!payload) {
            return fail(ErrorCode::corrupt, "chunk record: wrong payload size");
        }
        chunk.payload = std::make_shared<const Bytes>(payload->begin(), payload->end());
    } else if (*status == static_cast<std::uint8_t>(ChunkStatus::uniform)) {
        chunk.status = ChunkStatus::uniform;
        if (!read_composition(chunk.uniform, in, materials)) {
            return fail(ErrorCode::corrupt, "chunk record: bad composition");
        }
    } else if (*status == static_cast<std::uint8_t>(ChunkStatus::empty)) {
        chunk.status = ChunkStatus::empty;
    } else {
        return fail(ErrorCode::corrupt, "chunk record: unknown status " + std::to_string(*status));
    }
    if (in.remaining() != 0) {
        return fail(ErrorCode::corrupt, "chunk record: bytes left over");
    }
    chunk.etag = etag_of(chunk);
    return chunk;
}

}  // namespace terrane
