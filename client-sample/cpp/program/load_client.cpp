#include "client-sample/cpp/program/load_client.h"

#include "client-sample/cpp/chunk_reader.h"
#include "client-sample/cpp/program/carrier.h"
#include "client-sample/cpp/program/movement.h"
#include "client-sample/cpp/view_set.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace terrane {

namespace {

/// A view is told again when the viewer has moved so far, in chunk sides.
constexpr double kToldAgainSides = 0.125;
constexpr float kFieldOfView = 1.6F;

std::chrono::microseconds us_between(LoadClient::Clock::time_point from,
                                     LoadClient::Clock::time_point to) {
    return std::chrono::duration_cast<std::chrono::microseconds>(to - from);
}

}  // namespace

LoadClient::LoadClient(const LoadClientOptions& options, const MovementStart& movement,
                       std::unique_ptr<Carrier> carrier, const Handlers& handlers)
    : options_(options), movement_(movement), carrier_(std::move(carrier)), handlers_(handlers) {}

void LoadClient::send(const AnyMessage& message) {
    const Bytes bytes = carrier_->wrap(message);
    output_.insert(output_.end(), bytes.begin(), bytes.end());
}

void LoadClient::open(Clock::time_point now) {
    last_sign_ = wants_since_ = last_account_ = now;
    output_ = carrier_->opening();
    send(ClientHello{.protocol_version = kProtocolVersion,
                     .client_name = "terrane-client load",
                     .token = options_.token});
}

void LoadClient::leave() {
    send(Goodbye{.code = std::nullopt, .reason = "the load is over"});
}

void LoadClient::note_fault(std::string fault) {
    if (counts_.first_fault.empty()) {
        counts_.first_fault = std::move(fault);
    }
}

bool LoadClient::is_hung(Clock::time_point now) const {
    return (!hello_ || missing_ > 0) &&
           now - std::max(last_sign_, wants_since_) > options_.patience;
}

/// What wants nothing hears nothing, and has not been kept waiting.
void LoadClient::miss(std::size_t count, Clock::time_point now) {
    if (missing_ == 0) {
        wants_since_ = now;
    }
    missing_ += count;
}

/// How long something was missing is summed up whenever that may change.
void LoadClient::account_wanting(Clock::time_point now) {
    if (missing_ > 0) {
        counts_.wanting += us_between(last_account_, now);
    }
    last_account_ = now;
}

void LoadClient::tick(Clock::time_point now) {
    if (!hello_) {
        return;
    }
    const ServerHello& world = *hello_;
    account_wanting(now);
    if (is_moving_) {
        place_ = movement_.at(std::chrono::duration<double>(now - begin_).count());
    }
    look(world, now);
    if (!options_.by_view) {
        ask(world.limits, now);
    }
}

/// Tells the server where the viewer is if that has changed enough, and finds what is wanted now.
void LoadClient::look(const ServerHello& world, Clock::time_point now) {
    const double side = world.chunk_side;
    const bool is_again = view_due_ && *view_due_ <= now;
    if (told_place_ && !is_again &&
        std::max(std::abs(place_.x - told_place_->x), std::abs(place_.z - told_place_->z)) <
            kToldAgainSides * side) {
        return;
    }
    // Those who have no height of their own are at half the world's.
    const double y = place_.y != 0 ? place_.y : world.height_bound_voxels / 2;
    ViewUpdate view{.x = place_.x,
                    .y = y,
                    .z = place_.z,
                    .direction = {.x = static_cast<float>(place_.velocity_x),
                                  .y = 0,
                                  .z = static_cast<float>(place_.velocity_z)},
                    .field_of_view = kFieldOfView,
                    .velocity = {.x = static_cast<float>(place_.velocity_x),
                                 .y = static_cast<float>(place_.velocity_y),
                                 .z = static_cast<float>(place_.velocity_z)},
                    .radius_chunks = options_.radius_chunks,
                    .format = options_.format,
                    .without_flow = false,
                    .bytes_per_second_max = 0};
    told_place_ = place_;
    view_due_.reset();
    if (options_.by_view) {
        send(view);
    }
    const ViewSet next(view, world);
    if (!(next == view_)) {
        change_wants(world, next, now);
    }
}

void LoadClient::change_wants(const ServerHello& world, const ViewSet& next,
                              Clock::time_point now) {
    std::erase_if(wants_, [&](const auto& entry) {
        if (next.contains(entry.first)) {
            return false;
        }
        missing_ -= static_cast<std::size_t>(std::ranges::count(entry.second.has_come, false));
        return true;
    });
    std::vector<StackPos> added;
    for (const StackPos square : next.squares()) {
        if (!view_.contains(square)) {
            added.push_back(square);
        }
    }
    view_ = next;
    for (const StackPos square : added) {
        const auto heights = static_cast<std::size_t>(heights_of(square.lod, world));
        wants_.insert_or_assign(square,
                                Want{.since = now, .has_come = std::vector<bool>(heights, false)});
        miss(heights, now);
    }
    if (options_.by_view) {
        return;
    }
    std::ranges::sort(added, {}, [&](StackPos square) {
        const double side = world.chunk_side * std::exp2(square.lod);
        return std::pair(std::max(std::abs((square.x + 0.5) * side - place_.x),
                                  std::abs((square.z + 0.5) * side - place_.z)),
                         square);
    });
    std::erase_if(to_ask_, [&](ChunkPos key) { return !view_.contains(stack_of(key)); });
    for (const StackPos square : added) {
        for (std::int32_t y = 0; y < heights_of(square.lod, world); ++y) {
            to_ask_.push_back({.lod = square.lod, .x = square.x, .y = y, .z = square.z});
        }
    }
}

/// Without views: requests of as many keys as may be under way.
void LoadClient::ask(const WireLimits& limits, Clock::time_point now) {
    while (!paused_.empty() && paused_.begin()->first <= now) {
        if (view_.contains(stack_of(paused_.begin()->second))) {
            to_ask_.push_back(paused_.begin()->second);
        }
        paused_.erase(paused_.begin());
    }
    const std::size_t in_flight_max =
        std::min<std::size_t>(limits.keys_in_flight_max, kLoadKeysInFlightMax);
    const std::size_t keys_max =
        std::clamp<std::size_t>(limits.keys_per_request_max, 1, kKeysPerRequestMax);
    while (!to_ask_.empty() && keys_in_flight_ < in_flight_max) {
        ChunkRequest request;
        last_id_ = last_id_ == std::numeric_limits<std::uint32_t>::max() ? 1 : last_id_ + 1;
        request.request_id = last_id_;
        request.format = options_.format;
        while (!to_ask_.empty() && request.keys.size() < keys_max &&
               keys_in_flight_ < in_flight_max) {
            request.keys.push_back(to_ask_.front());
            to_ask_.pop_front();
            ++keys_in_flight_;
        }
        in_flight_.emplace(request.request_id, request.keys);
        send(request);
    }
}

Result<void> LoadClient::receive(std::span<const std::byte> bytes, Clock::time_point now) {
    last_sign_ = now;
    if (const auto fed = carrier_->feed(bytes); !fed) {
        return fed;
    }
    for (;;) {
        auto next = carrier_->next();
        if (!next) {
            return tl::unexpected(next.error());
        }
        std::optional<IncomingMessage>& carried = *next;
        if (!carried) {
            break;
        }
        if (const auto taken = take(*carried, Clock::now()); !taken) {
            return taken;
        }
        const Bytes reply = carrier_->take_reply();
        output_.insert(output_.end(), reply.begin(), reply.end());
    }
    const Bytes reply = carrier_->take_reply();
    output_.insert(output_.end(), reply.begin(), reply.end());
    if (uncredited_bytes_ > 0) {
        send(Credit{.bytes = std::exchange(uncredited_bytes_, 0)});
    }
    if (hello_ && !options_.by_view) {
        ask(hello_->limits, now);
    }
    return {};
}

Result<void> LoadClient::take(IncomingMessage& carried, Clock::time_point now) {
    AnyMessage& message = carried.message;
    if (const auto* chunk = std::get_if<ChunkAnswer>(&message); chunk != nullptr && hello_) {
        take_chunk(*hello_, *chunk, carried.payload, now);
        return {};
    }
    if (const auto* failure = std::get_if<Failure>(&message)) {
        return take_failure(*failure, now);
    }
    if (const auto* forget = std::get_if<ChunkForget>(&message)) {
        take_forget(*forget, now);
        return {};
    }
    if (const auto* ping = std::get_if<Ping>(&message)) {
        send(Pong{.nonce = ping->nonce});
        return {};
    }
    if (const auto* world = std::get_if<WorldAnswer>(&message); world != nullptr && hello_) {
        handlers_.world(*world, *hello_);
        return {};
    }
    if (const auto* goodbye = std::get_if<Goodbye>(&message)) {
        return fail(goodbye->code.value_or(ErrorCode::draining),
                    "the server says goodbye: " + goodbye->reason);
    }
    if (auto* hello = std::get_if<ServerHello>(&message); hello != nullptr && !hello_) {
        if (hello->protocol_version != kProtocolVersion) {
            return fail(ErrorCode::version_mismatch,
                        "the server speaks protocol " + std::to_string(hello->protocol_version) +
                            ", this client " + std::to_string(kProtocolVersion));
        }
        if (options_.by_view && hello->limits.view_radius_max == 0) {
            return fail(ErrorCode::unsupported,
                        "this server has no views; ask for chunks by key: --by request");
        }
        hello_ = std::move(*hello);
        begin_ = last_account_ = now;
        if (options_.asks_world) {
            last_id_ = 1;
            send(WorldQuery{.request_id = last_id_});
        }
        tick(now);
        return {};
    }
    return fail(ErrorCode::malformed,
                "the server sent a " + std::string(name_of(message)) + " that nobody asked for");
}

/// The chunk is no longer missing. Nothing if it had come before or left the view.
void LoadClient::settle(ChunkPos key) {
    const auto want = wants_.find(stack_of(key));
    const auto y = static_cast<std::size_t>(key.y);
    if (want != wants_.end() && key.y >= 0 && y < want->second.has_come.size() &&
        !want->second.has_come[y]) {
        want->second.has_come[y] = true;
        --missing_;
    }
}

/// Without views: takes the key off its request; false if it was not in it.
bool LoadClient::answered(std::uint32_t request_id, ChunkPos key) {
    const auto request = in_flight_.find(request_id);
    if (request == in_flight_.end() || std::erase(request->second, key) == 0) {
        return false;
    }
    --keys_in_flight_;
    if (request->second.empty()) {
        in_flight_.erase(request);
    }
    return true;
}

void LoadClient::take_chunk(const ServerHello& world, const ChunkAnswer& answer,
                            std::span<const std::byte> payload, Clock::time_point now) {
    if (options_.by_view) {
        uncredited_bytes_ += payload.size();
    } else if (!answered(answer.request_id, answer.key)) {
        ++counts_.undecodable;
        note_fault("a chunk came that nobody asked for");
        return;
    }
    ++counts_.chunks;
    counts_.bytes += payload.size();
    const bool is_decoded = counts_.chunks % options_.decode_every == 0;
    const auto content =
        is_decoded ? read_chunk(answer, payload, world) : Result<ChunkContent>(ChunkContent{});
    const auto decoded = Clock::now();
    if (!content) {
        ++counts_.undecodable;
        note_fault("undecodable: " + content.error().message);
    } else {
        counts_.triangles += content->triangle_count();
        if (is_decoded) {
            handlers_.chunk(answer, payload);
        }
    }
    const auto want = wants_.find(stack_of(answer.key));
    if (want == wants_.end()) {
        ++counts_.wasted_chunks;
        counts_.wasted_bytes += payload.size();
        return;
    }
    counts_.latency.add(us_between(want->second.since, decoded));
    account_wanting(now);
    settle(answer.key);
    if (missing_ == 0 && !counts_.fill) {
        counts_.fill = us_between(begin_, decoded);
        counts_.fill_chunks = counts_.chunks;
    }
}

/// What is forgotten and wanted again comes again: the server was told both, and says both in
/// order.
void LoadClient::take_forget(const ChunkForget& forget, Clock::time_point now) {
    account_wanting(now);
    counts_.forgotten += forget.keys.size();
    for (const ChunkPos key : forget.keys) {
        const auto want = wants_.find(stack_of(key));
        const auto y = static_cast<std::size_t>(key.y);
        if (want != wants_.end() && key.y >= 0 && y < want->second.has_come.size() &&
            want->second.has_come[y]) {
            want->second.has_come[y] = false;
            miss(1, now);
        }
    }
}

Result<void> LoadClient::take_failure(const Failure& failure, Clock::time_point now) {
    const bool is_busy = failure.error.code == ErrorCode::busy;
    counts_.busy += is_busy ? 1 : 0;
    const auto again = now + std::chrono::milliseconds(std::max(failure.retry_after_ms, 1U));
    if (!hello_ || (failure.request_id == 0 && !failure.key && !is_busy)) {
        return tl::unexpected(failure.error);
    }
    if (failure.request_id == 0 && !failure.key) {  // the view, told too often
        view_due_ = again;
        return {};
    }
    std::vector<ChunkPos> keys;
    if (failure.key) {
        keys = {*failure.key};
    } else if (const auto request = in_flight_.find(failure.request_id);
               request != in_flight_.end()) {
        keys = request->second;
    } else {
        note_fault("the world file: " + failure.error.message);
        return {};
    }
    for (const ChunkPos key : keys) {
        if (!options_.by_view) {
            answered(failure.request_id, key);
        }
        if (!is_busy) {
            ++counts_.refused;
            note_fault("refused: " + failure.error.message);
            account_wanting(now);
            settle(key);
        } else if (!options_.by_view) {
            paused_.emplace(again, key);
        }
    }
    return {};
}

}  // namespace terrane
