// libFuzzer: any bytes, as a server reads them. The first byte sets the size of the pieces.
#include "protocol/wire/column_payload.h"
#include "protocol/wire/messages.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace terrane;
    if (size == 0) {
        return 0;
    }
    auto bytes = std::as_bytes(std::span(data, size)).subspan(1);
    for (const FrameLimits& limits : {kInboundFrameLimits, kOutboundFrameLimits}) {
        FrameReader reader(limits);
        const std::size_t piece = std::size_t{1} + data[0];
        for (std::size_t at = 0; at < bytes.size(); at += piece) {
            reader.feed(bytes.subspan(at, std::min(piece, bytes.size() - at)));
            for (auto frame = reader.next(); frame && *frame; frame = reader.next()) {
                const auto message = decode_message(**frame);
                if (message) {
                    (void)encode_message(*message);
                }
                (void)request_id_of(**frame);
            }
        }
    }
    (void)decode_column_payload(bytes, std::size_t{1} << 20U);
    return 0;
}
