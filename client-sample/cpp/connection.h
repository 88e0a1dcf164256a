// A TCP connection, with TLS in it if wanted, that never waits past a deadline. The only file of
// the client that knows Asio.
#pragma once

#include "protocol/base/result.h"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace terrane {

using Deadline = std::chrono::steady_clock::time_point;

/// Whether and how a connection is encrypted.
struct TlsUse {
    bool enabled = false;
    /// PEM certificates that the server's must be signed by; empty: those that the system trusts.
    std::string ca_file = {};
};

/// One thread. Errors are `io_error` with the system's words; the connection is of no use
/// afterwards.
class Connection {
  public:
    /// Resolves the name and connects, trying each of its addresses. With TLS the server's
    /// certificate must be good for that name.
    static Result<Connection> open(const std::string& host, std::uint16_t port, const TlsUse& tls,
                                   Deadline deadline);

    Connection(Connection&&) noexcept;
    Connection& operator=(Connection&&) noexcept;
    ~Connection();

    /// Sends all of it, or fails at the deadline.
    Result<void> send(std::span<const std::byte> bytes, Deadline deadline);

    /// What has arrived, at least one byte, valid until the next call; empty if nothing came by the
    /// deadline, which is no error. Fails if the peer has closed.
    Result<std::span<const std::byte>> receive(Deadline deadline);

  private:
    struct Socket;

    explicit Connection(std::unique_ptr<Socket> socket);

    std::unique_ptr<Socket> socket_;
};

}  // namespace terrane
