// A server of a few lines for client tests: one connection on a loopback port, played by the test's
// own script on a thread of its own.
#pragma once

#include "protocol/wire/messages.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <thread>

namespace terrane {

inline ServerHello test_hello() {
    return {.protocol_version = kProtocolVersion,
            .server_version = "test",
            .generator_version = 1,
            .encoding_version = 1,
            .world_name = "scripted",
            .fingerprint = {.high = 1, .low = 2},
            .content_id = {.high = 3, .low = 4},
            .chunk_side = 32,
            .chunk_height = 32,
            .voxel_size_m = 1,
            .levels = 1,
            .height_bound_voxels = 100,
            .materials = {{.name = "rock", .color_rgb = 0x808080, .texture = {}, .solid = true}},
            .limits = {.keys_per_request_max = 64,
                       .keys_in_flight_max = 1024,
                       .inbound_frame_bytes_max = kInboundFrameBytesMax,
                       .payload_bytes_max = kPayloadBytesMax}};
}

/// The server's end of one connection. What it can't do (the client has gone) it does not do.
class PeerSocket {
  public:
    explicit PeerSocket(int socket) : socket_(socket) {}

    ~PeerSocket() { ::close(socket_); }

    PeerSocket(const PeerSocket&) = delete;
    PeerSocket& operator=(const PeerSocket&) = delete;

    void send_bytes(std::span<const std::byte> bytes) const {
        while (!bytes.empty()) {
            const auto sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
            if (sent <= 0) {
                return;
            }
            bytes = bytes.subspan(static_cast<std::size_t>(sent));
        }
    }

    void send(const AnyMessage& message, std::span<const std::byte> payload = {}) const {
        Bytes bytes = encode_message(message);
        bytes.insert(bytes.end(), payload.begin(), payload.end());
        send_bytes(bytes);
    }

    /// The client's next message, held to a server's limits; nothing when the client has gone.
    std::optional<AnyMessage> receive() {
        for (;;) {
            const auto frame = reader_.next();
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
                return std::move(*message);
            }
            std::array<std::byte, 4096> bytes{};
            const auto received = ::recv(socket_, bytes.data(), bytes.size(), 0);
            if (received <= 0) {
                return std::nullopt;
            }
            reader_.feed(std::span(bytes).first(static_cast<std::size_t>(received)));
        }
    }

    template <typename T>
    std::optional<T> receive_kind() {
        const auto message = receive();
        const T* found = message ? std::get_if<T>(&*message) : nullptr;
        return found != nullptr ? std::optional(*found) : std::nullopt;
    }

    /// The usual opening.
    void greet(const ServerHello& hello = test_hello()) {
        EXPECT_TRUE(receive_kind<ClientHello>());
        send(hello);
    }

    /// Until the client closes.
    void wait_for_end() {
        while (receive()) {
        }
    }

  private:
    int socket_;
    FrameReader reader_{kInboundFrameLimits};
};

/// Listens from construction on; plays `script` to the first client; its destructor waits for the
/// script.
class ScriptedPeer {
  public:
    explicit ScriptedPeer(std::function<void(PeerSocket&)> script)
        : listener_(::socket(AF_INET, SOCK_STREAM, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t size = sizeof(address);
        auto* generic = reinterpret_cast<sockaddr*>(&address);
        EXPECT_EQ(::bind(listener_, generic, size), 0);
        EXPECT_EQ(::listen(listener_, 1), 0);
        EXPECT_EQ(::getsockname(listener_, generic, &size), 0);
        port_ = ntohs(address.sin_port);
        thread_ = std::jthread([this, script = std::move(script)] {
            const int socket = ::accept(listener_, nullptr, nullptr);
            if (socket >= 0) {
                PeerSocket peer(socket);
                script(peer);
            }
        });
    }

    ~ScriptedPeer() {
        ::shutdown(listener_, SHUT_RDWR);  // ends an accept that nobody came to
        thread_.join();
        ::close(listener_);
    }

    ScriptedPeer(const ScriptedPeer&) = delete;
    ScriptedPeer& operator=(const ScriptedPeer&) = delete;

    std::uint16_t port() const { return port_; }

    std::string address() const { return "127.0.0.1:" + std::to_string(port_); }

  private:
    int listener_;
    std::uint16_t port_ = 0;
    std::jthread thread_;
};

}  // namespace terrane
