// Frames: how messages follow one another on a byte stream. WIRE_FORMAT.md has the bytes.
//
//     u32 length of what follows | u32 head length | head: a FlatBuffer "TRNE" | payload
//
// All little endian. The reader takes bytes as the socket gives them, in pieces of any size, and
// gives back whole frames whose head has passed the FlatBuffers Verifier. A length above the limit
// is refused as soon as its four bytes are there, before anything is allocated for it.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "protocol/wire/limits.h"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace terrane {

namespace wire {
struct Message;
}

/// What one side accepts from the other.
struct FrameLimits {
    std::size_t frame_bytes_max = 0;  ///< all that follows the first length
    std::size_t head_bytes_max = 0;   ///< of it: the head without its own length
    std::uint32_t tables_max = 0;     ///< FlatBuffers tables in one head
};

/// What a server accepts from a client.
inline constexpr FrameLimits kInboundFrameLimits{.frame_bytes_max = kInboundFrameBytesMax,
                                                 .head_bytes_max = kInboundFrameBytesMax - 4,
                                                 .tables_max = kInboundTablesMax};
/// What a client accepts from a server.
inline constexpr FrameLimits kOutboundFrameLimits{
    .frame_bytes_max = 4 + kOutboundHeadBytesMax + kPayloadBytesMax,
    .head_bytes_max = kOutboundHeadBytesMax,
    .tables_max = kOutboundTablesMax};

/// A verified head and the payload behind it. Both live in the FrameReader that gave them, until
/// its next call.
struct Frame {
    const wire::Message* head = nullptr;  ///< never null in a frame from a reader
    std::span<const std::byte> payload;
};

/// Decodes a stream of frames. One thread. It holds at most one frame and what the last `feed`
/// brought beyond it. After an error the stream is lost: every later call gives the same error.
class FrameReader {
  public:
    explicit FrameReader(FrameLimits limits) : limits_(limits) {}

    /// Takes the next bytes of the stream. Call `next` until it gives nothing before feeding again.
    void feed(std::span<const std::byte> bytes);

    /// The next whole frame, or nothing if more bytes are needed. Fails with `too_large` for a
    /// length above the limits and `malformed` for everything else.
    Result<std::optional<Frame>> next();

    /// Bytes fed and not given out yet: not 0 at the end of a stream means it was cut short.
    std::size_t buffered_bytes() const { return buffer_.size() - begin_; }

  private:
    Result<std::optional<Frame>> read_frame();
    Result<Frame> read_body(std::span<const std::byte> body);

    FrameLimits limits_;
    Bytes buffer_;
    std::size_t begin_ = 0;  ///< first byte of buffer_ that is not given out yet
    std::vector<std::uint64_t>
        head_;  ///< the current head, copied: a FlatBuffer needs 8-byte alignment
    std::optional<Error> error_;
};

/// Frames a finished size-prefixed FlatBuffer: gives `u32 length | head`, with the length counting
/// `payload_bytes` that the caller sends right behind it.
Bytes frame_head(std::span<const std::byte> prefixed_head, std::size_t payload_bytes);

}  // namespace terrane
