// A client for tests that speaks HTTP in whatever bytes it is told to, over a real socket.
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace terrane {

struct HttpReply {
    unsigned status = 0;
    std::map<std::string, std::string, std::less<>> headers;  ///< names in lower case
    std::string body;

    std::string header(std::string_view name) const {
        const auto found = headers.find(name);
        return found == headers.end() ? std::string() : found->second;
    }
};

class HttpClient {
  public:
    explicit HttpClient(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(port);
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        connected_ =
            ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    }

    ~HttpClient() { ::close(socket_); }

    HttpClient(const HttpClient&) = delete;
    HttpClient& operator=(const HttpClient&) = delete;

    bool connected() const { return connected_; }

    bool send(std::string_view text) {
        while (!text.empty()) {
            const ssize_t sent = ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
            if (sent <= 0) {
                return false;
            }
            text.remove_prefix(static_cast<std::size_t>(sent));
        }
        return true;
    }

    void end_sending() { ::shutdown(socket_, SHUT_WR); }

    /// `headers` are whole lines with their line ends.
    std::optional<HttpReply> request(std::string_view method, std::string_view target,
                                     std::string_view headers = {}) {
        send(std::string(method) + " " + std::string(target) + " HTTP/1.1\r\nHost: test\r\n" +
             std::string(headers) + "\r\n");
        return reply(method != "HEAD");
    }

    std::optional<HttpReply> get(std::string_view target, std::string_view headers = {}) {
        return request("GET", target, headers);
    }

    /// The next answer; nothing when the server has closed, or is silent for ten seconds.
    std::optional<HttpReply> reply(bool has_body = true) {
        std::size_t end = std::string::npos;
        while ((end = buffer_.find("\r\n\r\n")) == std::string::npos) {
            if (!read_more()) {
                return std::nullopt;
            }
        }
        HttpReply out;
        std::string_view head = std::string_view(buffer_).substr(0, end + 2);
        if (!head.starts_with("HTTP/1.1 ")) {
            ADD_FAILURE() << "no answer: " << head;
            return std::nullopt;
        }
        std::from_chars(head.data() + 9, head.data() + 12, out.status);
        head.remove_prefix(head.find("\r\n") + 2);
        while (!head.empty()) {
            const std::string_view line = head.substr(0, head.find("\r\n"));
            head.remove_prefix(line.size() + 2);
            const std::size_t colon = line.find(": ");
            std::string name(line.substr(0, colon));
            std::ranges::transform(name, name.begin(), [](unsigned char c) {
                return static_cast<char>(std::tolower(c));
            });
            EXPECT_FALSE(out.headers.contains(name)) << name << " twice";
            out.headers[name] = std::string(line.substr(colon + 2));
        }
        buffer_.erase(0, end + 4);
        std::size_t size = 0;
        const std::string length = out.header("content-length");
        std::from_chars(length.data(), length.data() + length.size(), size);
        while (has_body && buffer_.size() < size) {
            if (!read_more()) {
                ADD_FAILURE() << "the body is cut short";
                return std::nullopt;
            }
        }
        if (has_body) {
            out.body = buffer_.substr(0, size);
            buffer_.erase(0, size);
        }
        return out;
    }

    /// Raw bytes, at least `size`; fewer if the server closes or is silent.
    std::string take(std::size_t size) {
        while (buffer_.size() < size && read_more()) {
        }
        std::string out = buffer_.substr(0, size);
        buffer_.erase(0, size);
        return out;
    }

    /// True once the server has closed and nothing unread is left.
    bool is_closed() { return buffer_.empty() && !read_more() && !timed_out_; }

  private:
    bool read_more() {
        pollfd ready{.fd = socket_, .events = POLLIN, .revents = 0};
        if (::poll(&ready, 1, 10'000) <= 0) {
            timed_out_ = true;
            return false;
        }
        std::array<char, 65536> bytes;
        const ssize_t received = ::recv(socket_, bytes.data(), bytes.size(), 0);
        if (received <= 0) {
            return false;
        }
        buffer_.append(bytes.data(), static_cast<std::size_t>(received));
        return true;
    }

    int socket_;
    bool connected_ = false;
    bool timed_out_ = false;
    std::string buffer_;
};

}  // namespace terrane
