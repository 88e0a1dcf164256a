#include "server/net/client_connection.h"

#include "protocol/base/check.h"
#include "protocol/base/result.h"
#include "server/net/byte_protocol.h"
#include "server/net/channel.h"
#include "server/net/listen_options.h"
#include "server/net/tls.h"

#include <boost/asio.hpp>

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
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

/// Writes of one connection in a row, before the others of its thread have their turn.
constexpr int kWritesInARowMax = 8;

/// A socket and what runs over it. Everything on the loop's thread.
class SocketConnection final : public ClientConnection,
                               public std::enable_shared_from_this<SocketConnection> {
  public:
    SocketConnection(ConnectionContext& shared, LoopConnections& loop, const ListenPort& port,
                     Socket socket, std::string address)
        : shared_(shared),
          loop_(loop),
          port_(port),
          socket_(std::move(socket)),
          origin_{.id = shared.next_id.fetch_add(1, std::memory_order_relaxed),
                  .address = std::move(address)},
          connected_(Clock::now()) {}

    void start() override {
        loop_.open.insert(shared_from_this());
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

    void drain() override {
        guarded([this] { protocol().drain(); });
    }

    void tick(Clock::time_point now) override {
        guarded([this, now] {
            if (linger_until_ && now > *linger_until_) {
                close();
            } else if (channel().is_shaking_hands()) {
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

    void close() override {
        if (!socket_.is_open()) {
            return;
        }
        error_code ignored;
        socket_.close(ignored);
        if (channel_) {
            protocol().end();
        }
        shared_.admission.leave(origin_.address);
        loop_.open.erase(shared_from_this());
        report();
    }

  private:
    /// From `start` on: nothing else is called before it.
    Channel& channel() {
        TERRANE_ASSERT(channel_.has_value());
        return *channel_;
    }

    ByteProtocol& protocol() { return channel().protocol(); }

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
        const std::string name = channel_ ? channel_->protocol().client_name() : std::string();
        const std::string reason =
            reason_.empty() && channel_ ? channel_->protocol().close_reason() : reason_;
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
                executor = socket_.get_executor()](std::function<void()> step) {
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
        if (!writing_ && protocol().is_closing() && !linger_until_ && !channel().has_output()) {
            shut_down();
        }
        wake_later();
        if (!reading_ &&
            (linger_until_ || protocol().wants_input() || channel().is_shaking_hands())) {
            read_soon();
        }
    }

    /// Has the protocol called when it wants to be.
    void wake_later() {
        const auto at = protocol().wake_at();
        if (!at || (wakes_at_ && *wakes_at_ <= *at)) {
            return;
        }
        Timer& timer = wake_timer_ ? *wake_timer_ : wake_timer_.emplace(socket_.get_executor());
        wakes_at_ = at;
        timer.expires_at(*at);
        timer.async_wait([weak = weak_from_this()](error_code stopped) {
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
        if (const auto farewell = channel().farewell(); !farewell.empty()) {
            socket_.write_some(asio::buffer(farewell.data(), farewell.size()), ignored);
        }
        linger_until_ = Clock::now() + kLinger;
        socket_.shutdown(Socket::shutdown_send, ignored);
    }

    /// Reads when the other connections that have something to do have had their turn. By then a
    /// busy client's next request is often there; read at once, two in three found nothing.
    void read_soon() {
        reading_ = true;
        asio::post(socket_.get_executor(), [self = shared_from_this()] {
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
        if (channel().is_shaking_hands()) {
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
        if (const auto outcome = channel().receive(bytes); !outcome) {
            shared_.traffic.tls_failed.fetch_add(1, std::memory_order_relaxed);
            reason_ = outcome.error().message;
            error_code ignored;
            const auto alert = channel().alert();
            socket_.write_some(asio::buffer(alert.data(), alert.size()), ignored);
            close();
            return;
        }
        if (channel().input_ended() && socket_.is_open()) {
            input_ended();
        }
    }

    /// Writes what the socket takes at once. False if nothing is left to do, or the rest must wait.
    bool write_some() {
        const auto output = channel().output();
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
        channel().wrote(sent);
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

    ConnectionContext& shared_;
    LoopConnections& loop_;
    const ListenPort& port_;
    Socket socket_;
    const ConnectionOrigin origin_;
    const Clock::time_point connected_;
    std::optional<Channel> channel_;  ///< until `start` there is none
    std::array<std::byte, kSocketReadBytes> read_buffer_{};
    std::vector<asio::const_buffer> buffers_;
    bool reading_ = false;
    bool writing_ = false;
    std::optional<Clock::time_point> linger_until_;
    std::optional<Timer> wake_timer_;  ///< made when it is needed first
    std::optional<Clock::time_point> wakes_at_;
    std::string reason_;  ///< why we close, if the protocol doesn't know
};

}  // namespace

void ConnectionContext::event(const std::string& text) const {
    if (options.on_event) {
        options.on_event(text);
    }
}

void ConnectionContext::fault(const std::string& text) const {
    if (options.on_fault) {
        options.on_fault(text);
    } else {
        event(text);
    }
}

template <typename AnySocket>
std::shared_ptr<ClientConnection> make_client_connection(ConnectionContext& shared,
                                                         LoopConnections& loop,
                                                         const ListenPort& port, AnySocket socket,
                                                         std::string address) {
    return std::make_shared<SocketConnection>(shared, loop, port, std::move(socket),
                                              std::move(address));
}

template std::shared_ptr<ClientConnection> make_client_connection(ConnectionContext& shared,
                                                                  LoopConnections& loop,
                                                                  const ListenPort& port,
                                                                  Socket socket,
                                                                  std::string address);

}  // namespace terrane
