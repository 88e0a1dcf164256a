// Many TCP connections on one thread, with TLS in them if wanted: bytes out, bytes in. The only
// file of the program that knows Asio; what the bytes mean is the carrier's (carrier.h).
#pragma once

#include "client-sample/cpp/connection.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

namespace terrane {

/// Bytes of one connection that wait to be written; at more it is closed.
inline constexpr std::size_t kSendQueueBytesMax = std::size_t{4} << 20U;

/// One thread: handlers are called within `run_until`, and may call everything but that.
class StreamLoop {
  public:
    using StreamId = std::size_t;

    struct Handlers {
        /// Connected, and after the handshake if it is TLS.
        std::function<void(StreamId)> opened;
        std::function<void(StreamId, std::span<const std::byte>)> received;
        /// Once, unless `close` was called: it could not connect, or the peer has gone.
        std::function<void(StreamId, const Error&)> closed;
    };

    struct Target {
        std::string host;
        std::uint16_t port = 0;
        TlsUse tls;  ///< the certificate must be good for `host`
    };

    /// Resolves the name. Fails with `io_error`, for certificates that can't be read too.
    static Result<StreamLoop> open(const Target& target, Handlers handlers, Deadline deadline);

    StreamLoop(StreamLoop&&) noexcept;
    StreamLoop& operator=(StreamLoop&&) noexcept;
    ~StreamLoop();

    /// Begins a connection; `opened` or `closed` tells what became of it. Ids count from 0.
    StreamId connect();

    /// Queues bytes. Nothing happens on a closed stream.
    void send(StreamId id, Bytes bytes);

    /// The peer has sent bytes that have not been read yet: this side is the slow one.
    bool has_unread(StreamId id) const;

    /// What is queued is still written, as far as the socket takes it at once.
    void close(StreamId id);

    void run_until(Deadline deadline);

  private:
    struct State;

    explicit StreamLoop(std::unique_ptr<State> state);

    std::unique_ptr<State> state_;
};

}  // namespace terrane
