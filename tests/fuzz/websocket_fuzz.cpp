// libFuzzer: any bytes, as a WebSocket reads them after its handshake, in pieces and at once.
// However they are cut, the same data and control frames must come out.
#include "protocol/base/check.h"
#include "server/net/websocket_frames.h"
#include "tests/fuzz/in_pieces.h"

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

Read read_pieces(std::span<const std::byte> bytes, std::size_t piece_bytes) {
    Read read;
    WebSocketReader reader;
    in_pieces(bytes, piece_bytes, [&](std::span<const std::byte> piece) {
        read.is_whole = reader.feed(read.data, read.control, piece).has_value();
        return read.is_whole;
    });
    return read;
}

void compare(const Read& pieces, const Read& whole, std::size_t size_bytes) {
    TERRANE_ASSERT(whole.data.size() <= size_bytes);
    if (!whole.is_whole) {  // the limit on control frames is one of a single read
        return;
    }
    TERRANE_ASSERT(pieces.is_whole && pieces.data == whole.data &&
                   pieces.control.size() == whole.control.size());
    for (std::size_t i = 0; i < whole.control.size(); ++i) {
        TERRANE_ASSERT(pieces.control[i].opcode == whole.control[i].opcode &&
                       pieces.control[i].payload == whole.control[i].payload &&
                       pieces.control[i].size_bytes == whole.control[i].size_bytes);
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    read_both_ways(data, size, read_pieces, compare);
    return 0;
}
