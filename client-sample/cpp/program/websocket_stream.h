// A WebSocket client's half of RFC 6455 without a socket: the upgrade, masked frames out, frames
// in. Only what this program needs: binary messages, pings, close; no extensions, no subprotocols.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <string>

namespace terrane {

struct WebSocketTarget {
    std::string host;  ///< as the Host header says it
    std::string path;
    std::uint64_t seed = 0;  ///< of key and masks
};

inline constexpr std::size_t kUpgradeAnswerBytesMax = std::size_t{16} << 10U;
inline constexpr std::size_t kControlBytesMax = 125;

/// One thread.
class WebSocketStream {
  public:
    explicit WebSocketStream(const WebSocketTarget& target);

    /// The HTTP request that asks for the upgrade.
    Bytes opening() const;

    /// One binary message in one masked frame.
    Bytes wrap(std::span<const std::byte> message);

    /// Appends the bytes of data messages to `out`, one behind the other. Fails with
    /// `unsupported` if the server does not upgrade, `malformed` for what RFC 6455 forbids,
    /// `io_error` when the server closes, with its reason.
    Result<void> feed(Bytes& out, std::span<const std::byte> bytes);

    /// Pongs that are due.
    Bytes take_reply();

  private:
    struct Head {
        std::uint8_t opcode = 0;
        std::uint64_t payload_bytes = 0;
        std::size_t head_bytes = 0;
    };

    Result<bool> take_upgrade();
    Result<bool> read_head(Head& head) const;
    Result<void> take_control(std::uint8_t opcode, std::span<const std::byte> payload);
    Bytes frame(std::uint8_t opcode, std::span<const std::byte> payload);

    WebSocketTarget target_;
    std::mt19937_64 random_;
    std::string key_;
    bool is_upgraded_ = false;
    Bytes buffer_;                 ///< what has come and is no whole head, upgrade or control frame
    std::uint64_t data_left_ = 0;  ///< of the data frame that is being passed on
    Bytes reply_;
};

}  // namespace terrane
