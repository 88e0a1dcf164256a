// The native protocol over TCP: accepts connections and gives each a Session.
//
// Each io thread has a loop of its own, and a connection lives on one of them from accept to close,
// so a session needs no lock. The first loop also accepts. Connections are counted, in all and per
// address; above a limit they get Failure{busy} and are closed.
#pragma once

#include "protocol/base/result.h"
#include "server/net/endpoint.h"
#include "server/net/session.h"

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string_view>

namespace terrane {

inline constexpr std::size_t kSessionsMax = 16384;
inline constexpr std::size_t kSessionsPerAddressMax = 1024;
inline constexpr std::size_t kIoThreadsMax = 64;

struct ListenOptions {
    Endpoint endpoint;
    std::size_t io_threads = 1;
    std::size_t sessions_max = kSessionsMax;
    std::size_t sessions_per_address_max = kSessionsPerAddressMax;
    std::chrono::milliseconds tick{1'000};  ///< how often deadlines are looked at
    /// Told about each session's beginning and end, in a sentence; any thread; may be empty.
    std::function<void(std::string_view)> on_event;
    /// Told as `on_event` is, instead of it, of sessions that ended because of malformed input.
    std::function<void(std::string_view)> on_fault = {};
};

/// Calls from the owner's thread, but `sessions`: any.
class TcpListener {
  public:
    /// `context` outlives the listener. Fails with `io_error` if the address can't be bound.
    static Result<std::unique_ptr<TcpListener>> open(const ListenOptions& options,
                                                     const SessionContext& context);
    /// Closes whatever is left and joins the threads.
    ~TcpListener();
    TcpListener(const TcpListener&) = delete;
    TcpListener& operator=(const TcpListener&) = delete;

    /// Where it listens; the port is never 0.
    Endpoint endpoint() const;
    /// Connections that are open now.
    std::size_t sessions() const;
    /// Accepts no more, lets every session finish, and returns when all are gone or `time` is over.
    /// True if all were.
    bool drain(std::chrono::milliseconds time);

  private:
    struct Impl;
    explicit TcpListener(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace terrane
