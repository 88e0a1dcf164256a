// A connection: an accepted socket, the TLS in it if its port has it, and the protocol that runs
// over both. It lives on one loop from accept to close, all on that loop's thread, and counts
// itself off when it is over.
//
// No header has Asio in it, so the socket comes in by a template that is there for the listener's
// kind of socket alone.
#pragma once

#include "protocol/base/bytes.h"
#include "server/net/admission.h"
#include "server/net/byte_protocol.h"
#include "server/net/listen_options.h"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <unordered_set>

namespace terrane {

/// Read at a time.
inline constexpr std::size_t kSocketReadBytes = 4096;
/// After the last byte is written, the client's own last bytes are read and thrown away for so
/// long: closing on unread bytes would reset the connection, and the client would lose our last
/// message.
inline constexpr std::chrono::milliseconds kLinger{2'000};

/// What all connections of a listener share; any thread.
struct ConnectionContext {
    const ListenOptions options;
    Admission admission;
    TrafficCounters traffic = {};
    std::atomic<std::uint64_t> next_id = 1;

    void event(const std::string& text) const;
    void fault(const std::string& text) const;
};

/// On the loop's thread, as all below, but for the making.
class ClientConnection {
  public:
    using Clock = ByteProtocol::Clock;

    ClientConnection() = default;
    ClientConnection(const ClientConnection&) = delete;
    ClientConnection& operator=(const ClientConnection&) = delete;
    virtual ~ClientConnection() = default;

    /// To be called first. It has been admitted under its address.
    virtual void start() = 0;
    virtual void drain() = 0;
    /// Looks at the deadlines.
    virtual void tick(Clock::time_point now) = 0;
    virtual void close() = 0;
};

/// What the connections of one loop share.
struct LoopConnections {
    std::unordered_set<std::shared_ptr<ClientConnection>> open;  ///< from `start` to `close`
    bool draining = false;
    Bytes plain;  ///< scratch
};

/// All that is given by reference outlives the connection.
template <typename Socket>
std::shared_ptr<ClientConnection> make_client_connection(ConnectionContext& shared,
                                                         LoopConnections& loop,
                                                         const ListenPort& port, Socket socket,
                                                         std::string address);

}  // namespace terrane
