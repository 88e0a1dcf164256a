// WebSocket's frames (RFC 6455) as a server sees them, with no socket: the handshake's answer, the
// client's frames out of bytes, the server's frame heads into bytes. No extension is spoken, so
// nothing is ever compressed.
//
//     byte 0: FIN, three reserved bits, opcode     byte 1: MASK, length 0..125, or 126, or 127
//     u16 or u64 length, big endian                u32 masking key (from clients always)
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

enum class WebSocketOpcode : std::uint8_t {
    continuation = 0,
    text = 1,
    binary = 2,
    close = 8,
    ping = 9,
    pong = 10
};

/// Codes of a close frame (section 7.4.1).
enum class WebSocketCloseCode : std::uint16_t {
    normal = 1000,
    going_away = 1001,
    protocol_error = 1002,
    unsupported_data = 1003,
    policy_violation = 1008
};

inline constexpr std::size_t kControlPayloadMax = 125;
inline constexpr std::size_t kServerFrameHeadMax = 10;

/// Sec-WebSocket-Accept for a Sec-WebSocket-Key.
std::string websocket_accept(std::string_view key);
/// 16 bytes in base64: what a handshake's key must be.
bool is_websocket_key(std::string_view key);

/// The head of a server's whole message of `size_bytes`; gives its length.
std::size_t write_frame_head(std::array<std::byte, kServerFrameHeadMax>& out,
                             WebSocketOpcode opcode, std::uint64_t size_bytes);

/// A client's control frame.
struct WebSocketControl {
    WebSocketOpcode opcode = WebSocketOpcode::ping;
    std::array<std::byte, kControlPayloadMax> payload{};
    std::size_t size_bytes = 0;
};

/// Reads a client's frames. Data comes out as it arrives, unmasked; who wants messages puts them
/// together. One thread.
class WebSocketReader {
  public:
    /// Takes all of `bytes`; appends the data of binary messages to `data` and control frames to
    /// `control`, at most `kControlsMax` (what comes beyond is an error). Fails with `malformed`
    /// (or `unsupported`: text) and must not be called again.
    Result<void> feed(Bytes& data, std::vector<WebSocketControl>& control,
                      std::span<const std::byte> bytes);

    static constexpr std::size_t kControlsMax = 1024;  ///< of one read; a ping has 6 bytes

  private:
    Result<void> begin_frame();

    std::array<std::byte, 14> head_{};
    std::size_t head_size_ = 0;
    std::uint64_t payload_left_ = 0;
    std::array<std::byte, 4> mask_{};
    std::size_t mask_at_ = 0;
    bool inside_frame_ = false;
    bool inside_message_ = false;  ///< fragments follow
    WebSocketOpcode opcode_ = WebSocketOpcode::binary;
    WebSocketControl control_;
};

}  // namespace terrane
