#include "client-sample/cpp/program/websocket_stream.h"

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace terrane {

namespace {

constexpr std::uint8_t kContinuation = 0;
constexpr std::uint8_t kText = 1;
constexpr std::uint8_t kBinary = 2;
constexpr std::uint8_t kClose = 8;
constexpr std::uint8_t kPing = 9;
constexpr std::uint8_t kPong = 10;
constexpr unsigned kFinal = 0x80;
constexpr unsigned kMasked = 0x80;

std::string base64(std::span<const unsigned char> bytes) {
    std::string text(4 * ((bytes.size() + 2) / 3) + 1, '\0');
    const int length = EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()), bytes.data(),
                                       static_cast<int>(bytes.size()));
    text.resize(static_cast<std::size_t>(length));
    return text;
}

/// Section 4.2.2: SHA-1 of the key and a fixed text.
std::string accept_of(const std::string& key) {
    const std::string text = key + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned length = 0;
    EVP_Digest(text.data(), text.size(), digest.data(), &length, EVP_sha1(), nullptr);
    return base64(std::span(digest).first(length));
}

std::string lower(std::string_view text) {
    std::string out(text);
    std::ranges::transform(out, out.begin(),
                           [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return out;
}

/// The value of a header in an HTTP head, trimmed; empty if there is none.
std::string_view header_of(std::string_view head, std::string_view name) {
    for (std::size_t at = head.find("\r\n"); at != head.npos; at = head.find("\r\n", at + 2)) {
        const std::string_view line = head.substr(at + 2, head.find("\r\n", at + 2) - at - 2);
        const std::size_t colon = line.find(':');
        if (colon != line.npos && lower(line.substr(0, colon)) == name) {
            std::string_view value = line.substr(colon + 1);
            value.remove_prefix(std::min(value.find_first_not_of(" \t"), value.size()));
            return value.substr(0, value.find_last_not_of(" \t") + 1);
        }
    }
    return {};
}

}  // namespace

WebSocketStream::WebSocketStream(const WebSocketTarget& target)
    : target_(target), random_(target.seed) {
    std::array<unsigned char, 16> key{};
    std::ranges::generate(key, [this] { return static_cast<unsigned char>(random_()); });
    key_ = base64(key);
}

Bytes WebSocketStream::opening() const {
    const std::string request = "GET " + target_.path + " HTTP/1.1\r\nHost: " + target_.host +
                                "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                                "Sec-WebSocket-Key: " +
                                key_ + "\r\nSec-WebSocket-Version: 13\r\n\r\n";
    const auto bytes = bytes_of(request);
    return {bytes.begin(), bytes.end()};
}

Bytes WebSocketStream::wrap(std::span<const std::byte> message) {
    return frame(kBinary, message);
}

Bytes WebSocketStream::frame(std::uint8_t opcode, std::span<const std::byte> payload) {
    Bytes out;
    out.reserve(payload.size() + 14);
    out.push_back(static_cast<std::byte>(kFinal | opcode));
    const std::uint64_t size = payload.size();
    const unsigned length_bytes = size < 126 ? 0 : size < 65536 ? 2 : 8;
    const std::uint64_t code = length_bytes == 0 ? size : length_bytes == 2 ? 126 : 127;
    out.push_back(static_cast<std::byte>(kMasked | code));
    for (unsigned i = length_bytes; i-- > 0;) {
        out.push_back(static_cast<std::byte>(size >> (8 * i)));
    }
    std::array<std::byte, 4> mask{};
    std::ranges::generate(mask, [this] { return static_cast<std::byte>(random_()); });
    out.insert(out.end(), mask.begin(), mask.end());
    for (std::size_t i = 0; i < payload.size(); ++i) {
        out.push_back(payload[i] ^ mask[i % mask.size()]);
    }
    return out;
}

/// True once the answer to the upgrade is there and good; it is taken off the buffer.
Result<bool> WebSocketStream::take_upgrade() {
    const std::string_view text = text_of(buffer_);
    const std::size_t end = text.find("\r\n\r\n");
    if (end == text.npos) {
        if (buffer_.size() > kUpgradeAnswerBytesMax) {
            return fail(ErrorCode::too_large, "the answer to the WebSocket's opening has no end");
        }
        return false;
    }
    const std::string_view head = text.substr(0, end);
    const std::string_view status = head.substr(0, head.find("\r\n"));
    if (!status.starts_with("HTTP/1.1 101")) {
        return fail(ErrorCode::unsupported,
                    "no WebSocket there: the server answers " + std::string(status.substr(0, 80)));
    }
    if (header_of(head, "sec-websocket-accept") != accept_of(key_)) {
        return fail(ErrorCode::malformed, "the server's Sec-WebSocket-Accept is wrong");
    }
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(end + 4));
    is_upgraded_ = true;
    return true;
}

/// False if the head is not whole yet.
Result<bool> WebSocketStream::read_head(Head& head) const {
    if (buffer_.size() < 2) {
        return false;
    }
    const auto first = std::to_integer<unsigned>(buffer_[0]);
    const auto second = std::to_integer<unsigned>(buffer_[1]);
    if ((first & 0x70U) != 0 || (second & kMasked) != 0) {
        return fail(ErrorCode::malformed, "WebSocket: reserved bits or a mask in a server's frame");
    }
    head.opcode = static_cast<std::uint8_t>(first & 0x0FU);
    head.payload_bytes = second & 0x7FU;
    const std::size_t length_bytes = head.payload_bytes == 126   ? 2
                                     : head.payload_bytes == 127 ? 8
                                                                 : 0;
    head.head_bytes = 2 + length_bytes;
    if (buffer_.size() < head.head_bytes) {
        return false;
    }
    if (length_bytes > 0) {
        head.payload_bytes = 0;
        for (std::size_t i = 0; i < length_bytes; ++i) {
            head.payload_bytes =
                head.payload_bytes << 8U | std::to_integer<std::uint64_t>(buffer_[2 + i]);
        }
    }
    const bool is_control = (head.opcode & 8U) != 0;
    if (is_control && (head.payload_bytes > kControlBytesMax || (first & kFinal) == 0)) {
        return fail(ErrorCode::malformed, "WebSocket: a control frame in parts or of " +
                                              std::to_string(head.payload_bytes) + " bytes");
    }
    return true;
}

Result<void> WebSocketStream::take_control(std::uint8_t opcode,
                                           std::span<const std::byte> payload) {
    if (opcode == kPing) {
        const Bytes pong = frame(kPong, payload);
        reply_.insert(reply_.end(), pong.begin(), pong.end());
    } else if (opcode == kClose) {
        const std::string_view reason =
            payload.size() > 2 ? text_of(payload.subspan(2)) : "without a reason";
        return fail(ErrorCode::io_error, "the server closed the WebSocket: " + std::string(reason));
    } else if (opcode != kPong) {
        return fail(ErrorCode::malformed, "WebSocket: opcode " + std::to_string(opcode));
    }
    return {};
}

Result<void> WebSocketStream::feed(Bytes& out, std::span<const std::byte> bytes) {
    for (;;) {
        if (data_left_ > 0) {  // passed on as it comes, never gathered here
            const bool from_buffer = !buffer_.empty();
            const std::span<const std::byte> source =
                from_buffer ? std::span<const std::byte>(buffer_) : bytes;
            const auto part = source.first(
                static_cast<std::size_t>(std::min<std::uint64_t>(source.size(), data_left_)));
            out.insert(out.end(), part.begin(), part.end());
            data_left_ -= part.size();
            const std::size_t taken = part.size();
            if (from_buffer) {
                buffer_.erase(buffer_.begin(),
                              buffer_.begin() + static_cast<std::ptrdiff_t>(taken));
            } else {
                bytes = bytes.subspan(taken);
            }
            if (data_left_ > 0 && bytes.empty() && buffer_.empty()) {
                return {};
            }
            continue;
        }
        buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
        bytes = {};
        if (!is_upgraded_) {
            const auto taken = take_upgrade();
            if (!taken || !*taken) {
                return taken.map([](bool) {});
            }
            continue;
        }
        Head head;
        const auto is_whole = read_head(head);
        if (!is_whole || !*is_whole) {
            return is_whole.map([](bool) {});
        }
        const bool is_control = (head.opcode & 8U) != 0;
        if (is_control) {
            const auto size = static_cast<std::size_t>(head.payload_bytes);
            if (buffer_.size() < head.head_bytes + size) {
                return {};
            }
            const auto payload = std::span(buffer_).subspan(head.head_bytes, size);
            if (const auto taken = take_control(head.opcode, payload); !taken) {
                return taken;
            }
            buffer_.erase(buffer_.begin(),
                          buffer_.begin() + static_cast<std::ptrdiff_t>(head.head_bytes + size));
            continue;
        }
        if (head.opcode != kBinary && head.opcode != kContinuation) {
            return fail(ErrorCode::malformed, head.opcode == kText
                                                  ? "WebSocket: text in place of binary messages"
                                                  : "WebSocket: unknown opcode");
        }
        data_left_ = head.payload_bytes;
        buffer_.erase(buffer_.begin(),
                      buffer_.begin() + static_cast<std::ptrdiff_t>(head.head_bytes));
    }
}

Bytes WebSocketStream::take_reply() {
    return std::exchange(reply_, {});
}

}  // namespace terrane
