// What waits to be written to one client: heads that are its own and payloads that it shares with
// the cache and with everybody else. Nothing is copied on the way out; a write gathers.
//
// The owner looks at `full()` before it makes more: at kOutboxBytesMax a session takes no new
// answers and reads no more requests until the client has read some. One answer may go beyond.
// Chunks of a view can be withdrawn as long as no write has them in hand.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"

#include <array>
#include <cstddef>
#include <deque>
#include <functional>
#include <optional>
#include <span>

namespace terrane {

/// The credit window of the protocol: what a slow reader may make the server hold for it.
inline constexpr std::size_t kOutboxBytesMax = std::size_t{256} << 10U;
/// Parts of one gather write; Linux takes 1,024, and 64 KiB of ordinary answers are about 16.
inline constexpr std::size_t kGatherPartsMax = 32;

/// One thread: the session's.
class Outbox {
  public:
    using Gather = std::array<std::span<const std::byte>, kGatherPartsMax>;

    /// `payload` may be null. `of_view`: the chunk that it is, if it may be withdrawn.
    void push(Bytes head, SharedBytes payload, std::optional<ChunkPos> of_view = std::nullopt);
    /// Fills `out` with the first parts in order and gives how many. They stay valid until
    /// `consume`.
    std::size_t gather(Gather& out) const;
    /// The first `size_bytes` have been written.
    void consume(std::size_t size_bytes);

    struct Withdrawn {
        std::size_t bytes = 0;
        std::size_t payload_bytes = 0;
    };

    /// Takes out the chunks of the view that nobody wants any more, but for those that the last
    /// `gather` has given out.
    Withdrawn withdraw(const std::function<bool(ChunkPos)>& is_unwanted);

    bool empty() const { return parts_.empty(); }

    /// Queued and not written yet.
    std::size_t bytes() const { return bytes_; }

    bool full() const { return bytes_ >= kOutboxBytesMax; }

  private:
    struct Part {
        Bytes head;  ///< empty if the part is a payload
        SharedBytes payload;
        std::optional<ChunkPos> of_view;  ///< of a head

        std::span<const std::byte> bytes() const {
            return payload ? std::span<const std::byte>(*payload)
                           : std::span<const std::byte>(head);
        }
    };

    std::deque<Part> parts_;
    std::size_t bytes_ = 0;
    std::size_t written_of_first_ = 0;
    mutable std::size_t gathered_ = 0;  ///< parts that a writer holds
};

}  // namespace terrane
