#include "server/net/listener.h"

#include "protocol/base/check.h"
#include "protocol/base/result.h"
#include "server/net/byte_protocol.h"
#include "server/net/client_connection.h"
#include "server/net/endpoint.h"
#include "server/net/listen_options.h"

#include <boost/asio.hpp>

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <exception>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace terrane {

namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
/// As client_connection.cpp has it, which takes no other.
using Socket = asio::basic_stream_socket<tcp, asio::io_context::executor_type>;
using Timer = asio::basic_waitable_timer<std::chrono::steady_clock,
                                         asio::wait_traits<std::chrono::steady_clock>,
                                         asio::io_context::executor_type>;
using boost::system::error_code;
using Clock = ByteProtocol::Clock;

constexpr std::chrono::milliseconds kAcceptRetry{100};

/// One io thread's loop and the connections that live on it.
struct Loop {
    asio::io_context context{1};
    asio::executor_work_guard<asio::io_context::executor_type> guard{context.get_executor()};
    Timer timer{context};
    LoopConnections connections;  // the loop's thread only
};

/// Tells a client that there is no room, and then reads what it sends until it closes or kLinger is
/// over: a socket closed on unread bytes takes the message back. On the loop's thread.
class Refusal : public std::enable_shared_from_this<Refusal> {
  public:
    /// Refusals that linger at a time, over all loops; the others go at once.
    static constexpr int kLingeringMax = 64;

    Refusal(std::atomic<int>& lingering, const ListenPort& port, Socket socket)
        : lingering_(lingering),
          port_(port),
          socket_(std::move(socket)),
          timer_(socket_.get_executor()) {
        ++lingering_;
    }

    ~Refusal() { --lingering_; }

    Refusal(const Refusal&) = delete;
    Refusal& operator=(const Refusal&) = delete;

    void start() {
        error_code error;
        socket_.non_blocking(true, error);
        if (port_.tls == nullptr) {  // before a handshake nothing can be said
            socket_.write_some(asio::buffer(port_.refusal), error);
        }
        socket_.shutdown(Socket::shutdown_send, error);
        if (error || lingering_ > kLingeringMax) {
            return;
        }
        timer_.expires_after(kLinger);
        timer_.async_wait([self = shared_from_this()](error_code) {
            error_code ignored;
            self->socket_.close(ignored);
        });
        read();
    }

  private:
    void read() {
        socket_.async_read_some(asio::buffer(read_buffer_),
                                [self = shared_from_this()](error_code error, std::size_t) {
                                    if (error) {
                                        self->timer_.cancel();
                                        return;
                                    }
                                    self->read();
                                });
    }

    std::atomic<int>& lingering_;
    const ListenPort& port_;
    Socket socket_;
    Timer timer_;
    std::array<std::byte, kSocketReadBytes> read_buffer_{};
};

/// A port and its listening socket, which lives on the first loop.
struct Gate {
    Gate(ListenPort listen_port, asio::io_context& context)
        : port(std::move(listen_port)), acceptor(context), retry(context) {}

    ListenPort port;
    Endpoint bound;
    tcp::acceptor acceptor;
    Timer retry;

    Result<void> bind() {
        error_code error;
        const auto address = asio::ip::make_address(port.endpoint.address, error);
        const tcp::endpoint at(address, port.endpoint.port);
        if (!error) {
            acceptor.open(at.protocol(), error);
        }
        if (!error) {
            acceptor.set_option(tcp::acceptor::reuse_address(true), error);
        }
        if (!error) {
            acceptor.bind(at, error);
        }
        if (!error) {
            acceptor.listen(asio::socket_base::max_listen_connections, error);
        }
        if (error) {
            return fail(ErrorCode::io_error, "cannot listen on " + port.name + " " +
                                                 to_string(port.endpoint) + ": " + error.message());
        }
        bound = {.address = port.endpoint.address, .port = acceptor.local_endpoint().port()};
        return {};
    }

    void close() {
        error_code ignored;
        acceptor.close(ignored);
        retry.cancel();
    }
};

/// Ends a loop, whatever is thrown meanwhile: somebody waits for it.
struct StopAtEnd {
    asio::io_context& context;

    ~StopAtEnd() { context.stop(); }
};

}  // namespace

struct Listener::Impl {
    Impl(const ListenOptions& options, std::vector<ListenPort> ports)
        : shared{.options = options,
                 .admission = {options.sessions_max, options.sessions_per_address_max}} {
        for (std::size_t i = 0; i < options.io_threads; ++i) {
            loops.push_back(std::make_unique<Loop>());
        }
        for (ListenPort& port : ports) {
            gates.push_back(std::make_unique<Gate>(std::move(port), loops.front()->context));
        }
    }

    ~Impl() {
        try {
            close();
        } catch (const std::exception&) {  // no memory to tell the loops: they end as they are
            for (const auto& loop : loops) {
                loop->context.stop();
            }
        }
    }

    void close() {
        if (threads.empty()) {  // nobody runs the loops: not started, or closed already
            for (const auto& gate : gates) {
                gate->close();
            }
            return;
        }
        for (const auto& loop : loops) {
            asio::post(loop->context, [this, &loop = *loop] {
                const StopAtEnd stop{loop.context};
                close_gates(loop);
                loop.timer.cancel();
                for (const auto& connection :
                     std::vector(loop.connections.open.begin(), loop.connections.open.end())) {
                    connection->close();
                }
            });
        }
        threads.clear();
    }

    Result<void> bind() {
        for (const auto& gate : gates) {
            if (auto bound = gate->bind(); !bound) {
                return bound;
            }
        }
        return {};
    }

    void run() {
        TERRANE_ASSERT(threads.empty());
        for (const auto& gate : gates) {
            accept(*gate);
        }
        for (const auto& loop : loops) {
            tick(*loop);
            threads.emplace_back([this, &context = loop->context] { run(context); });
        }
    }

    /// What a handler throws (out of memory, most likely) ends that handler only.
    void run(asio::io_context& context) const {
        while (!context.stopped()) {
            try {
                context.run();
            } catch (const std::exception& failure) {
                shared.event(std::string("a handler failed: ") + failure.what());
            }
        }
    }

    void accept(Gate& gate) {
        Loop& loop = *loops[next_loop++ % loops.size()];
        gate.acceptor.async_accept(
            loop.context, [this, &gate, &loop](error_code error, Socket socket) {
                if (!gate.acceptor.is_open()) {
                    return;
                }
                if (error) {  // out of descriptors, or the client has gone already
                    accept_later(gate);
                    return;
                }
                try {
                    admit(gate, loop, std::move(socket));
                    accept(gate);
                } catch (const std::exception& failure) {  // out of memory, most likely
                    shared.event(std::string("a connection could not be taken: ") + failure.what());
                    accept_later(gate);
                }
            });
    }

    void accept_later(Gate& gate) {
        gate.retry.expires_after(kAcceptRetry);
        gate.retry.async_wait([this, &gate](error_code stopped) {
            if (!stopped && gate.acceptor.is_open()) {
                accept(gate);
            }
        });
    }

    void admit(Gate& gate, Loop& loop, Socket socket) {
        error_code error;
        const auto remote = socket.remote_endpoint(error);
        if (error) {
            return;
        }
        const std::string address = remote.address().to_string();
        if (!shared.admission.enter(address)) {
            shared.traffic.refused.fetch_add(1, std::memory_order_relaxed);
            shared.event("refused a session of " + address + ": too many are open");
            asio::post(loop.context, [refusal = std::make_shared<Refusal>(
                                          lingering_refusals, gate.port, std::move(socket))] {
                refusal->start();
            });
            return;
        }
        std::shared_ptr<ClientConnection> connection;
        try {
            connection = make_client_connection(shared, loop.connections, gate.port,
                                                std::move(socket), address);
        } catch (...) {
            shared.admission.leave(address);
            throw;
        }
        shared.traffic.accepted.fetch_add(1, std::memory_order_relaxed);
        asio::post(loop.context, [connection] { connection->start(); });
    }

    void tick(Loop& loop) {
        loop.timer.expires_after(shared.options.tick);
        loop.timer.async_wait([this, &loop](error_code stopped) {
            if (stopped) {
                return;
            }
            tick(loop);
            const auto now = Clock::now();
            for (const auto& connection :
                 std::vector(loop.connections.open.begin(), loop.connections.open.end())) {
                connection->tick(now);
            }
        });
    }

    /// The gates are the first loop's.
    void close_gates(const Loop& loop) {
        if (&loop == loops.front().get()) {
            for (const auto& gate : gates) {
                gate->close();
            }
        }
    }

    ConnectionContext shared;
    std::atomic<int> lingering_refusals = 0;  // before the loops, whose handlers count it down
    std::vector<std::unique_ptr<Loop>> loops;
    std::vector<std::unique_ptr<Gate>> gates;
    std::size_t next_loop = 0;
    std::vector<std::jthread> threads;
};

Result<std::unique_ptr<Listener>> Listener::open(const ListenOptions& options,
                                                 std::vector<ListenPort> ports) {
    TERRANE_ASSERT(options.io_threads >= 1 && options.io_threads <= kIoThreadsMax);
    auto impl = std::make_unique<Impl>(options, std::move(ports));
    if (const auto bound = impl->bind(); !bound) {
        return tl::unexpected(bound.error());
    }
    return std::unique_ptr<Listener>(new Listener(std::move(impl)));
}

Listener::Listener(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Listener::~Listener() = default;

Result<void> Listener::start() {
    try {
        impl_->run();
    } catch (const std::exception& error) {
        return fail(ErrorCode::internal,
                    std::string("threads for connections cannot be started: ") + error.what());
    }
    return {};
}

void Listener::close() {
    impl_->close();
}

Endpoint Listener::endpoint(std::size_t port_index) const {
    return impl_->gates.at(port_index)->bound;
}

std::size_t Listener::sessions() const {
    return impl_->shared.admission.sessions();
}

const TrafficCounters& Listener::traffic() const {
    return impl_->shared.traffic;
}

bool Listener::drain(std::chrono::milliseconds time) {
    const auto deadline = Clock::now() + time;
    for (const auto& loop : impl_->loops) {
        asio::post(loop->context, [this, &loop = *loop] {
            impl_->close_gates(loop);
            loop.connections.draining = true;
            for (const auto& connection :
                 std::vector(loop.connections.open.begin(), loop.connections.open.end())) {
                connection->drain();
            }
        });
    }
    return impl_->shared.admission.wait_until_empty(deadline);
}

}  // namespace terrane
