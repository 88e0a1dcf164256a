// A TCP connection that never waits past a deadline. The only file of the client that knows Asio.
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

/// One thread. Errors are `io_error` with the system's words; the connection is of no use
/// afterwards.
class Connection {
  public:
    /// Resolves the name and connects, trying each of its addresses.
    static Result<Connection> open(const std::string& host, std::uint16_t port, Deadline deadline);

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
