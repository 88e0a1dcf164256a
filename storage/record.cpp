#include "storage/record.h"

#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "storage/chunk_store.h"

#include <xxhash.h>

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace terrane {
namespace {

/// Most significant byte first, so that bytes sort as numbers do.
void append_big_endian(std::string& out, std::uint64_t value, std::size_t size_bytes) {
    for (std::size_t i = size_bytes; i-- > 0;) {
        out.push_back(static_cast<char>((value >> (8 * i)) & 0xFFU));
    }
}

void append_hash(std::string& out, Hash128 hash) {
    append_big_endian(out, hash.high, 8);
    append_big_endian(out, hash.low, 8);
}

/// Morton order: the values' top bits first, one bit of each in turn. The sign bit is flipped so
/// that negative coordinates sort below positive ones.
void append_interleaved(std::string& out, std::initializer_list<std::int32_t> values) {
    unsigned byte = 0;
    unsigned bits = 0;
    for (unsigned bit = 32; bit-- > 0;) {
        for (const std::int32_t value : values) {
            const std::uint32_t biased = static_cast<std::uint32_t>(value) ^ 0x80000000U;
            byte = (byte << 1U) | ((biased >> bit) & 1U);
            if (++bits == 8) {
                out.push_back(static_cast<char>(byte));
                byte = 0;
                bits = 0;
            }
        }
    }
}

std::optional<Hash128> read_hash(ByteReader& in) {
    const auto high = in.fixed<std::uint64_t>();
    const auto low = in.fixed<std::uint64_t>();
    return high && low ? std::optional(Hash128{.high = *high, .low = *low}) : std::nullopt;
}

struct XxhState {
    XXH3_state_t* state = XXH3_createState();

    XxhState() { TERRANE_ASSERT(state != nullptr); }

    ~XxhState() { XXH3_freeState(state); }

    XxhState(const XxhState&) = delete;
    XxhState& operator=(const XxhState&) = delete;
};

/// XXH3-128 over version, key and value, so that a value filed under another key does not pass.
Hash128 record_checksum(std::uint8_t version, std::string_view key,
                        std::span<const std::byte> value) {
    thread_local const XxhState kHasher;
    XXH3_128bits_reset(kHasher.state);
    XXH3_128bits_update(kHasher.state, &version, 1);
    XXH3_128bits_update(kHasher.state, key.data(), key.size());
    XXH3_128bits_update(kHasher.state, value.data(), value.size());
    const XXH128_hash_t hash = XXH3_128bits_digest(kHasher.state);
    return {.high = hash.high64, .low = hash.low64};
}

}  // namespace

std::string encode_key(const StoreIdentity& identity, const RecordKey& key) {
    TERRANE_ASSERT(key.position.lod >= 0 && key.position.lod <= 255);
    const bool stacks = key.family == Family::stacks;
    std::string out;
    out.reserve(36);
    out.push_back(stacks ? 's' : 'm');
    append_hash(out, stacks ? identity.fingerprint : identity.content_id);
    append_big_endian(out, identity.generator_version, 4);
    append_big_endian(out, key.format, 1);
    append_big_endian(out, static_cast<std::uint64_t>(key.position.lod), 1);
    if (stacks) {
        append_interleaved(out, {key.position.x, key.position.z});
    } else {
        append_interleaved(out, {key.position.x, key.position.z, key.position.y});
    }
    return out;
}

void frame_value(Bytes& out, std::string_view key, std::span<const std::byte> value) {
    const Hash128 checksum = record_checksum(kRecordVersion, key, value);
    out.clear();
    out.reserve(kRecordHeadBytes + value.size());
    ByteWriter writer(out);
    writer.fixed(kRecordVersion);
    writer.fixed(checksum.high);
    writer.fixed(checksum.low);
    writer.raw(value);
}

Result<std::span<const std::byte>> unframe_value(std::string_view key,
                                                 std::span<const std::byte> framed) {
    ByteReader reader(framed);
    const auto version = reader.fixed<std::uint8_t>();
    const auto checksum = read_hash(reader);
    if (!version || !checksum) {
        return fail(ErrorCode::corrupt,
                    "record: cut short at " + std::to_string(framed.size()) + " bytes");
    }
    const auto value = framed.subspan(kRecordHeadBytes);
    if (record_checksum(*version, key, value) != *checksum) {
        return fail(ErrorCode::corrupt, "record: the checksum does not fit");
    }
    if (*version != kRecordVersion) {
        return fail(ErrorCode::version_mismatch, "record: version " + std::to_string(*version) +
                                                     ", this build reads " +
                                                     std::to_string(kRecordVersion));
    }
    return value;
}

void encode_metadata(Bytes& out, const StoreMetadata& metadata) {
    Bytes value;
    ByteWriter writer(value);
    writer.fixed(metadata.format);
    writer.fixed(metadata.identity.fingerprint.high);
    writer.fixed(metadata.identity.fingerprint.low);
    writer.fixed(metadata.identity.content_id.high);
    writer.fixed(metadata.identity.content_id.low);
    writer.fixed(metadata.identity.generator_version);
    const std::string_view name =
        std::string_view(metadata.identity.world_name).substr(0, kStoredNameBytesMax);
    writer.fixed(static_cast<std::uint16_t>(name.size()));
    writer.raw(bytes_of(name));
    frame_value(out, kMetadataKey, value);
}

Result<StoreMetadata> decode_metadata(std::span<const std::byte> framed) {
    const auto value = unframe_value(kMetadataKey, framed);
    if (!value) {
        return tl::unexpected(value.error());
    }
    ByteReader reader(*value);
    const auto format = reader.fixed<std::uint32_t>();
    if (format && *format > kStoreFormat) {
        return fail(ErrorCode::version_mismatch, "store format " + std::to_string(*format) +
                                                     ", this build reads up to " +
                                                     std::to_string(kStoreFormat));
    }
    const auto fingerprint = read_hash(reader);
    const auto content_id = read_hash(reader);
    const auto generator_version = reader.fixed<std::uint32_t>();
    const auto name_bytes = reader.fixed<std::uint16_t>();
    if (!format || *format == 0 || !fingerprint || !content_id || !generator_version ||
        !name_bytes) {
        return fail(ErrorCode::corrupt, "store metadata: cut short");
    }
    const auto name = reader.take(*name_bytes);
    if (!name || reader.remaining() != 0 || *name_bytes > kStoredNameBytesMax) {
        return fail(ErrorCode::corrupt, "store metadata: the name has another length than it says");
    }
    return StoreMetadata{.format = *format,
                         .identity = {.fingerprint = *fingerprint,
                                      .content_id = *content_id,
                                      .generator_version = *generator_version,
                                      .world_name = std::string(text_of(*name))}};
}

Result<void> check_identity(const StoreIdentity& stored, const StoreIdentity& wanted,
                            std::string_view place) {
    if (stored.fingerprint == wanted.fingerprint) {
        return {};
    }
    return fail(ErrorCode::wrong_world, std::string(place) + ": holds world '" + stored.world_name +
                                            "' (fingerprint " + to_hex(stored.fingerprint) +
                                            "), not '" + wanted.world_name + "' (fingerprint " +
                                            to_hex(wanted.fingerprint) +
                                            "); use another --data directory or remove this one");
}

}  // namespace terrane
