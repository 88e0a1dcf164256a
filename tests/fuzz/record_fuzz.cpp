// Any bytes, as a store may give them back: refused, or a record that encodes to itself.
#include "protocol/base/check.h"
#include "server/chunks/chunk_record.h"
#include "storage/record.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

namespace {

constexpr std::size_t kMaterials = 16;

/// A checksum that fits would take a fuzzer for ever to find, so it is also given one.
void read_as_record(std::span<const std::byte> bytes) {
    using namespace terrane;
    (void)decode_chunk_record(bytes, kMaterials);
    Bytes whole(bytes.begin(), bytes.end());
    const Hash128 hash = hash128(bytes);
    ByteWriter out(whole);
    out.fixed(hash.low);
    out.fixed(hash.high);
    if (const auto chunk = decode_chunk_record(whole, kMaterials)) {
        TERRANE_ASSERT(std::ranges::equal(encode_chunk_record(*chunk), whole));
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace terrane;
    const auto bytes = std::as_bytes(std::span(data, size));
    read_as_record(bytes);
    (void)unframe_value("key", bytes);
    Bytes framed;
    frame_value(framed, "key", bytes);
    const auto value = unframe_value("key", framed);
    TERRANE_ASSERT(value && std::ranges::equal(*value, bytes));
    (void)decode_metadata(bytes);
    frame_value(framed, kMetadataKey, bytes);
    if (const auto metadata = decode_metadata(framed)) {
        TERRANE_ASSERT(metadata->format <= kStoreFormat);
    }
    return 0;
}
