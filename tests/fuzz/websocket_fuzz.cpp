// libFuzzer: any bytes, as a WebSocket reads them after its handshake, in pieces and at once.
// However they are cut, the same data and control frames must come out.
#include "protocol/base/check.h"
#include "server/net/websocket_frames.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace {

using namespace terrane;

struct Read {
    Bytes data;
    std::vector<WebSocketControl> control;
    bool is_whole = true;
};

Read read(std::span<const std::byte> bytes, std::size_t piece) {
    Read read;
    WebSocketReader reader;
    for (std::size_t at = 0; at < bytes.size() && read.is_whole; at += piece) {
        read.is_whole = reader
                            .feed(read.data, read.control,
                                  bytes.subspan(at, std::min(piece, bytes.size() - at)))
                            .has_value();
    }
    return read;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) {
        return 0;
    }
    const auto bytes = std::as_bytes(std::span(data, size)).subspan(1);
    const Read pieces = read(bytes, std::size_t{1} + data[0]);
    const Read whole = read(bytes, bytes.size() + 1);
    TERRANE_ASSERT(whole.data.size() <= bytes.size());
    if (whole.is_whole) {  // the limit on control frames is one of a single read
        TERRANE_ASSERT(pieces.is_whole && pieces.data == whole.data &&
                       pieces.control.size() == whole.control.size());
        for (std::size_t i = 0; i < whole.control.size(); ++i) {
            TERRANE_ASSERT(pieces.control[i].opcode == whole.control[i].opcode &&
                           pieces.control[i].payload == whole.control[i].payload &&
                           pieces.control[i].size_bytes == whole.control[i].size_bytes);
        }
    }
    return 0;
}
