// The requests' part of a session: what is asked becomes wishes, wishes go to the service while
// there is room for their answers, and what comes back goes to the client.
#include "generator/world/composition.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"
#include "server/chunks/answer.h"
#include "server/chunks/chunk_key.h"
#include "server/chunks/chunk_service.h"
#include "server/chunks/counters.h"
#include "server/chunks/in_flight.h"
#include "server/net/outbox.h"
#include "server/net/session.h"
#include "server/net/view.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <unordered_set>
#include <utility>
#include <variant>
#include <vector>

namespace terrane {

namespace {

/// Bytes of a Chunk's head, which the answers under way will need beside their payloads.
constexpr std::size_t kHeadBytes = 128;

WireComposition wire_of(const Composition& composition) {
    WireComposition out;
    for (const Share& share : composition.shares()) {
        out.push_back({.material = share.material, .concentration = share.concentration});
    }
    return out;
}

}  // namespace

/// Counts it against the client's rate; if that is used up, says so.
bool Session::takes_request(std::uint32_t request_id, std::uint64_t number) {
    request_rate_.refill(now_);
    if (request_rate_.has(1 - 1e-9)) {
        request_rate_.take(1);
        return true;
    }
    raise(context_.service->counters().limited);
    const double wait_ms = 1000.0 / caps_.requests_per_second_max;
    send_failure(number, {.request_id = request_id,
                          .error = {.code = ErrorCode::busy,
                                    .message = std::to_string(caps_.requests_per_second_max) +
                                               " requests a second are the most for this session"},
                          .retry_after_ms = static_cast<std::uint32_t>(wait_ms) + 1,
                          .key = std::nullopt});
    log_.end(number);
    return false;
}

void Session::handle_one(const ChunkRequest& request) {
    const std::uint64_t number = log_.begin("chunks", request.request_id, request.keys.size());
    if (!takes_request(request.request_id, number)) {
        return;
    }
    for (std::size_t i = 0; i < request.keys.size(); ++i) {
        add({.request_id = request.request_id,
             .key = ChunkKey{.position = request.keys[i],
                             .format = request.format,
                             .without_flow = request.without_flow},
             .known_etag = request.known_etags.empty() ? Hash128{} : request.known_etags[i],
             .priority = std::clamp(request.priority, kPriorityMin, kPriorityMax) * kPriorityStep,
             .rank = {},
             .number = number});
    }
    submit();
}

void Session::handle_one(const ChunkCancel& cancel) {
    const std::unordered_set<std::uint32_t> ids(cancel.request_ids.begin(),
                                                cancel.request_ids.end());
    std::vector<Wish> cancelled;
    for (auto at = waiting_.begin(); at != waiting_.end();) {
        if (ids.contains(at->second.request_id)) {
            cancelled.push_back(at->second);
            at = waiting_.erase(at);
        } else {
            ++at;
        }
    }
    for (auto at = under_way_.begin(); at != under_way_.end();) {
        if (ids.contains(at->second.request_id)) {
            context_.service->cancel(at->second.key, at->first);
            cancelled.push_back(at->second);
            at = under_way_.erase(at);
        } else {
            ++at;
        }
    }
    for (const Wish& wish : cancelled) {
        fail_wish(wish, {.code = ErrorCode::cancelled, .message = "cancelled as asked"});
    }
    submit();
}

void Session::handle_one(const ColumnQuery& query) {
    const std::uint64_t number = log_.begin("column", query.request_id, 1);
    if (!takes_request(query.request_id, number)) {
        return;
    }
    add({.request_id = query.request_id,
         .key = query.column,
         .known_etag = {},
         .priority = 0,
         .rank = {},
         .number = number});
    submit();
}

void Session::handle_one(const WorldQuery& query) {
    const std::uint64_t number = log_.begin("world", query.request_id, 1);
    if (!takes_request(query.request_id, number)) {
        return;
    }
    if (context_.world_file.empty()) {
        fail_request(query.request_id,
                     {.code = ErrorCode::not_found,
                      .message = "this server does not publish its world file"},
                     number);
        return;
    }
    log_.answered(number, context_.world_file.size());
    send(WorldAnswer{.request_id = query.request_id,
                     .toml = context_.world_file,
                     .fingerprint = context_.hello.fingerprint});
}

void Session::add(Wish wish) {
    if (waiting_.size() + under_way_.size() - view_under_way_ >= caps_.keys_in_flight_max) {
        raise(context_.service->counters().outcomes[wish.key.index()].busy);
        fail_wish(wish, {.code = ErrorCode::busy,
                         .message = std::to_string(caps_.keys_in_flight_max) +
                                    " keys of this session are in flight, which is the most"});
        return;
    }
    wish.rank = {.urgency = -static_cast<std::int64_t>(wish.priority),
                 .sequence = next_sequence_++};
    waiting_.emplace(wish.rank, wish);
}

bool Session::has_room() const {
    const std::size_t expected = (under_way_.size() + 1) * (expected_bytes_ + kHeadBytes);
    if (!byte_rate_.has(under_way_.empty() ? 0 : static_cast<double>(expected))) {
        return false;
    }
    if (under_way_.empty()) {
        return !outbox_.full();
    }
    return under_way_.size() < caps_.wishes_under_way_max &&
           outbox_.bytes() + expected <= kOutboxBytesMax;
}

/// Hands wishes on, the most urgent first, as long as there is room for their answers.
void Session::submit() {
    if (stage_ != Stage::open && stage_ != Stage::finishing) {
        return;
    }
    byte_rate_.refill(now_);
    wake_at_.reset();
    view_waits_ = false;
    tell_forgotten();
    std::size_t answered = 0;
    while (has_room()) {
        View* const view = view_if_next();
        if (view == nullptr && waiting_.empty()) {
            break;
        }
        if (answered == kAnswersPerTurnMax) {
            go_on_later();
            break;
        }
        answered += (view != nullptr ? submit_of_view(*view) : submit_request()) ? 1U : 0U;
    }
    const bool view_wishes = view_ && view_->has_wish();
    const bool is_stalled = view_wishes && !view_has_credit();
    if (is_stalled && !is_stalled_) {
        raise(context_.service->counters().credit_stalls);
    }
    is_stalled_ = is_stalled;
    if (!byte_rate_.has() && (view_wishes || !waiting_.empty())) {
        wake_at_ = byte_rate_.ready_at();
    } else if (view_wishes && view_retry_at_ && *view_retry_at_ > now_) {
        wake_at_ = view_retry_at_;
    }
    finish_if_done();
}

void Session::go_on_later() {
    if (!goes_on_later_) {
        goes_on_later_ = true;
        post_([weak = weak_from_this()] {
            if (const auto self = weak.lock()) {
                self->goes_on_later_ = false;
                self->submit();
            }
        });
    }
}

/// The answer if it is at hand; nothing if it is under way now.
Result<std::optional<Answer>> Session::ask(Wish wish) {
    const WaiterId id = context_.service->new_waiter_id();
    AnswerCallback callback = [post = post_, weak = weak_from_this(),
                               id](const Result<Answer>& result) {
        post([weak, id, result] {
            if (const auto self = weak.lock()) {
                self->deliver(id, result);
            }
        });
    };
    auto outcome = context_.service->request(
        wish.key, wish.priority, {.id = id, .answer = std::move(callback), .flow = flow_});
    if (outcome && !*outcome) {
        view_under_way_ += wish.is_of_view() ? 1U : 0U;
        under_way_.emplace(id, wish);
    }
    return outcome;
}

/// True if it was answered at once.
bool Session::submit_request() {
    const Wish wish = waiting_.begin()->second;
    waiting_.erase(waiting_.begin());
    const auto outcome = ask(wish);
    if (!outcome) {
        fail_wish(wish, outcome.error());
        return true;
    }
    const std::optional<Answer>& at_hand = *outcome;
    if (at_hand) {
        answer(wish, *at_hand);
    }
    return at_hand.has_value();
}

void Session::deliver(WaiterId waiter, const Result<Answer>& result) {
    const auto found = under_way_.find(waiter);
    if (found == under_way_.end()) {
        return;  // cancelled in the meantime
    }
    Wish wish = found->second;
    under_way_.erase(found);
    if (wish.is_of_view()) {
        --view_under_way_;
        if (view_) {
            answer_of_view(*view_, wish, result);
        }
        submit();
        return;
    }
    if (result && outbox_.full() && std::holds_alternative<ServedChunk>(*result)) {
        waiting_.emplace(wish.rank, wish);
        return;
    }
    answer(wish, result);
    submit();
}

void Session::answer(const Wish& wish, const Result<Answer>& result) {
    if (!result) {
        fail_wish(wish, result.error());
    } else if (const auto* chunk = std::get_if<ServedChunk>(&*result)) {
        answer_chunk(wish, *chunk);
    } else {
        answer_column(wish, std::get<ServedColumn>(*result));
    }
}

void Session::answer_chunk(const Wish& wish, const ServedChunk& served) {
    const EncodedChunk& chunk = *served.chunk;
    const bool is_known = wish.known_etag != Hash128{} && wish.known_etag == chunk.etag;
    ChunkAnswer head{.request_id = wish.request_id,
                     .key = served.key.position,
                     .format = served.key.format,
                     .status = is_known ? ChunkStatus::not_modified : chunk.status,
                     .source = served.source,
                     .etag = chunk.etag,
                     .timings = served.timings,
                     .payload_bytes = 0,
                     .uniform = {}};
    log_.answered(number_of(wish), is_known ? 0 : chunk.payload_bytes());
    if (is_known) {
        send(head);
        return;
    }
    head.payload_bytes = static_cast<std::uint32_t>(chunk.payload_bytes());
    if (chunk.status == ChunkStatus::uniform) {
        head.uniform = wire_of(chunk.uniform);
    }
    // An exponential mean over about eight answers.
    expected_bytes_ = (expected_bytes_ * 7 + chunk.payload_bytes()) / 8;
    send(head, chunk.payload,
         wish.is_of_view() ? std::optional(served.key.position) : std::nullopt);
}

void Session::answer_column(const Wish& wish, const ServedColumn& column) {
    log_.answered(number_of(wish), 0);
    ColumnAnswer message{.request_id = wish.request_id, .column = column.column, .limits = {}};
    message.limits.reserve(column.limits->size());
    for (const ColumnLimit& limit : *column.limits) {
        message.limits.push_back({.y256 = limit.y256,
                                  .flow_x = limit.flow.x,
                                  .flow_y = limit.flow.y,
                                  .flow_z = limit.flow.z,
                                  .composition = wire_of(limit.composition)});
    }
    send(message);
}

void Session::fail_wish(const Wish& wish, Error error) {
    Failure failure{.request_id = wish.request_id,
                    .error = std::move(error),
                    .retry_after_ms = 0,
                    .key = std::nullopt};
    if (failure.error.code == ErrorCode::busy) {
        failure.retry_after_ms = context_.service->retry_after_ms();
    }
    if (const auto* chunk = std::get_if<ChunkKey>(&wish.key)) {
        failure.key = chunk->position;
    }
    send_failure(number_of(wish), failure);
}

void Session::fail_request(std::uint32_t request_id, Error error, std::uint64_t number) {
    send_failure(number, {.request_id = request_id,
                          .error = std::move(error),
                          .retry_after_ms = 0,
                          .key = std::nullopt});
}

void Session::send_failure(std::uint64_t number, const Failure& failure) {
    log_.failed(number, failure);
    send(failure);
}

}  // namespace terrane
