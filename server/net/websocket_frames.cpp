#include "server/net/websocket_frames.h"

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <openssl/evp.h>
#include <openssl/sha.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

namespace {

/// Section 1.3: what is hashed with the key.
constexpr std::string_view kGuid = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
constexpr std::size_t kKeyTextBytes = 24;

constexpr unsigned kFinBit = 0x80;
constexpr unsigned kReservedBits = 0x70;
constexpr unsigned kOpcodeBits = 0x0F;
constexpr unsigned kMaskBit = 0x80;
constexpr unsigned kLengthBits = 0x7F;
constexpr unsigned kLengthU16 = 126;
constexpr unsigned kLengthU64 = 127;

/// Bytes of a client's frame head, once its first two are known.
std::size_t head_bytes(unsigned second) {
    const unsigned length = second & kLengthBits;
    const std::size_t extended = length == kLengthU64 ? 8 : length == kLengthU16 ? 2 : 0;
    return 2 + extended + ((second & kMaskBit) != 0 ? 4 : 0);
}

std::uint64_t big_endian(std::span<const std::byte> bytes) {
    std::uint64_t value = 0;
    for (const std::byte byte : bytes) {
        value = (value << 8U) | std::to_integer<std::uint64_t>(byte);
    }
    return value;
}

tl::unexpected<Error> malformed(std::string_view what) {
    return fail(ErrorCode::malformed, "WebSocket: " + std::string(what));
}

}  // namespace

std::string websocket_accept(std::string_view key) {
    std::string text(key);
    text += kGuid;
    std::array<unsigned char, SHA_DIGEST_LENGTH> digest{};
    SHA1(reinterpret_cast<const unsigned char*>(text.data()), text.size(), digest.data());
    std::array<unsigned char, 32> base64{};
    const int size = EVP_EncodeBlock(base64.data(), digest.data(), SHA_DIGEST_LENGTH);
    return {reinterpret_cast<const char*>(base64.data()), static_cast<std::size_t>(size)};
}

bool is_websocket_key(std::string_view key) {
    const auto is_base64 = [](char c) {
        return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') ||
               c == '+' || c == '/';
    };
    return key.size() == kKeyTextBytes && key.ends_with("==") &&
           std::all_of(key.begin(), key.end() - 2, is_base64);
}

std::size_t write_frame_head(std::array<std::byte, kServerFrameHeadMax>& out,
                             WebSocketOpcode opcode, std::uint64_t size_bytes) {
    out[0] = static_cast<std::byte>(kFinBit | static_cast<unsigned>(opcode));
    std::size_t extended = 0;
    if (size_bytes < kLengthU16) {
        out[1] = static_cast<std::byte>(size_bytes);
    } else if (size_bytes <= 0xFFFF) {
        out[1] = static_cast<std::byte>(kLengthU16);
        extended = 2;
    } else {
        out[1] = static_cast<std::byte>(kLengthU64);
        extended = 8;
    }
    for (std::size_t i = 0; i < extended; ++i) {
        out[2 + i] = static_cast<std::byte>(size_bytes >> (8 * (extended - 1 - i)));
    }
    return 2 + extended;
}

Result<void> WebSocketReader::begin_frame() {
    const auto first = std::to_integer<unsigned>(head_[0]);
    const auto second = std::to_integer<unsigned>(head_[1]);
    const bool is_final = (first & kFinBit) != 0;
    const unsigned opcode = first & kOpcodeBits;
    const unsigned length = second & kLengthBits;
    if ((first & kReservedBits) != 0) {
        return malformed("a reserved bit is set");
    }
    if ((second & kMaskBit) == 0) {
        return malformed("a client's frame is not masked");
    }
    const std::size_t extended = length == kLengthU64 ? 8 : length == kLengthU16 ? 2 : 0;
    payload_left_ = extended == 0 ? length : big_endian(std::span(head_).subspan(2, extended));
    if ((extended == 2 && payload_left_ < kLengthU16) ||
        (extended == 8 && (payload_left_ <= 0xFFFF || payload_left_ >> 63U != 0))) {
        return malformed("a length is not in its shortest form");
    }
    std::copy_n(head_.begin() + static_cast<std::ptrdiff_t>(2 + extended), 4, mask_.begin());
    mask_at_ = 0;
    switch (opcode) {
        case 0:
        case 1:
        case 2:
            if (inside_message_ != (opcode == 0)) {
                return malformed(opcode == 0 ? "a message goes on that never began"
                                             : "a message begins inside another");
            }
            if (opcode == 1) {
                return fail(ErrorCode::unsupported, "WebSocket: messages here are binary");
            }
            opcode_ = WebSocketOpcode::binary;
            inside_message_ = !is_final;
            break;
        case 8:
        case 9:
        case 10:
            if (!is_final || payload_left_ > kControlPayloadMax) {
                return malformed("a control frame is cut up or too long");
            }
            opcode_ = static_cast<WebSocketOpcode>(opcode);
            control_.opcode = opcode_;
            control_.size_bytes = 0;
            break;
        default:
            return malformed("opcode " + std::to_string(opcode));
    }
    inside_frame_ = true;
    return {};
}

Result<void> WebSocketReader::feed(Bytes& data, std::vector<WebSocketControl>& control,
                                   std::span<const std::byte> bytes) {
    while (!bytes.empty() || (inside_frame_ && payload_left_ == 0)) {
        if (!inside_frame_) {
            head_[head_size_++] = bytes.front();
            bytes = bytes.subspan(1);
            if (head_size_ >= 2 && head_size_ == head_bytes(std::to_integer<unsigned>(head_[1]))) {
                head_size_ = 0;
                if (const auto begun = begin_frame(); !begun) {
                    return begun;
                }
            }
            continue;
        }
        const std::size_t size =
            static_cast<std::size_t>(std::min<std::uint64_t>(payload_left_, bytes.size()));
        std::byte* out = control_.payload.data() + control_.size_bytes;
        if (opcode_ == WebSocketOpcode::binary) {
            data.resize(data.size() + size);
            out = data.data() + (data.size() - size);
        } else {
            control_.size_bytes += size;
        }
        for (std::size_t i = 0; i < size; ++i) {
            out[i] = bytes[i] ^ mask_[(mask_at_ + i) % 4];
        }
        mask_at_ = (mask_at_ + size) % 4;
        payload_left_ -= size;
        bytes = bytes.subspan(size);
        if (payload_left_ > 0) {
            continue;
        }
        inside_frame_ = false;
        if (opcode_ != WebSocketOpcode::binary) {
            if (control.size() >= kControlsMax) {
                return malformed("too many control frames at a time");
            }
            control.push_back(control_);
        }
    }
    return {};
}

}  // namespace terrane
