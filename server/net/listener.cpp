#include "server/net/listener.h"

#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/result.h"
#include "server/net/admission.h"
#include "server/net/byte_protocol.h"
#include "server/net/channel.h"
#include "server/net/endpoint.h"
#include "server/net/tls.h"

#include <boost/asio.hpp>

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <unordered_set>
#include <utility>
#include <vector>

namespace terrane {

namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
/// With the loop's own executor: the usual one is looked up anew at each read.
using Socket = asio::basic_stream_socket<tcp, asio::io_context::executor_type>;
using Timer = asio::basic_waitable_timer<std::chrono::steady_clock,
                                         asio::wait_traits<std::chrono::steady_clock>,
                                         asio::io_context::executor_type>;
using boost::system::error_code;
using Clock = ByteProtocol::Clock;

constexpr std::size_t kReadBytes = 4096;
/// Writes of one connection in a row, before the others of its thread have their turn.
constexpr int kWritesInARowMax = 8;
/// After the last byte is written, the client's own last bytes are read and thrown away for so
/// long: closing on unread bytes would reset the connection, and the client would lose our last
/// message.
constexpr std::chrono::milliseconds kLinger{2'000};
constexpr std::chrono::milliseconds kAcceptRetry{100};

class Connection;

/// One io thread's loop and the connections that live on it.
struct Loop {
    asio::io_context context{1};
    asio::executor_work_guard<asio::io_context::executor_type> guard{context.get_executor()};
    Timer timer{context};
    std::unordered_set<std::shared_ptr<Connection>> connections;  // the loop's thread only
    bool draining = false;                                        // the loop's thread only
    Bytes plain;                                                  // scratch, the loop's thread only
};

struct Shared {
    const ListenOptions options;
    Admission admission;
    TrafficCounters traffic = {};
    std::atomic<std::uint64_t> next_id = 1;

    void event(const std::string& text) const {
        if (options.on_event) {
            options.on_event(text);
        }
    }

    void fault(const std::string& text) const {
        if (options.on_fault) {
            options.on_fault(text);
        } else {
            event(text);
        }
    }
};

/// A socket and what runs over it. Everything on the loop's thread.
class Connection : public std::enable_shared_from_this<Connection> {
  public:
    Connection(Shared& shared, Loop& loop, const ListenPort& port, Socket socket,
               std::string address)
        : shared_(shared),
          loop_(loop),
          port_(port),
          socket_(std::move(socket)),
          origin_{.id = shared.next_id.fetch_add(1, std::memory_order_relaxed),
                  .address = std::move(address)},
          connected_(Clock::now()) {}

    /// Already admitted under its address.
    void start() {
        loop_.connections.insert(shared_from_this());
        guarded([this] {
            error_code ignored;
            socket_.set_option(tcp::no_delay(true), ignored);
            socket_.non_blocking(true, ignored);
            std::unique_ptr<TlsChannel> tls;
            if (port_.tls != nullptr) {
                auto accepted = port_.tls->accept();
                if (!accepted) {
                    reason_ = accepted.error().message;
                    close();
                    return;
                }
                tls = *std::move(accepted);
            }
            channel_.emplace(port_.make(origin_, post(), Clock::now()), std::move(tls),
                             loop_.plain);
            if (loop_.draining) {
                protocol().drain();
            }
        });
    }

    void drain() {
        guarded([this] { protocol().drain(); });
    }

    void tick(Clock::time_point now) {
        guarded([this, now] {
            if (linger_until_ && now > *linger_until_) {
                close();
            } else if (channel_->is_shaking_hands()) {
                if (now - connected_ > shared_.options.tls_handshake) {
                    shared_.traffic.tls_failed.fetch_add(1, std::memory_order_relaxed);
                    reason_ = "no TLS handshake in time";
                    close();
                }
            } else {
                protocol().tick(now);
            }
        });
    }

    void close() {
        if (!socket_.is_open()) {
            return;
        }
        error_code ignored;
        socket_.close(ignored);
        if (channel_) {
            protocol().end();
        }
        shared_.admission.leave(origin_.address);
        loop_.connections.erase(shared_from_this());
        report();
    }

  private:
    ByteProtocol& protocol() { return channel_->protocol(); }

    const ByteProtocol& protocol() const { return channel_->protocol(); }

    /// Runs a step of the protocol and then whatever reading and writing follows from it. One of
    /// the places where exceptions end: they end the connection.
    template <typename Step>
    void guarded(const Step& step) {
        const auto alive = shared_from_this();
        try {
            step();
            pump();
        } catch (const std::exception& error) {
            fail_with(error);
        }
    }

    void fail_with(const std::exception& error) {
        reason_ = std::string("failed: ") + error.what();
        close();
    }

    void report() const {
        const std::string name = channel_ ? protocol().client_name() : std::string();
        const std::string reason =
            reason_.empty() && channel_ ? protocol().close_reason() : reason_;
        std::string text =
            port_.name + " session " + std::to_string(origin_.id) + " of " + origin_.address;
        text += name.empty() ? "" : " \"" + name + "\"";
        text += " ended";
        text += reason.empty() ? "" : ": " + reason;
        if (reason.starts_with(to_string(ErrorCode::malformed))) {
            shared_.fault(text);
        } else {
            shared_.event(text);
        }
    }

    ConnectionPost post() {
        return [weak = weak_from_this(),
                executor = loop_.context.get_executor()](std::function<void()> step) {
            asio::post(executor, [weak, step = std::move(step)] {
                if (const auto self = weak.lock(); self && self->socket_.is_open()) {
                    self->guarded(step);
                }
            });
        };
    }

    void pump() {
        if (!socket_.is_open() || !channel_) {
            return;
        }
        int writes = 0;
        while (!protocol().is_dead() && !writing_ && writes < kWritesInARowMax && write_some()) {
            ++writes;
        }
        if (!socket_.is_open()) {
            return;
        }
        if (protocol().is_dead()) {
            close();
            return;
        }
        if (writes == kWritesInARowMax) {
            wait_for_room();  // which there is; but others come first
        }
        if (!writing_ && protocol().is_closing() && !linger_until_ && !channel_->has_output()) {
            shut_down();
        }
        wake_later();
        if (!reading_ &&
            (linger_until_ || protocol().wants_input() || channel_->is_shaking_hands())) {
            read_soon();
        }
    }

    /// Has the protocol called when it wants to be.
    void wake_later() {
        const auto at = protocol().wake_at();
        if (!at || (wakes_at_ && *wakes_at_ <= *at)) {
            return;
        }
        if (!wake_timer_) {
            wake_timer_.emplace(socket_.get_executor());
        }
        wakes_at_ = at;
        wake_timer_->expires_at(*at);
        wake_timer_->async_wait([weak = weak_from_this()](error_code stopped) {
            const auto self = weak.lock();
            if (stopped || !self || !self->socket_.is_open()) {
                return;
            }
            self->wakes_at_.reset();
            self->guarded([&] { self->protocol().tick(Clock::now()); });
        });
    }

    void shut_down() {
        error_code ignored;
        if (const auto farewell = channel_->farewell(); !farewell.empty()) {
            socket_.write_some(asio::buffer(farewell.data(), farewell.size()), ignored);
        }
        linger_until_ = Clock::now() + kLinger;
        socket_.shutdown(Socket::shutdown_send, ignored);
    }

    /// Reads when the other connections that have something to do have had their turn. By then a
    /// busy client's next request is often there; read at once, two in three found nothing.
    void read_soon() {
        reading_ = true;
        asio::post(loop_.context, [self = shared_from_this()] {
            try {
                if (self->socket_.is_open()) {
                    self->read();
                }
            } catch (const std::exception& error) {
                self->fail_with(error);
            }
        });
    }

    void read() {
        socket_.async_read_some(
            asio::buffer(read_buffer_),
            [self = shared_from_this()](error_code error, std::size_t size_bytes) {
                self->reading_ = false;
                if (error && (error != asio::error::eof || self->linger_until_)) {
                    self->close();
                    return;
                }
                self->guarded([&] {
                    if (error) {
                        self->input_ended();
                    } else {
                        self->received(std::span(self->read_buffer_).first(size_bytes));
                    }
                });
            });
    }

    void input_ended() {
        if (channel_->is_shaking_hands()) {
            close();
            return;
        }
        protocol().input_ended();
        if (protocol().is_closing() || protocol().is_dead()) {
            return;
        }
        if (protocol().wants_input()) {
            close();  // it would read for ever
            return;
        }
        // It has something to say yet. Nobody reads from now on, so a reset must be waited for.
        socket_.async_wait(Socket::wait_error,
                           [self = shared_from_this()](error_code) { self->close(); });
    }

    void received(std::span<const std::byte> bytes) {
        shared_.traffic.bytes_in.fetch_add(bytes.size(), std::memory_order_relaxed);
        if (linger_until_) {
            return;
        }
        if (const auto outcome = channel_->receive(bytes); !outcome) {
            shared_.traffic.tls_failed.fetch_add(1, std::memory_order_relaxed);
            reason_ = outcome.error().message;
            error_code ignored;
            const auto alert = channel_->alert();
            socket_.write_some(asio::buffer(alert.data(), alert.size()), ignored);
            close();
            return;
        }
        if (channel_->input_ended() && socket_.is_open()) {
            input_ended();
        }
    }

    /// Writes what the socket takes at once. False if nothing is left to do, or the rest must wait.
    bool write_some() {
        const auto output = channel_->output();
        if (!output) {
            reason_ = output.error().message;
            close();
            return false;
        }
        if (output->empty()) {
            return false;
        }
        std::size_t size = 0;
        buffers_.clear();
        for (const auto part : *output) {
            buffers_.emplace_back(part.data(), part.size());
            size += part.size();
        }
        error_code error;
        const std::size_t sent = socket_.write_some(buffers_, error);
        if (error == asio::error::would_block || error == asio::error::try_again) {
            wait_for_room();
            return false;
        }
        if (error) {
            close();
            return false;
        }
        shared_.traffic.bytes_out.fetch_add(sent, std::memory_order_relaxed);
        channel_->wrote(sent);
        if (sent < size) {
            wait_for_room();
            return false;
        }
        return true;
    }

    void wait_for_room() {
        writing_ = true;
        socket_.async_wait(Socket::wait_write, [self = shared_from_this()](error_code error) {
            self->writing_ = false;
            if (error) {
                self->close();
                return;
            }
            self->guarded([] {});
        });
    }

    Shared& shared_;
    Loop& loop_;
    const ListenPort& port_;
    Socket socket_;
    const ConnectionOrigin origin_;
    const Clock::time_point connected_;
    std::optional<Channel> channel_;  ///< until `start` there is none
    std::array<std::byte, kReadBytes> read_buffer_{};
    std::vector<asio::const_buffer> buffers_;
    bool reading_ = false;
    bool writing_ = false;
    std::optional<Clock::time_point> linger_until_;
    std::optional<Timer> wake_timer_;  ///< made when it is needed first
    std::optional<Clock::time_point> wakes_at_;
    std::string reason_;  ///< why we close, if the protocol doesn't know
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
    std::array<std::byte, kReadBytes> read_buffer_{};
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
                     std::vector(loop.connections.begin(), loop.connections.end())) {
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
        std::shared_ptr<Connection> connection;
        try {
            connection =
                std::make_shared<Connection>(shared, loop, gate.port, std::move(socket), address);
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
                 std::vector(loop.connections.begin(), loop.connections.end())) {
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

    Shared shared;
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
            loop.draining = true;
            for (const auto& connection :
                 std::vector(loop.connections.begin(), loop.connections.end())) {
                connection->drain();
            }
        });
    }
    return impl_->shared.admission.wait_until_empty(deadline);
}

}  // namespace terrane
