// Any bytes: decoding refuses them or gives a record that encodes and decodes to itself.
#include "generator/volume/chunk_codec.h"
#include "protocol/base/check.h"

#include <cstddef>
#include <cstdint>
#include <span>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace terrane;
    const auto bytes = std::as_bytes(std::span(data, size));
    Bytes again;
    if (const auto chunk = decode_chunk(bytes)) {
        encode_chunk(again, *chunk);
        const auto decoded = decode_chunk(again);
        TERRANE_ASSERT(decoded && *decoded == *chunk);
    }
    if (const auto stack = decode_stack(bytes)) {
        encode_stack(again, *stack);
        const auto decoded = decode_stack(again);
        TERRANE_ASSERT(decoded && *decoded == *stack);
    }
    return 0;
}
