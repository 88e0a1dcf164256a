// How the native protocol's messages travel on a byte stream: as they are (TCP), in a WebSocket,
// or as HTTP requests. No socket here: bytes in, bytes out, so that one loop carries all of them
// and tests step each.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

namespace terrane {

enum class CarrierKind : std::uint8_t { tcp, web_socket, http };

/// One connection's, from its first byte on. One thread.
class Carrier {
  public:
    virtual ~Carrier() = default;

    /// What must be sent before any message; empty if nothing.
    virtual Bytes opening() = 0;

    /// The message as bytes for the connection. Before the peer has accepted the opening they may
    /// be sent behind it all the same: no carrier here waits.
    virtual Bytes wrap(const AnyMessage& message) = 0;

    /// Takes what the connection brought. Fails if the peer refuses or breaks the carrier's rules.
    virtual Result<void> feed(std::span<const std::byte> bytes) = 0;

    /// The next whole message; nothing if more bytes are needed. Its payload lives until the next
    /// call.
    virtual Result<std::optional<IncomingMessage>> next() = 0;

    /// What the carrier itself wants to say, a pong or the next request; empty if nothing. To be
    /// asked for after every `next` that gave something.
    virtual Bytes take_reply() { return {}; }
};

struct CarrierAddress {
    std::string host;
    std::uint16_t port = 0;
    std::uint64_t seed = 0;  ///< of a WebSocket's key and masks, which need not be secret here
};

std::unique_ptr<Carrier> make_carrier(CarrierKind kind, const CarrierAddress& address);

}  // namespace terrane
