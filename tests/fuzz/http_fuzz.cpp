// libFuzzer: any bytes, as the HTTP port reads them, in pieces and at once. However they are cut,
// the same requests and the same fault must come out, and nothing is kept beyond its limit.
#include "protocol/base/check.h"
#include "server/net/http_reader.h"

#include <algorithm>
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

Read read(std::span<const std::byte> bytes, std::size_t piece) {
    Read read;
    HttpReader reader;
    for (std::size_t at = 0; at < bytes.size() && read.fault == 0; at += piece) {
        const std::size_t size = std::min(piece, bytes.size() - at);
        reader.feed(bytes.subspan(at, size));
        for (;;) {
            const auto next = reader.next();
            if (!next) {
                read.fault = next.error().status;
                break;
            }
            if (!*next) {
                TERRANE_ASSERT(reader.buffered_bytes() <=
                               kHttpHeaderBytesMax + kHttpBodyBytesMax + size);
                break;
            }
            read.targets.push_back((*next)->request.target_path);
        }
    }
    return read;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) {
        return 0;
    }
    const auto bytes = std::as_bytes(std::span(data, size)).subspan(1);
    TERRANE_ASSERT(read(bytes, std::size_t{1} + data[0]) == read(bytes, bytes.size() + 1));
    return 0;
}
