#include "client-sample/cpp/wanted_chunks.h"

#include "client-sample/cpp/client.h"
#include "client-sample/cpp/connection.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace terrane {

namespace {

std::string to_text(ChunkPos key) {
    return "chunk " + std::to_string(key.lod) + "/" + std::to_string(key.x) + "/" +
           std::to_string(key.y) + "/" + std::to_string(key.z);
}

}  // namespace

Result<void> WantedChunks::make_room_for(std::size_t count) const {
    if (count > kUnansweredMax - unanswered_) {
        return fail(ErrorCode::busy, std::to_string(unanswered_) +
                                         " chunks have no answer yet, at most " +
                                         std::to_string(kUnansweredMax) + " may");
    }
    return {};
}

void WantedChunks::add(std::span<const ChunkPos> keys, ChunkFormat format, std::int32_t priority,
                       std::uint32_t request_id) {
    for (const ChunkPos key : keys) {
        waiting_.push_back({.key = key,
                            .format = format,
                            .priority = priority,
                            .request_id = request_id,
                            .tries = 0,
                            .is_cancelled = false,
                            .first_sent = {}});
    }
    unanswered_ += keys.size();
}

std::vector<std::uint32_t> WantedChunks::cancel(std::uint32_t request_id) {
    unanswered_ -=
        std::erase_if(waiting_, [&](const Wanted& w) { return w.request_id == request_id; });
    unanswered_ -=
        std::erase_if(paused_, [&](const auto& w) { return w.second.request_id == request_id; });
    std::vector<std::uint32_t> wire_ids;
    for (auto& [wire_id, sent] : in_flight_) {
        if (sent.front().request_id != request_id || sent.front().is_cancelled) {
            continue;
        }
        // They stay in flight: the server still answers each, and counts it until then.
        for (Wanted& wanted : sent) {
            wanted.is_cancelled = true;
        }
        unanswered_ -= sent.size();
        wire_ids.push_back(wire_id);
    }
    return wire_ids;
}

void WantedChunks::wake(Deadline now) {
    while (!paused_.empty() && paused_.begin()->first <= now) {
        waiting_.push_back(paused_.begin()->second);
        paused_.erase(paused_.begin());
    }
}

std::optional<Deadline> WantedChunks::wake_at() const {
    return paused_.empty() ? std::nullopt : std::optional(paused_.begin()->first);
}

bool WantedChunks::may_send(const WireLimits& limits) const {
    return !waiting_.empty() && keys_in_flight_ < limits.keys_in_flight_max;
}

ChunkRequest WantedChunks::next_request(const WireLimits& limits, std::uint32_t wire_id,
                                        Deadline now) {
    const std::size_t room = std::min({std::size_t{limits.keys_per_request_max}, kKeysPerRequestMax,
                                       std::size_t{limits.keys_in_flight_max} - keys_in_flight_});
    const Wanted first = waiting_.front();
    ChunkRequest request{.request_id = wire_id,
                         .format = first.format,
                         .keys = {},
                         .known_etags = {},
                         .priority = first.priority,
                         .without_flow = false};
    std::vector<Wanted> batch;
    while (!waiting_.empty() && batch.size() < room &&
           waiting_.front().request_id == first.request_id) {
        Wanted& wanted = batch.emplace_back(waiting_.front());
        waiting_.pop_front();
        wanted.first_sent = wanted.tries == 0 ? now : wanted.first_sent;
        ++wanted.tries;
        request.keys.push_back(wanted.key);
    }
    keys_in_flight_ += batch.size();
    in_flight_.emplace(wire_id, std::move(batch));
    return request;
}

Result<std::optional<ReceivedChunk>> WantedChunks::take(const ChunkAnswer& answer, Bytes payload,
                                                        Deadline now) {
    const auto sent = in_flight_.find(answer.request_id);
    const auto matches = [&](const Wanted& w) {
        return w.key == answer.key && w.format == answer.format;
    };
    if (sent == in_flight_.end() || std::ranges::none_of(sent->second, matches)) {
        return fail(ErrorCode::malformed,
                    "the server sent " + to_text(answer.key) + " that nobody asked for");
    }
    const auto found = std::ranges::find_if(sent->second, matches);
    const Wanted wanted = *found;
    sent->second.erase(found);
    --keys_in_flight_;
    if (sent->second.empty()) {
        in_flight_.erase(sent);
    }
    if (wanted.is_cancelled) {
        return std::nullopt;
    }
    --unanswered_;
    ReceivedChunk chunk{
        .answer = answer,
        .payload = std::move(payload),
        .waited = std::chrono::duration_cast<std::chrono::microseconds>(now - wanted.first_sent)};
    chunk.answer.request_id = wanted.request_id;
    return chunk;
}

Result<std::vector<Failure>> WantedChunks::take(const Failure& failure, Deadline now) {
    const auto sent = in_flight_.find(failure.request_id);
    if (sent == in_flight_.end()) {
        return fail(ErrorCode::malformed,
                    "the server refused a request that was never made: " + failure.error.message);
    }
    std::vector<Wanted> refused;
    if (failure.key) {
        const auto found = std::ranges::find(sent->second, *failure.key, &Wanted::key);
        if (found == sent->second.end()) {
            return fail(ErrorCode::malformed,
                        "the server refused " + to_text(*failure.key) + " that nobody asked for");
        }
        refused.push_back(*found);
        sent->second.erase(found);
    } else {
        refused.swap(sent->second);
    }
    if (sent->second.empty()) {
        in_flight_.erase(sent);
    }
    keys_in_flight_ -= refused.size();
    std::vector<Failure> told;
    for (const Wanted& wanted : refused) {
        if (auto settled = settle(wanted, failure, now)) {
            told.push_back(*std::move(settled));
        }
    }
    return told;
}

/// A busy key is tried again later, until it has been tried enough; everything else is told.
std::optional<Failure> WantedChunks::settle(const Wanted& wanted, const Failure& failure,
                                            Deadline now) {
    if (wanted.is_cancelled) {
        return std::nullopt;
    }
    if (failure.error.code == ErrorCode::busy && wanted.tries < kBusyTriesMax) {
        const std::uint64_t grown_ms = std::uint64_t{std::max(failure.retry_after_ms, 1U)}
                                       << static_cast<unsigned>(wanted.tries - 1);
        const auto pause_ms = std::max<std::uint64_t>(
            failure.retry_after_ms, std::min<std::uint64_t>(grown_ms, kBusyPauseMaxMs));
        paused_.emplace(now + std::chrono::milliseconds(pause_ms), wanted);
        return std::nullopt;
    }
    --unanswered_;
    Failure told = failure;
    told.request_id = wanted.request_id;
    told.key = wanted.key;
    return told;
}

}  // namespace terrane
