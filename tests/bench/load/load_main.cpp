// A load client for the native protocol, over TCP or WebSocket: some connections, each with some
// chunks always asked for and not answered, one thread. Counts what comes for some seconds.
//
//     terrane_load PORT tcp|ws CONNECTIONS PIPELINE SECONDS LOD,X,Y,Z draco|columns
//
// It reads frames by their lengths only, so that the server is what is measured. One answer is read
// in full first, to know that it is a whole chunk.
#include "protocol/wire/frame.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {
namespace {

using Clock = std::chrono::steady_clock;

[[noreturn]] void die(const std::string& what) {
    std::fprintf(stderr, "terrane_load: %s\n", what.c_str());
    std::exit(1);
}

struct Load {
    std::uint16_t port = 0;
    bool websocket = false;
    std::size_t connections = 1;
    std::size_t pipeline = 1;
    double seconds = 1;
    ChunkPos key;
    ChunkFormat format = ChunkFormat::draco;
};

class LoadConnection {
  public:
    explicit LoadConnection(const Load& load)
        : load_(load), socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(load.port);
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        if (::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
            die("cannot connect");
        }
        const int on = 1;
        ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
        if (load.websocket) {
            send_raw(
                "GET /ws HTTP/1.1\r\nHost: a\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n");
            std::string head;
            while (!head.ends_with("\r\n\r\n")) {
                char c = 0;
                if (::recv(socket_, &c, 1, 0) != 1) {
                    die("no answer to the handshake");
                }
                head += c;
            }
            if (!head.starts_with("HTTP/1.1 101 ")) {
                die("no WebSocket: " + head);
            }
        }
        send(ClientHello{.protocol_version = kProtocolVersion, .client_name = "load", .token = {}});
        wait_for_messages(1);
        send_request(1);
        wait_for_messages(1);  // the chunk is in the cache now
        bytes_ = 0;
        messages_ = 0;
        // Two halves: while one is on its way, the other is answered.
        send_request(load.pipeline / 2);
        send_request(load.pipeline - load.pipeline / 2);
        outstanding_ = load.pipeline;
    }

    ~LoadConnection() { ::close(socket_); }

    LoadConnection(const LoadConnection&) = delete;
    LoadConnection& operator=(const LoadConnection&) = delete;

    int socket() const { return socket_; }

    std::uint64_t bytes() const { return bytes_; }

    std::uint64_t messages() const { return messages_; }

    /// Reads what is there, and asks for as much as has come.
    void go_on() {
        const std::uint64_t before = messages_;
        read_some();
        outstanding_ -= std::min<std::uint64_t>(outstanding_, messages_ - before);
        if (outstanding_ <= load_.pipeline / 2) {
            send_request(load_.pipeline - outstanding_);
            outstanding_ = load_.pipeline;
        }
    }

  private:
    void send_raw(std::string_view text) {
        while (!text.empty()) {
            const ssize_t sent = ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
            if (sent <= 0) {
                die("the server closed");
            }
            text.remove_prefix(static_cast<std::size_t>(sent));
        }
    }

    void send(const AnyMessage& message) {
        const Bytes bytes = encode_message(message);
        if (!load_.websocket) {
            send_raw(text_of(bytes));
            return;
        }
        std::string frame(1, '\x82');  // masked with zeros
        frame += static_cast<char>(0xFE);
        frame += static_cast<char>(bytes.size() >> 8U);
        frame += static_cast<char>(bytes.size() & 0xFFU);
        if (bytes.size() < 126) {
            frame = std::string(1, '\x82') + static_cast<char>(0x80U | bytes.size());
        }
        frame += std::string(4, '\0');
        frame += text_of(bytes);
        send_raw(frame);
    }

    void send_request(std::size_t chunks) {
        ChunkRequest request;
        request.request_id = ++request_id_;
        request.format = load_.format;
        request.keys.assign(chunks, load_.key);
        send(request);
    }

    void wait_for_messages(std::uint64_t count) {
        const std::uint64_t until = messages_ + count;
        while (messages_ < until) {
            read_some();
        }
    }

    void read_some() {
        const ssize_t received = ::recv(socket_, buffer_.data(), buffer_.size(), 0);
        if (received <= 0) {
            die("the server closed");
        }
        bytes_ += static_cast<std::uint64_t>(received);
        count_messages(std::span(buffer_).first(static_cast<std::size_t>(received)));
    }

    /// Heads are gathered byte by byte, bodies skipped.
    void count_messages(std::span<const unsigned char> bytes) {
        while (!bytes.empty()) {
            if (left_ > 0) {
                const auto skipped = std::min<std::uint64_t>(left_, bytes.size());
                left_ -= skipped;
                bytes = bytes.subspan(static_cast<std::size_t>(skipped));
                messages_ += left_ == 0 ? 1U : 0U;
                continue;
            }
            head_[head_size_++] = bytes.front();
            bytes = bytes.subspan(1);
            if (head_size_ == head_bytes()) {
                left_ = body_bytes();
                head_size_ = 0;
            }
        }
    }

    std::size_t head_bytes() const {
        if (!load_.websocket) {
            return 4;
        }
        return head_size_ < 2 || head_[1] < 126 ? 2 : head_[1] == 126 ? 4 : 10;
    }

    std::uint64_t body_bytes() const {
        if (!load_.websocket) {
            std::uint32_t length = 0;
            std::memcpy(&length, head_.data(), sizeof(length));
            return length;
        }
        if (head_[1] < 126) {
            return head_[1];
        }
        std::uint64_t length = 0;
        for (std::size_t i = 2; i < head_size_; ++i) {
            length = (length << 8U) | head_[i];
        }
        return length;
    }

    const Load& load_;
    int socket_;
    std::uint32_t request_id_ = 0;
    std::uint64_t outstanding_ = 0;
    std::uint64_t bytes_ = 0;
    std::uint64_t messages_ = 0;
    std::array<unsigned char, 16> head_{};
    std::size_t head_size_ = 0;
    std::uint64_t left_ = 0;
    std::vector<unsigned char> buffer_ = std::vector<unsigned char>(std::size_t{256} << 10U);
};

int run(const Load& load) {
    std::vector<std::unique_ptr<LoadConnection>> connections;
    std::vector<pollfd> polled;
    for (std::size_t i = 0; i < load.connections; ++i) {
        connections.push_back(std::make_unique<LoadConnection>(load));
        polled.push_back({.fd = connections.back()->socket(), .events = POLLIN, .revents = 0});
    }
    const auto start = Clock::now();
    const auto end = start + std::chrono::duration_cast<Clock::duration>(
                                 std::chrono::duration<double>(load.seconds));
    while (Clock::now() < end) {
        if (::poll(polled.data(), polled.size(), 5'000) <= 0) {
            die("the server is silent");
        }
        for (std::size_t i = 0; i < polled.size(); ++i) {
            if (polled[i].revents != 0) {
                connections[i]->go_on();
            }
        }
    }
    const std::chrono::duration<double> took = Clock::now() - start;
    std::uint64_t messages = 0;
    std::uint64_t bytes = 0;
    for (const auto& connection : connections) {
        messages += connection->messages();
        bytes += connection->bytes();
    }
    std::printf("%.0f chunks/s, %.1f MB/s\n", static_cast<double>(messages) / took.count(),
                static_cast<double>(bytes) / took.count() / 1e6);
    return 0;
}

}  // namespace
}  // namespace terrane

int main(int argc, char** argv) {
    using namespace terrane;
    if (argc != 8) {
        std::fprintf(stderr,
                     "usage: terrane_load PORT tcp|ws CONNECTIONS PIPELINE SECONDS LOD,X,Y,Z "
                     "draco|columns\n");
        return 2;
    }
    Load load;
    load.port = static_cast<std::uint16_t>(std::strtoul(argv[1], nullptr, 10));
    load.websocket = std::string_view(argv[2]) == "ws";
    load.connections = std::strtoul(argv[3], nullptr, 10);
    load.pipeline = std::strtoul(argv[4], nullptr, 10);
    load.seconds = std::strtod(argv[5], nullptr);
    load.format =
        std::string_view(argv[7]) == "columns" ? ChunkFormat::columns : ChunkFormat::draco;
    if (std::sscanf(argv[6], "%d,%d,%d,%d", &load.key.lod, &load.key.x, &load.key.y, &load.key.z) !=
            4 ||
        load.connections == 0 || load.pipeline < 2 || load.pipeline > 64) {
        die("wrong numbers");
    }
    return run(load);
}
