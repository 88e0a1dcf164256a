// libFuzzer: any bytes, as the HTTP port reads them, in pieces and at once. However they are cut,
// the same requests and the same fault must come out, and nothing is kept beyond its limit.
#include "protocol/base/check.h"
#include "server/net/http_reader.h"
#include "tests/fuzz/in_pieces.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace {

using namespace terrane;

/// The requests' targets, and the status of the fault that ended them.
struct Read {
    std::vector<std::string> targets;
    unsigned fault = 0;

    friend bool operator==(const Read&, const Read&) = default;
};

Read read_pieces(std::span<const std::byte> bytes, std::size_t piece_bytes) {
    Read read;
    HttpReader reader;
    const auto take = [&](std::span<const std::byte> piece) {
        reader.feed(piece);
        for (;;) {
            const auto next = reader.next();
            if (!next) {
                read.fault = next.error().status;
                return false;
            }
            if (!*next) {
                TERRANE_ASSERT(reader.buffered_bytes() <=
                               kHttpHeaderBytesMax + kHttpBodyBytesMax + piece.size());
                return true;
            }
            read.targets.push_back((*next)->request.target_path);
        }
    };
    in_pieces(bytes, piece_bytes, take);
    if (read.fault == 0) {  // Beast may wait for the headers' end before it looks at half a line
        take(bytes_of("\r\n\r\n"));
    }
    return read;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    read_both_ways(data, size, read_pieces, [](const Read& pieces, const Read& whole, std::size_t) {
        TERRANE_ASSERT(pieces == whole);
    });
    return 0;
}
