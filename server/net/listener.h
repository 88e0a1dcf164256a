// The sockets: listens on one or more ports, accepts connections and gives each a ByteProtocol,
// with TLS between if the port has it. It knows nothing of any protocol.
//
// Each io thread has a loop of its own, and a connection (client_connection.h) lives on one of them
// from accept to close, so a protocol needs no lock. The first loop also accepts. Connections are
// counted over all ports, in all and per address; above a limit they get the port's refusal and are
// closed.
#pragma once

#include "protocol/base/result.h"
#include "server/net/endpoint.h"
#include "server/net/listen_options.h"

#include <chrono>
#include <cstddef>
#include <memory>
#include <vector>

namespace terrane {

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
