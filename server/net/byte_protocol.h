// What runs over a connection: the seam between the protocols (native frames, HTTP, WebSocket) and
// the sockets. A protocol has no socket: bytes in, bytes out, the time given. So tests step it, and
// TLS goes between without its knowledge.
#pragma once

#include "server/net/outbox.h"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

namespace terrane {

/// All calls on one thread, the connection's.
class ByteProtocol {
  public:
    using Clock = std::chrono::steady_clock;

    ByteProtocol() = default;
    virtual ~ByteProtocol() = default;
    ByteProtocol(const ByteProtocol&) = delete;
    ByteProtocol& operator=(const ByteProtocol&) = delete;

    /// Bytes from the client. All of them are kept, so it is called only while `wants_input`.
    virtual void receive(std::span<const std::byte> bytes, Clock::time_point now) = 0;
    /// The client's last byte has been received.
    virtual void input_ended() = 0;
    /// Fills `out` with the first bytes to write, in order, and gives the number of parts; 0: there
    /// is nothing to write. They stay valid until `written`.
    virtual std::size_t gather(Outbox::Gather& out) = 0;
    /// The first `size_bytes` of what waits have been written.
    virtual void written(std::size_t size_bytes, Clock::time_point now) = 0;
    /// Looks at the deadlines; about once a second, and at `wake_at`.
    virtual void tick(Clock::time_point now) = 0;

    /// When `tick` is wanted sooner than usual; nothing: only events are waited for.
    virtual std::optional<Clock::time_point> wake_at() const { return std::nullopt; }

    /// Takes nothing new, answers what is under way, then closes.
    virtual void drain() = 0;
    /// The connection is gone: cancels what it waits for. Only the destructor may follow.
    virtual void end() = 0;

    virtual bool wants_input() const = 0;
    /// Nothing more will come: write what is left, then close.
    virtual bool is_closing() const = 0;
    /// Close at once, whatever is left.
    virtual bool is_dead() const = 0;

    /// Who it is, for logs; empty: nobody said.
    virtual std::string client_name() const = 0;
    /// Why it closes, for logs; empty for a client that just left.
    virtual std::string close_reason() const = 0;

    /// Another protocol that takes over the connection from here, once; asked when all has been
    /// written.
    virtual std::shared_ptr<ByteProtocol> take_successor() { return nullptr; }
};

/// Where a connection comes from.
struct ConnectionOrigin {
    std::uint64_t id = 0;  ///< of this process; stands in logs
    std::string address;
};

/// Runs a function on the connection's thread, some time later; callable from any thread.
using ConnectionPost = std::function<void(std::function<void()>)>;

using ProtocolFactory = std::function<std::shared_ptr<ByteProtocol>(
    const ConnectionOrigin& origin, ConnectionPost post, ByteProtocol::Clock::time_point now)>;

}  // namespace terrane
