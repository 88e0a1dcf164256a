// The view's part of a session: what is wanted, what is forgotten, and the credit for it.
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"
#include "server/chunks/answer.h"
#include "server/net/outbox.h"
#include "server/net/session.h"
#include "server/net/view.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace terrane {

namespace {

/// More than the head of a Chunk without composition takes.
constexpr std::size_t kChunkHeadBytes = 256;
constexpr std::size_t kForgottenAtOnce = 1024;
constexpr std::size_t kForgetHeadBytes = 128;

bool is_same_kind(const ViewUpdate& a, const ViewUpdate& b) {
    return a.format == b.format && a.without_flow == b.without_flow;
}

}  // namespace

void Session::handle_one(const ViewUpdate& update) {
    // It has as many answers as there are chunks; the next view is the end of them.
    const std::uint64_t number = log_.begin("view", 0, std::numeric_limits<std::size_t>::max());
    if (!takes_request(0, number)) {
        return;
    }
    if (caps_.view_radius_max == 0) {
        fail_request(0,
                     {.code = ErrorCode::unsupported,
                      .message = "this server gives no views; ask for chunks by their keys"},
                     number);
        log_.end(number);
        return;
    }
    if (update.format == ChunkFormat::draco_blocky && update.radius_chunks.size() > 1) {
        fail_request(0,
                     {.code = ErrorCode::unsupported,
                      .message = "a view of several levels as blocky: only level 0 has blocks; "
                                 "give one radius, or ask for draco"},
                     number);
        log_.end(number);
        return;
    }
    const ServerHello& world = context_.hello;
    View& view = view_ ? *view_
                       : view_.emplace(ViewWorld{.side = world.chunk_side,
                                                 .chunk_height = world.chunk_height,
                                                 .height_bound_voxels = world.height_bound_voxels,
                                                 .levels = world.levels},
                                       ViewBounds{.radius_max = caps_.view_radius_max,
                                                  .squares_max = caps_.view_squares_max});
    log_.end(std::exchange(view_number_, number));
    view.update(update);
    const bool all_again = !is_same_kind(update, last_update_);
    last_update_ = update;
    last_update_.radius_chunks = {};
    set_rate();
    drop_unwanted(view, all_again);
    submit();
}

void Session::handle_one(const Credit& credit) {
    uncredited_bytes_ -= std::min<std::uint64_t>(uncredited_bytes_, credit.bytes);
    submit();
}

/// The smaller of the client's wish and the server's cap.
void Session::set_rate() {
    std::uint64_t rate = caps_.bytes_per_second_max;
    if (const std::uint64_t wanted = last_update_.bytes_per_second_max; wanted > 0) {
        rate = rate == 0 ? wanted : std::min(rate, wanted);
    }
    // At least a head's worth, or the slowest rates would never let anything go.
    byte_rate_.set(static_cast<double>(rate), std::max(static_cast<double>(rate) / 4, 256.0));
}

/// What is under way or waits to be written and has left the view is dropped; what stays gets the
/// urgency that it has now.
void Session::drop_unwanted(View& view, bool all) {
    for (auto at = under_way_.begin(); at != under_way_.end();) {
        Wish& wish = at->second;
        if (!wish.is_of_view()) {
            ++at;
            continue;
        }
        const ChunkPos key = std::get<ChunkKey>(wish.key).position;
        if (all || !view.contains(key)) {
            context_.service->cancel(wish.key, at->first);
            at = under_way_.erase(at);
            --view_under_way_;
            continue;
        }
        const std::int32_t priority = view.priority_of(stack_of(key));
        if (priority != wish.priority) {
            wish.priority = priority;
            context_.service->change_priority(wish.key, at->first, priority);
        }
        ++at;
    }
    const auto withdrawn =
        outbox_.withdraw([&](ChunkPos key) { return all || !view.contains(key); });
    uncredited_bytes_ -= std::min(uncredited_bytes_, withdrawn.payload_bytes);
    byte_rate_.take(-static_cast<double>(withdrawn.bytes));
}

/// Nothing is wanted any more, and nothing told: what is in the outbox still goes out.
void Session::end_view() {
    std::erase_if(under_way_, [this](const auto& entry) {
        const auto& [waiter, wish] = entry;
        if (wish.is_of_view()) {
            context_.service->cancel(wish.key, waiter);
        }
        return wish.is_of_view();
    });
    view_under_way_ = 0;
    view_.reset();
    log_.end(std::exchange(view_number_, 0));
}

/// Before anything else of the view is sent: who wants a chunk again must have been told that it
/// was forgotten.
void Session::tell_forgotten() {
    while (view_ && view_->has_forgotten()) {
        const std::size_t most_bytes = kForgottenAtOnce * sizeof(ChunkPos) + kForgetHeadBytes;
        if (!outbox_.empty() && outbox_.bytes() + most_bytes > kOutboxBytesMax) {
            return;
        }
        send(ChunkForget{.keys = view_->take_forgotten(kForgottenAtOnce)});
    }
}

/// Credit for the answers that are expected.
bool Session::view_has_credit() const {
    const std::size_t expected_bytes = (view_under_way_ + 1) * expected_bytes_;
    return uncredited_bytes_ + expected_bytes <= caps_.credit_window_bytes ||
           (uncredited_bytes_ == 0 && view_under_way_ == 0);
}

/// The view if it may ask for a chunk now, else null. has_room has looked at everything but the
/// view's own state and credit.
View* Session::view_to_ask() {
    if (stage_ != Stage::open || !view_ || !view_->has_wish() || view_->has_forgotten() ||
        view_waits_ || (view_retry_at_ && now_ < *view_retry_at_)) {
        return nullptr;
    }
    return view_has_credit() ? &*view_ : nullptr;
}

/// The view if it is what may ask next, else null.
View* Session::view_if_next() {
    View* const view = view_to_ask();
    const bool is_first =
        view != nullptr &&
        (waiting_.empty() || view->next_priority() > waiting_.begin()->second.priority);
    return is_first ? view : nullptr;
}

/// True if it was answered at once.
bool Session::submit_of_view(View& view) {
    view_retry_at_.reset();
    const std::int32_t priority = view.next_priority();
    const Wish wish{.request_id = 0,
                    .key = ChunkKey{.position = view.take(),
                                    .format = last_update_.format,
                                    .without_flow = last_update_.without_flow},
                    .known_etag = {},
                    .priority = priority,
                    .rank = {}};
    const auto outcome = ask(wish);
    if (!outcome) {
        answer_of_view(view, wish, tl::unexpected(outcome.error()));
        return true;
    }
    const std::optional<Answer>& at_hand = *outcome;
    if (at_hand) {
        answer_of_view(view, wish, *at_hand);
    }
    return at_hand.has_value();
}

bool Session::has_room_for(const ServedChunk& served) const {
    const std::size_t payload_bytes = served.chunk->payload_bytes();
    const bool has_credit = uncredited_bytes_ == 0 || payload_bytes == 0 ||
                            uncredited_bytes_ + payload_bytes <= caps_.credit_window_bytes;
    const bool fits =
        outbox_.empty() || outbox_.bytes() + payload_bytes + kChunkHeadBytes <= kOutboxBytesMax;
    return has_credit && fits && byte_rate_.has();
}

/// Sends it, or gives it back to the view: by then it is in the cache.
void Session::answer_of_view(View& view, const Wish& wish, const Result<Answer>& result) {
    const ChunkPos key = std::get<ChunkKey>(wish.key).position;
    if (!result) {
        const ErrorCode code = result.error().code;
        if (code == ErrorCode::busy || code == ErrorCode::draining) {
            view.give_back(key);
            view_retry_at_ = now_ + std::chrono::milliseconds(context_.service->retry_after_ms());
            return;
        }
        fail_wish(wish, result.error());
        return;
    }
    const auto& served = std::get<ServedChunk>(*result);
    if (stage_ != Stage::open || view.has_forgotten() || !has_room_for(served)) {
        view.give_back(key);
        view_waits_ = true;
        return;
    }
    uncredited_bytes_ += served.chunk->payload_bytes();
    answer_chunk(wish, served);
}

}  // namespace terrane
