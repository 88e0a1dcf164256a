#include "client-sample/cpp/connection.h"

#include "client-sample/cpp/tls_peer.h"
#include "protocol/base/result.h"

#include <boost/asio/buffer.hpp>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/write.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace terrane {

namespace asio = boost::asio;
using boost::system::error_code;

namespace {

constexpr std::size_t kReceiveBytes = std::size_t{64} << 10U;

}  // namespace

struct Connection::Socket {
    asio::io_context context;
    asio::ip::tcp::socket socket{context};
    std::optional<asio::ssl::context> tls_context;
    std::optional<asio::ssl::stream<asio::ip::tcp::socket&>> tls;
    std::vector<std::byte> received = std::vector<std::byte>(kReceiveBytes);
    std::string peer;

    /// Runs what was started until it is done; false if the deadline came first, and then it is
    /// cancelled.
    template <typename Cancel>
    bool run_until(Deadline deadline, Cancel cancel) {
        context.restart();
        context.run_until(deadline);
        if (context.stopped()) {
            return true;
        }
        cancel();
        context.run();
        return false;
    }

    /// Calls `use` with what bytes go through: the socket, or TLS on it.
    template <typename Use>
    void with_stream(Use use) {
        if (tls) {
            use(*tls);
        } else {
            use(socket);
        }
    }

    Result<void> shake_hands(const std::string& host, const std::string& ca_file,
                             Deadline deadline) {
        tls_context.emplace(asio::ssl::context::tls_client);
        if (auto trusted = demand_trust(tls_context->native_handle(), ca_file); !trusted) {
            return trusted;
        }
        tls.emplace(socket, *tls_context);
        if (const auto named = demand_host(tls->native_handle(), host); !named) {
            return failure(named.error().message);
        }
        error_code outcome;
        tls->async_handshake(asio::ssl::stream_base::client,
                             [&](error_code shaken) { outcome = shaken; });
        if (!run_until(deadline, [this] { socket.cancel(); })) {
            return failure("no TLS handshake in time");
        }
        if (outcome) {
            return failure("TLS: " + outcome.message());
        }
        return {};
    }

    tl::unexpected<Error> failure(const std::string& what) const {
        return fail(ErrorCode::io_error, peer + ": " + what);
    }
};

Connection::Connection(std::unique_ptr<Socket> socket) : socket_(std::move(socket)) {}

Connection::Connection(Connection&&) noexcept = default;
Connection& Connection::operator=(Connection&&) noexcept = default;
Connection::~Connection() = default;

Result<Connection> Connection::open(const std::string& host, std::uint16_t port, const TlsUse& tls,
                                    Deadline deadline) {
    auto opened = std::make_unique<Socket>();
    opened->peer = host + ":" + std::to_string(port);
    asio::ip::tcp::resolver resolver(opened->context);
    error_code outcome;
    resolver.async_resolve(
        host, std::to_string(port),
        [&](error_code error, const asio::ip::tcp::resolver::results_type& addresses) {
            outcome = error;
            if (error) {
                return;
            }
            asio::async_connect(
                opened->socket, addresses,
                [&](error_code connect_error, const auto&) { outcome = connect_error; });
        });
    const bool in_time = opened->run_until(deadline, [&] {
        resolver.cancel();
        error_code ignored;
        opened->socket.close(ignored);
    });
    if (!in_time) {
        return opened->failure("no connection in time");
    }
    if (outcome) {
        return opened->failure(outcome.message());
    }
    // Requests are small and wanted at once.
    opened->socket.set_option(asio::ip::tcp::no_delay(true), outcome);
    if (tls.enabled) {
        if (const auto shaken = opened->shake_hands(host, tls.ca_file, deadline); !shaken) {
            return tl::unexpected(shaken.error());
        }
    }
    return Connection(std::move(opened));
}

Result<void> Connection::send(std::span<const std::byte> bytes, Deadline deadline) {
    error_code outcome;
    socket_->with_stream([&](auto& stream) {
        asio::async_write(stream, asio::buffer(bytes.data(), bytes.size()),
                          [&](error_code error, std::size_t) { outcome = error; });
    });
    if (!socket_->run_until(deadline, [this] { socket_->socket.cancel(); })) {
        return socket_->failure("the server does not take what is sent to it");
    }
    if (outcome) {
        return socket_->failure(outcome.message());
    }
    return {};
}

Result<std::span<const std::byte>> Connection::receive(Deadline deadline) {
    error_code outcome;
    std::size_t received_bytes = 0;
    socket_->with_stream([&](auto& stream) {
        stream.async_read_some(asio::buffer(socket_->received),
                               [&](error_code error, std::size_t size_bytes) {
                                   outcome = error;
                                   received_bytes = size_bytes;
                               });
    });
    const bool in_time = socket_->run_until(deadline, [this] { socket_->socket.cancel(); });
    if (received_bytes > 0) {
        return std::span<const std::byte>(socket_->received).first(received_bytes);
    }
    if (!in_time) {
        return std::span<const std::byte>();
    }
    if (outcome == asio::error::eof || outcome == asio::ssl::error::stream_truncated) {
        return socket_->failure("the server closed the connection");
    }
    return socket_->failure(outcome.message());
}

}  // namespace terrane
