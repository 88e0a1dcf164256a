// The sockets: listens on one or more ports, accepts connections and gives each a ByteProtocol,
// with TLS between if the port has it. The only file with Asio; it knows nothing of any protocol.
//
// Each io thread has a loop of its own, and a connection lives on one of them from accept to close,
// so a protocol needs no lock. The first loop also accepts. Connections are counted over all ports,
// in all and per address; above a limit they get the port's refusal and are closed.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "server/net/byte_protocol.h"
#include "server/net/endpoint.h"
#include "server/net/tls.h"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

inline constexpr std::size_t kSessionsMax = 16384;
inline constexpr std::size_t kSessionsPerAddressMax = 1024;
inline constexpr std::size_t kIoThreadsMax = 64;

struct ListenPort {
    std::string name;  ///< "tcp" or "http", for messages
    Endpoint endpoint;
    ProtocolFactory make;
    Bytes refusal = {};        ///< written to a client for whom there is no room
    TlsServer* tls = nullptr;  ///< outlives the listener
};

/// What the connections of all ports have done; only ever rises.
struct TrafficCounters {
    std::atomic<std::uint64_t> accepted{0};
    std::atomic<std::uint64_t> refused{0};
    std::atomic<std::uint64_t> tls_failed{0};
    std::atomic<std::uint64_t> bytes_in{0};  ///< as on the wire
    std::atomic<std::uint64_t> bytes_out{0};
};

struct ListenOptions {
    Endpoint endpoint;  ///< of the native protocol
    std::size_t io_threads = 1;
    std::size_t sessions_max = kSessionsMax;
    std::size_t sessions_per_address_max = kSessionsPerAddressMax;
    std::chrono::milliseconds tick{1'000};  ///< how often deadlines are looked at
    std::chrono::milliseconds tls_handshake{kTlsHandshakeMaxMs};
    /// Told about each session's beginning and end, in a sentence; any thread; may be empty.
    std::function<void(std::string_view)> on_event;
    /// Told as `on_event` is, instead of it, of sessions that ended because of malformed input.
    std::function<void(std::string_view)> on_fault = {};
};

/// Calls from the owner's thread, but `sessions` and `traffic`: any.
class Listener {
  public:
    /// Binds the ports; nobody is let in before start(). Fails with `io_error` if an address can't
    /// be bound.
    static Result<std::unique_ptr<Listener>> open(const ListenOptions& options,
                                                  std::vector<ListenPort> ports);
    /// As close() does.
    ~Listener();
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

    /// Begins to accept. To be called once, when all is in place that protocols look at. Fails with
    /// `internal` if there are no threads for it; then close() is all that may follow.
    Result<void> start();
    /// Closes whatever is left and joins the threads: no protocol is called after it.
    void close();

    /// Where a port listens, in the order in which they were given; its number is never 0.
    Endpoint endpoint(std::size_t port_index) const;
    /// Connections that are open now.
    std::size_t sessions() const;
    const TrafficCounters& traffic() const;
    /// Accepts no more, lets every session finish, and returns when all are gone or `time` is over.
    /// True if all were.
    bool drain(std::chrono::milliseconds time);

  private:
    struct Impl;
    explicit Listener(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace terrane
