#include "server/net/outbox.h"

#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/coords.h"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <optional>
#include <utility>

namespace terrane {

void Outbox::push(Bytes head, SharedBytes payload, std::optional<ChunkPos> of_view) {
    TERRANE_ASSERT(!head.empty());
    bytes_ += head.size();
    parts_.push_back({.head = std::move(head), .payload = nullptr, .of_view = of_view});
    if (payload && !payload->empty()) {
        bytes_ += payload->size();
        parts_.push_back({.head = {}, .payload = std::move(payload), .of_view = std::nullopt});
    }
}

Outbox::Withdrawn Outbox::withdraw(const std::function<bool(ChunkPos)>& is_unwanted) {
    // Where a write may be: in what was gathered, or in what is written in part.
    const std::size_t held =
        std::min(std::max(gathered_, std::size_t{written_of_first_ > 0 ? 1U : 0U}), parts_.size());
    Withdrawn sum;
    bool is_out = false;  // the answer that the part belongs to
    const auto gone = std::remove_if(parts_.begin() + static_cast<std::ptrdiff_t>(held),
                                     parts_.end(), [&](const Part& part) {
                                         const bool is_head = !part.payload;
                                         if (is_head) {
                                             is_out = part.of_view && is_unwanted(*part.of_view);
                                         }
                                         if (is_out) {
                                             sum.bytes += part.bytes().size();
                                             sum.payload_bytes += is_head ? 0 : part.bytes().size();
                                         }
                                         return is_out;
                                     });
    parts_.erase(gone, parts_.end());
    bytes_ -= sum.bytes;
    return sum;
}

std::size_t Outbox::gather(Gather& out) const {
    std::size_t count = 0;
    for (const Part& part : parts_) {
        if (count == out.size()) {
            break;
        }
        out[count] = part.bytes().subspan(count == 0 ? written_of_first_ : 0);
        ++count;
    }
    gathered_ = count;
    return count;
}

void Outbox::consume(std::size_t size_bytes) {
    TERRANE_ASSERT(size_bytes <= bytes_);
    bytes_ -= size_bytes;
    gathered_ = 0;
    written_of_first_ += size_bytes;
    while (!parts_.empty() && written_of_first_ >= parts_.front().bytes().size()) {
        written_of_first_ -= parts_.front().bytes().size();
        parts_.pop_front();
    }
}

}  // namespace terrane
