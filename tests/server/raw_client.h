// A client for tests that sends whatever bytes it is told to, over a real socket.
#pragma once

#include "protocol/wire/frame.h"
#include "protocol/wire/messages.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace terrane {

struct ReceivedMessage {
    AnyMessage message;
    Bytes payload;
};

class RawClient {
  public:
    /// `receive_buffer_bytes`: of the socket; 0: the system's choice.
    explicit RawClient(std::uint16_t port, int receive_buffer_bytes = 0)
        : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
        if (receive_buffer_bytes > 0) {
            ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes,
                         sizeof(receive_buffer_bytes));
        }
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(port);
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        connected_ =
            ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    }

    ~RawClient() { ::close(socket_); }

    RawClient(const RawClient&) = delete;
    RawClient& operator=(const RawClient&) = delete;

    bool connected() const { return connected_; }

    bool send(std::span<const std::byte> bytes) {
        while (!bytes.empty()) {
            const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
            if (sent <= 0) {
                return false;
            }
            bytes = bytes.subspan(static_cast<std::size_t>(sent));
        }
        return true;
    }

    bool send(const AnyMessage& message) { return send(encode_message(message)); }

    /// As much as the socket takes at once; false when the server has closed.
    bool send_some(std::span<const std::byte>& bytes) {
        const ssize_t sent =
            ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        bytes = bytes.subspan(sent > 0 ? static_cast<std::size_t>(sent) : 0);
        return sent > 0 || errno == EAGAIN || errno == EWOULDBLOCK;
    }

    /// Takes what has come and throws it away; how much that was.
    std::size_t drop_received() {
        std::array<std::byte, 65536> buffer;
        std::size_t dropped = 0;
        for (ssize_t got = 0;
             (got = ::recv(socket_, buffer.data(), buffer.size(), MSG_DONTWAIT)) > 0;
             dropped += static_cast<std::size_t>(got)) {
        }
        return dropped;
    }

    /// The next message; nothing when the server has closed, or is silent for ten seconds.
    std::optional<ReceivedMessage> next() {
        while (true) {
            auto frame = reader_.next();
            if (!frame) {
                ADD_FAILURE() << frame.error().message;
                return std::nullopt;
            }
            if (*frame) {
                auto message = decode_message(**frame);
                if (!message) {
                    ADD_FAILURE() << message.error().message;
                    return std::nullopt;
                }
                const auto payload = (*frame)->payload;
                return ReceivedMessage{.message = *std::move(message),
                                       .payload = {payload.begin(), payload.end()}};
            }
            pollfd ready{.fd = socket_, .events = POLLIN, .revents = 0};
            if (::poll(&ready, 1, 10'000) <= 0) {
                timed_out_ = true;
                return std::nullopt;
            }
            std::array<std::byte, 65536> buffer;
            const ssize_t received = ::recv(socket_, buffer.data(), buffer.size(), 0);
            if (received <= 0) {
                closed_ = true;
                return std::nullopt;
            }
            reader_.feed(std::span(buffer).first(static_cast<std::size_t>(received)));
        }
    }

    template <typename Message>
    std::optional<Message> next_as() {
        const auto received = next();
        if (!received) {
            return std::nullopt;
        }
        const auto* message = std::get_if<Message>(&received->message);
        if (message == nullptr) {
            ADD_FAILURE() << "not the message that was waited for but "
                          << name_of(received->message);
            return std::nullopt;
        }
        return *message;
    }

    std::optional<ServerHello> hello() {
        send(ClientHello{.protocol_version = kProtocolVersion, .client_name = "raw", .token = {}});
        return next_as<ServerHello>();
    }

    /// True once the server has closed; reads what is left before.
    bool is_closed() {
        while (next()) {
        }
        return closed_ && !timed_out_;
    }

  private:
    int socket_;
    bool connected_ = false;
    bool closed_ = false;
    bool timed_out_ = false;
    FrameReader reader_{kOutboundFrameLimits};
};

}  // namespace terrane
