#include "protocol/wire/frame.h"

#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/result.h"
#include "protocol/wire/limits.h"

#include <terrane_generated.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>

namespace terrane {

namespace {

constexpr std::size_t kLengthBytes = 4;
/// Root offset and identifier: the Verifier reads both before it checks anything.
constexpr std::size_t kHeadBytesMin = 8;

std::size_t length_at(std::span<const std::byte> bytes) {
    std::uint32_t length = 0;
    std::memcpy(&length, bytes.data(), kLengthBytes);
    return length;
}

}  // namespace

void FrameReader::feed(std::span<const std::byte> bytes) {
    if (error_) {
        return;
    }
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(begin_));
    begin_ = 0;
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
}

Result<std::optional<Frame>> FrameReader::next() {
    if (error_) {
        return tl::unexpected(*error_);
    }
    auto frame = read_frame();
    if (!frame) {
        error_ = frame.error();
        buffer_ = {};
        begin_ = 0;
    }
    return frame;
}

Result<std::optional<Frame>> FrameReader::read_frame() {
    const auto rest = std::span<const std::byte>(buffer_).subspan(begin_);
    if (rest.size() < kLengthBytes) {
        return std::nullopt;
    }
    const std::size_t length = length_at(rest);
    constexpr std::size_t kHttp = 0x50545448;  // "HTTP" as a length
    if (length == kHttp) {
        return fail(ErrorCode::malformed,
                    "frame: the peer speaks HTTP: the native protocol has a port of its own");
    }
    if (length > limits_.frame_bytes_max) {
        return fail(ErrorCode::too_large, "frame: " + std::to_string(length) + " bytes, at most " +
                                              std::to_string(limits_.frame_bytes_max) +
                                              " are accepted");
    }
    if (length < kLengthBytes + kHeadBytesMin) {
        return fail(ErrorCode::malformed,
                    "frame: " + std::to_string(length) + " bytes can't hold a head");
    }
    if (rest.size() < kLengthBytes + length) {
        return std::nullopt;
    }
    begin_ += kLengthBytes + length;
    return read_body(rest.subspan(kLengthBytes, length)).map([](Frame frame) {
        return std::optional(frame);
    });
}

Result<Frame> FrameReader::read_body(std::span<const std::byte> body) {
    const std::size_t head_bytes = length_at(body);
    if (head_bytes > limits_.head_bytes_max) {
        return fail(ErrorCode::too_large,
                    "head: " + std::to_string(head_bytes) + " bytes, at most " +
                        std::to_string(limits_.head_bytes_max) + " are accepted");
    }
    if (head_bytes < kHeadBytesMin || head_bytes > body.size() - kLengthBytes) {
        return fail(ErrorCode::malformed, "head: " + std::to_string(head_bytes) +
                                              " bytes in a frame of " +
                                              std::to_string(body.size()));
    }
    // The prefix stays in front: the builder aligned the buffer with it, and the Verifier checks
    // so.
    const std::size_t prefixed_bytes = kLengthBytes + head_bytes;
    head_.resize((prefixed_bytes + sizeof(std::uint64_t) - 1) / sizeof(std::uint64_t));
    std::memcpy(head_.data(), body.data(), prefixed_bytes);
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(head_.data());
    if (!wire::SizePrefixedMessageBufferHasIdentifier(bytes)) {
        return fail(ErrorCode::malformed, "head: the file identifier is not TRNE");
    }
    flatbuffers::Verifier verifier(bytes, prefixed_bytes, kTableDepthMax, limits_.tables_max);
    if (!wire::VerifySizePrefixedMessageBuffer(verifier)) {
        return fail(ErrorCode::malformed, "head: not a valid FlatBuffer of terrane.fbs");
    }
    return Frame{.head = wire::GetSizePrefixedMessage(bytes),
                 .payload = body.subspan(prefixed_bytes)};
}

Bytes frame_head(std::span<const std::byte> prefixed_head, std::size_t payload_bytes) {
    TERRANE_ASSERT(payload_bytes <= kPayloadBytesMax);
    TERRANE_ASSERT(prefixed_head.size() <= kLengthBytes + kOutboundHeadBytesMax);
    Bytes frame;
    frame.reserve(kLengthBytes + prefixed_head.size());
    ByteWriter writer(frame);
    writer.fixed(static_cast<std::uint32_t>(prefixed_head.size() + payload_bytes));
    writer.raw(prefixed_head);
    return frame;
}

}  // namespace terrane
