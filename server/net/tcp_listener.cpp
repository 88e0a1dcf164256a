#include "server/net/tcp_listener.h"

#include "protocol/base/check.h"
#include "protocol/base/mutex.h"

#include <boost/asio.hpp>

#include <array>
#include <atomic>
#include <exception>
#include <string>
#include <thread>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

namespace terrane {

namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;
using Clock = Session::Clock;

constexpr std::size_t kReadBytes = 4096;
/// After the last byte is written, the client's own last bytes are read and thrown away for so
/// long: closing on unread bytes would reset the connection, and the client would lose our last
/// message.
constexpr std::chrono::milliseconds kLinger{2'000};
constexpr std::chrono::milliseconds kAcceptRetry{100};

/// Counts connections, in all and per address. Any thread.
class Admission {
  public:
    Admission(std::size_t sessions_max, std::size_t per_address_max)
        : sessions_max_(sessions_max), per_address_max_(per_address_max) {}

    bool enter(const std::string& address) {
        const MutexLock lock(mutex_);
        if (sessions_ >= sessions_max_) {
            return false;
        }
        const auto found = by_address_.try_emplace(address, 0).first;
        if (found->second >= per_address_max_) {
            return false;
        }
        ++found->second;
        ++sessions_;
        return true;
    }

    void leave(const std::string& address) {
        {
            const MutexLock lock(mutex_);
            --sessions_;
            if (const auto found = by_address_.find(address); --found->second == 0) {
                by_address_.erase(found);
            }
        }
        changed_.notify_all();
    }

    std::size_t sessions() const {
        const MutexLock lock(mutex_);
        return sessions_;
    }

    /// True if nobody is left before `deadline`.
    bool wait_until_empty(Clock::time_point deadline) {
        MutexLock lock(mutex_);
        while (sessions_ > 0) {
            if (Clock::now() >= deadline) {
                return false;
            }
            lock.wait_until(changed_, deadline);
        }
        return true;
    }

  private:
    const std::size_t sessions_max_;
    const std::size_t per_address_max_;
    mutable Mutex mutex_;
    std::condition_variable_any changed_;
    std::size_t sessions_ TERRANE_GUARDED_BY(mutex_) = 0;
    std::unordered_map<std::string, std::size_t> by_address_ TERRANE_GUARDED_BY(mutex_);
};

class Connection;

/// One io thread's loop and the connections that live on it.
struct Loop {
    asio::io_context context{1};
    asio::executor_work_guard<asio::io_context::executor_type> guard{context.get_executor()};
    asio::steady_timer timer{context};
    std::unordered_set<std::shared_ptr<Connection>> connections;  // the loop's thread only
    bool draining = false;                                        // the loop's thread only
};

struct Shared {
    const ListenOptions options;
    const SessionContext& session_context;
    Admission admission;

    void event(const std::string& text) const {
        if (options.on_event) {
            options.on_event(text);
        }
    }
};

/// A socket and its session. Everything on the loop's thread.
class Connection : public std::enable_shared_from_this<Connection> {
  public:
    Connection(Shared& shared, Loop& loop, tcp::socket socket, std::string address)
        : shared_(shared),
          loop_(loop),
          socket_(std::move(socket)),
          address_(std::move(address)),
          wake_(loop.context) {}

    /// Already admitted under its address.
    void start() {
        loop_.connections.insert(shared_from_this());
        guarded([this] {
            error_code ignored;
            socket_.set_option(tcp::no_delay(true), ignored);
            session_ = std::make_shared<Session>(shared_.session_context, post(), Clock::now());
            if (loop_.draining) {
                session_->drain();
            }
        });
    }

    void drain() {
        guarded([this] { session_->drain(); });
    }

    void tick(Clock::time_point now) {
        guarded([this, now] {
            if (linger_until_ && now > *linger_until_) {
                close();
                return;
            }
            session_->tick(now);
        });
    }

    void close() {
        if (!socket_.is_open()) {
            return;
        }
        error_code ignored;
        socket_.close(ignored);
        wake_.cancel();
        if (session_) {
            session_->end();
            const std::string& reason = session_->close_reason();
            const std::string text = "session of " + address_ + " \"" + session_->client_name() +
                                     "\" ended" + (reason.empty() ? "" : ": " + reason);
            if (reason.starts_with(to_string(ErrorCode::malformed)) && shared_.options.on_fault) {
                shared_.options.on_fault(text);
            } else {
                shared_.event(text);
            }
        }
        shared_.admission.leave(address_);
        loop_.connections.erase(shared_from_this());
    }

  private:
    /// Runs a step of the session and then whatever reading and writing follows from it. One of the
    /// places where exceptions end: they end the connection.
    template <typename Step>
    void guarded(Step step) {
        const auto alive = shared_from_this();
        try {
            step();
            pump();
        } catch (const std::exception& error) {
            shared_.event("session of " + address_ + " failed: " + error.what());
            close();
        }
    }

    Session::Post post() {
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
        if (!socket_.is_open()) {
            return;
        }
        if (session_->is_dead()) {
            close();
            return;
        }
        if (!session_->outbox().empty() && !writing_) {
            write();
        }
        if (session_->is_closing() && session_->outbox().empty() && !linger_until_) {
            linger_until_ = Clock::now() + kLinger;
            error_code ignored;
            socket_.shutdown(tcp::socket::shutdown_send, ignored);
        }
        if (!reading_ && (linger_until_ || session_->wants_input())) {
            read();
        }
        wake_later();
    }

    /// When the session holds back what it could send, it is asked again at the time it names.
    void wake_later() {
        const auto at = session_->wake_at();
        if (at == wake_at_) {
            return;
        }
        wake_at_ = at;
        wake_.cancel();
        if (at) {
            wake_.expires_at(*at);
            wake_.async_wait([self = shared_from_this()](error_code stopped) {
                if (!stopped && self->socket_.is_open()) {
                    self->wake_at_.reset();
                    self->guarded([&] { self->session_->tick(Clock::now()); });
                }
            });
        }
    }

    void read() {
        reading_ = true;
        socket_.async_read_some(
            asio::buffer(read_buffer_),
            [self = shared_from_this()](error_code error, std::size_t size_bytes) {
                self->reading_ = false;
                if (error) {
                    self->close();
                    return;
                }
                self->guarded([&] {
                    if (!self->linger_until_ && !self->session_->is_closing()) {
                        self->session_->receive(std::span(self->read_buffer_).first(size_bytes),
                                                Clock::now());
                    }
                });
            });
    }

    void write() {
        writing_ = true;
        Outbox::Gather parts;
        const std::size_t count = session_->outbox().gather(parts);
        std::vector<asio::const_buffer> buffers;
        buffers.reserve(count);
        for (std::size_t i = 0; i < count; ++i) {
            buffers.emplace_back(parts[i].data(), parts[i].size());
        }
        socket_.async_write_some(
            buffers, [self = shared_from_this()](error_code error, std::size_t size_bytes) {
                self->writing_ = false;
                if (error) {
                    self->close();
                    return;
                }
                self->guarded([&] { self->session_->written(size_bytes, Clock::now()); });
            });
    }

    Shared& shared_;
    Loop& loop_;
    tcp::socket socket_;
    const std::string address_;
    std::shared_ptr<Session> session_;
    std::array<std::byte, kReadBytes> read_buffer_{};
    bool reading_ = false;
    bool writing_ = false;
    std::optional<Clock::time_point> linger_until_;
    asio::steady_timer wake_;
    std::optional<Clock::time_point> wake_at_;  ///< what `wake_` is set to
};

/// Tells a client that there is no room, and then reads what it sends until it closes or kLinger is
/// over: a socket closed on unread bytes takes the message back. On the loop's thread.
class Refusal : public std::enable_shared_from_this<Refusal> {
  public:
    /// Refusals that linger at a time, over all loops; the others go at once.
    static constexpr int kLingeringMax = 64;

    Refusal(std::atomic<int>& lingering, tcp::socket socket)
        : lingering_(lingering), socket_(std::move(socket)), timer_(socket_.get_executor()) {
        ++lingering_;
    }

    ~Refusal() { --lingering_; }

    Refusal(const Refusal&) = delete;
    Refusal& operator=(const Refusal&) = delete;

    void start() {
        const Bytes message = encode_message(
            Failure{.request_id = 0,
                    .error = {.code = ErrorCode::busy, .message = "too many sessions are open"},
                    .retry_after_ms = 1000,
                    .key = std::nullopt});
        error_code error;
        socket_.non_blocking(true, error);
        socket_.write_some(asio::buffer(message), error);
        socket_.shutdown(tcp::socket::shutdown_send, error);
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
    tcp::socket socket_;
    asio::steady_timer timer_;
    std::array<std::byte, kReadBytes> read_buffer_{};
};

}  // namespace

struct TcpListener::Impl {
    Impl(const ListenOptions& options, const SessionContext& session_context)
        : shared{.options = options,
                 .session_context = session_context,
                 .admission = {options.sessions_max, options.sessions_per_address_max}} {
        for (std::size_t i = 0; i < options.io_threads; ++i) {
            loops.push_back(std::make_unique<Loop>());
        }
        acceptor.emplace(loops.front()->context);
        retry.emplace(loops.front()->context);
    }

    ~Impl() {
        for (const auto& loop : loops) {
            asio::post(loop->context, [this, &loop = *loop] {
                if (&loop == loops.front().get()) {
                    close_acceptor();
                }
                for (const auto& connection :
                     std::vector(loop.connections.begin(), loop.connections.end())) {
                    connection->close();
                }
                loop.timer.cancel();
                loop.context.stop();
            });
        }
        threads.clear();
    }

    Result<void> bind() {
        const Endpoint& endpoint = shared.options.endpoint;
        error_code error;
        const auto address = asio::ip::make_address(endpoint.address, error);
        const tcp::endpoint at(address, endpoint.port);
        if (!error) {
            acceptor->open(at.protocol(), error);
        }
        if (!error) {
            acceptor->set_option(tcp::acceptor::reuse_address(true), error);
        }
        if (!error) {
            acceptor->bind(at, error);
        }
        if (!error) {
            acceptor->listen(asio::socket_base::max_listen_connections, error);
        }
        if (error) {
            return fail(ErrorCode::io_error,
                        "cannot listen on tcp " + to_string(endpoint) + ": " + error.message());
        }
        bound = {.address = endpoint.address, .port = acceptor->local_endpoint().port()};
        return {};
    }

    void run() {
        accept();
        for (const auto& loop : loops) {
            tick(*loop);
            threads.emplace_back([&context = loop->context] { context.run(); });
        }
    }

    void accept() {
        Loop& loop = *loops[next_loop++ % loops.size()];
        acceptor->async_accept(loop.context, [this, &loop](error_code error, tcp::socket socket) {
            if (!acceptor->is_open()) {
                return;
            }
            if (error) {  // out of descriptors, or the client has gone already
                retry->expires_after(kAcceptRetry);
                retry->async_wait([this](error_code stopped) {
                    if (!stopped && acceptor->is_open()) {
                        accept();
                    }
                });
                return;
            }
            admit(loop, std::move(socket));
            accept();
        });
    }

    void admit(Loop& loop, tcp::socket socket) {
        error_code error;
        const auto remote = socket.remote_endpoint(error);
        if (error) {
            return;
        }
        const std::string address = remote.address().to_string();
        if (!shared.admission.enter(address)) {
            shared.event("refused a session of " + address + ": too many are open");
            asio::post(loop.context,
                       [refusal = std::make_shared<Refusal>(
                            lingering_refusals, std::move(socket))] { refusal->start(); });
            return;
        }
        const auto connection =
            std::make_shared<Connection>(shared, loop, std::move(socket), address);
        asio::post(loop.context, [connection] { connection->start(); });
    }

    void tick(Loop& loop) {
        loop.timer.expires_after(shared.options.tick);
        loop.timer.async_wait([this, &loop](error_code stopped) {
            if (stopped) {
                return;
            }
            const auto now = Clock::now();
            for (const auto& connection :
                 std::vector(loop.connections.begin(), loop.connections.end())) {
                connection->tick(now);
            }
            tick(loop);
        });
    }

    void close_acceptor() {
        error_code ignored;
        acceptor->close(ignored);
        retry->cancel();
    }

    Shared shared;
    std::atomic<int> lingering_refusals = 0;  // before the loops, whose handlers count it down
    std::vector<std::unique_ptr<Loop>> loops;
    std::optional<tcp::acceptor> acceptor;
    std::optional<asio::steady_timer> retry;
    Endpoint bound;
    std::size_t next_loop = 0;
    std::vector<std::jthread> threads;
};

Result<std::unique_ptr<TcpListener>> TcpListener::open(const ListenOptions& options,
                                                       const SessionContext& context) {
    TERRANE_ASSERT(options.io_threads >= 1 && options.io_threads <= kIoThreadsMax);
    auto impl = std::make_unique<Impl>(options, context);
    if (const auto bound = impl->bind(); !bound) {
        return tl::unexpected(bound.error());
    }
    impl->run();
    return std::unique_ptr<TcpListener>(new TcpListener(std::move(impl)));
}

TcpListener::TcpListener(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

TcpListener::~TcpListener() = default;

Endpoint TcpListener::endpoint() const {
    return impl_->bound;
}

std::size_t TcpListener::sessions() const {
    return impl_->shared.admission.sessions();
}

bool TcpListener::drain(std::chrono::milliseconds time) {
    const auto deadline = Clock::now() + time;
    for (const auto& loop : impl_->loops) {
        asio::post(loop->context, [this, &loop = *loop] {
            if (&loop == impl_->loops.front().get()) {
                impl_->close_acceptor();
            }
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
