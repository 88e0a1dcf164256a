#include "server/net/outbox.h"

#include "protocol/base/check.h"

#include <utility>

namespace terrane {

void Outbox::push(Bytes head, SharedBytes payload) {
    TERRANE_ASSERT(!head.empty());
    bytes_ += head.size();
    parts_.push_back({.head = std::move(head), .payload = nullptr});
    if (payload && !payload->empty()) {
        bytes_ += payload->size();
        parts_.push_back({.head = {}, .payload = std::move(payload)});
    }
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
    return count;
}

void Outbox::consume(std::size_t size_bytes) {
    TERRANE_ASSERT(size_bytes <= bytes_);
    bytes_ -= size_bytes;
    written_of_first_ += size_bytes;
    while (!parts_.empty() && written_of_first_ >= parts_.front().bytes().size()) {
        written_of_first_ -= parts_.front().bytes().size();
        parts_.pop_front();
    }
}

}  // namespace terrane
