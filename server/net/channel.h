// A connection's protocol and the TLS between it and the wire, if the port has it; no socket. Bytes
// off the wire in, bytes for the wire out.
//
// One protocol may hand over to another (HTTP to WebSocket): that happens when all that the first
// had to say is written.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "server/net/byte_protocol.h"
#include "server/net/outbox.h"
#include "server/net/tls.h"

#include <cstddef>
#include <memory>
#include <span>

namespace terrane {

/// One thread, the connection's.
class Channel {
  public:
    using Parts = std::span<const std::span<const std::byte>>;

    /// `tls` may be null. `scratch` is shared with other channels of the thread.
    Channel(std::shared_ptr<ByteProtocol> protocol, std::unique_ptr<TlsChannel> tls,
            Bytes& scratch);

    ByteProtocol& protocol() { return *protocol_; }

    const ByteProtocol& protocol() const { return *protocol_; }

    bool is_shaking_hands() const { return tls_ && !tls_->is_ready(); }

    /// Bytes off the wire. Fails if they are no TLS; `output` then has an alert for the client.
    Result<void> receive(std::span<const std::byte> bytes);

    /// The client has said within TLS that no more will come.
    bool input_ended() const { return tls_ && tls_->input_ended(); }

    /// What is to be written next; no parts: nothing. Valid until `wrote`.
    Result<Parts> output();
    /// The first `size_bytes` of it have been written.
    void wrote(std::size_t size_bytes);
    /// Whether `output` would give something, a protocol that could take over aside.
    bool has_output();
    /// The last bytes of all, after all output; once.
    Bytes farewell();
    /// What a failed `receive` left to write.
    std::span<const std::byte> alert() const;

  private:
    std::size_t gather();
    Result<void> encrypt();

    std::shared_ptr<ByteProtocol> protocol_;
    std::unique_ptr<TlsChannel> tls_;
    Bytes& plain_;
    Outbox::Gather parts_;
    std::size_t cipher_written_ = 0;   ///< of the TLS channel's output
    std::size_t plain_encrypted_ = 0;  ///< of the protocol's bytes, in that output
};

}  // namespace terrane
