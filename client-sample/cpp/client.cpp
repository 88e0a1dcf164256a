// How keys travel: `waiting_` (asked for, not sent) -> `in_flight_` (sent) -> an event. A busy one
// goes to `paused_` and from there to `waiting_` again when its time has come.
#include "client-sample/cpp/client.h"

#include "client-sample/cpp/connection.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/frame.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace terrane {

namespace {

using std::chrono::steady_clock;

/// A key that has no answer yet.
struct Wanted {
    ChunkPos key;
    ChunkFormat format = ChunkFormat::draco;
    std::int32_t priority = 0;
    std::uint32_t request_id =
        0;  ///< as the caller knows it; on the wire every sending has one of its own
    int tries = 0;
    bool is_cancelled = false;
    Deadline first_sent;
};

std::string to_text(ChunkPos key) {
    return "chunk " + std::to_string(key.lod) + "/" + std::to_string(key.x) + "/" +
           std::to_string(key.y) + "/" + std::to_string(key.z);
}

/// What a Failure without id or key may say of one message, after which the session goes on.
bool is_about_one_message(ErrorCode code) {
    return code == ErrorCode::invalid_argument || code == ErrorCode::out_of_range ||
           code == ErrorCode::unsupported || code == ErrorCode::busy;
}

}  // namespace

class Client::Session {
  public:
    Session(Connection connection, std::chrono::milliseconds send_timeout)
        : connection_(std::move(connection)), send_timeout_(send_timeout) {}

    Result<void> greet(const ClientOptions& options, Deadline deadline);
    Result<std::uint32_t> request(std::span<const ChunkPos> keys, ChunkFormat format,
                                  std::int32_t priority);
    Result<void> cancel(std::uint32_t request_id);
    Result<void> view(const ViewUpdate& update);
    Result<void> send(const AnyMessage& message);
    Result<std::optional<ClientEvent>> next(Deadline deadline);

    std::uint32_t next_id() { return ++last_id_ == 0 ? ++last_id_ : last_id_; }

    Result<std::uint32_t> query(const AnyMessage& message, std::uint32_t id) {
        return send(message).map([&] {
            queries_.insert(id);
            return id;
        });
    }

    const ServerHello& hello() const { return hello_; }

    std::size_t unanswered() const { return unanswered_ + queries_.size(); }

  private:
    template <typename T>
    tl::unexpected<Error> broken(const Result<T>& result) {
        error_ = result.error();
        return tl::unexpected(*error_);
    }

    Result<void> send_what_is_due();
    Result<void> give_credit(std::size_t above_bytes);
    Result<void> send_batch();
    Result<std::optional<AnyMessage>> read_message(Bytes& payload);
    Result<void> receive(Deadline deadline);
    Result<void> take(AnyMessage message, Bytes payload);
    Result<void> take_chunk(const ChunkAnswer& answer, Bytes payload);
    Result<void> take_failure(const Failure& failure);
    void settle_failure(const Wanted& wanted, const Failure& failure);

    Connection connection_;
    std::chrono::milliseconds send_timeout_;
    FrameReader reader_{kOutboundFrameLimits};
    ServerHello hello_;
    std::optional<Error> error_;
    std::uint32_t last_id_ = 0;
    std::size_t unanswered_ = 0;  ///< keys that are waiting, paused or in flight, and not cancelled
    std::size_t keys_in_flight_ = 0;
    std::deque<Wanted> waiting_;
    std::multimap<Deadline, Wanted> paused_;
    std::map<std::uint32_t, std::vector<Wanted>> in_flight_;  ///< by the id on the wire
    std::set<std::uint32_t> queries_;
    std::deque<ClientEvent> events_;
    bool has_view_ = false;           ///< one has been asked for
    std::size_t given_bytes_ = 0;     ///< of the view's chunk that `next` gave last
    std::size_t consumed_bytes_ = 0;  ///< of the view's chunks, and not credited yet
};

Result<void> Client::Session::greet(const ClientOptions& options, Deadline deadline) {
    const ClientHello greeting{.protocol_version = kProtocolVersion,
                               .client_name = options.client_name,
                               .token = options.token};
    if (const auto sent = send(greeting); !sent) {
        return sent;
    }
    for (;;) {
        Bytes payload;
        auto message = read_message(payload);
        if (!message) {
            return tl::unexpected(message.error());
        }
        if (*message) {
            if (const auto* failure = std::get_if<Failure>(&**message)) {
                return tl::unexpected(failure->error);
            }
            auto* hello = std::get_if<ServerHello>(&**message);
            if (hello == nullptr) {
                return fail(ErrorCode::malformed,
                            "the server greets with " + std::string(name_of(**message)));
            }
            if (hello->protocol_version != kProtocolVersion) {
                return fail(ErrorCode::version_mismatch,
                            "the server speaks protocol " +
                                std::to_string(hello->protocol_version) + ", this client " +
                                std::to_string(kProtocolVersion));
            }
            hello_ = std::move(*hello);
            return {};
        }
        if (steady_clock::now() >= deadline) {
            return fail(ErrorCode::io_error, "connected, but the server does not greet");
        }
        if (const auto received = receive(deadline); !received) {
            return received;
        }
    }
}

Result<std::uint32_t> Client::Session::request(std::span<const ChunkPos> keys, ChunkFormat format,
                                               std::int32_t priority) {
    if (keys.size() > kUnansweredMax - unanswered_) {
        return fail(ErrorCode::busy, std::to_string(unanswered_) +
                                         " chunks have no answer yet, at most " +
                                         std::to_string(kUnansweredMax) + " may");
    }
    if (error_) {
        return tl::unexpected(*error_);
    }
    const std::uint32_t id = next_id();
    for (const ChunkPos key : keys) {
        waiting_.push_back({.key = key,
                            .format = format,
                            .priority = priority,
                            .request_id = id,
                            .tries = 0,
                            .is_cancelled = false,
                            .first_sent = {}});
    }
    unanswered_ += keys.size();
    if (const auto sent = send_what_is_due(); !sent) {
        return broken(sent);
    }
    return id;
}

Result<void> Client::Session::cancel(std::uint32_t request_id) {
    if (request_id == 0) {  // the view's
        return {};
    }
    unanswered_ -=
        std::erase_if(waiting_, [&](const Wanted& w) { return w.request_id == request_id; });
    unanswered_ -=
        std::erase_if(paused_, [&](const auto& w) { return w.second.request_id == request_id; });
    std::erase_if(events_, [&](const ClientEvent& event) {
        const auto* chunk = std::get_if<ReceivedChunk>(&event);
        const auto* failure = std::get_if<Failure>(&event);
        return (chunk != nullptr && chunk->answer.request_id == request_id) ||
               (failure != nullptr && failure->request_id == request_id);
    });
    ChunkCancel cancel;
    for (auto& [wire_id, sent] : in_flight_) {
        if (sent.front().request_id != request_id || sent.front().is_cancelled) {
            continue;
        }
        // They stay in flight: the server still answers each, and counts it until then.
        for (Wanted& wanted : sent) {
            wanted.is_cancelled = true;
        }
        unanswered_ -= sent.size();
        cancel.request_ids.push_back(wire_id);
    }
    while (!cancel.request_ids.empty()) {
        const std::size_t count = std::min(cancel.request_ids.size(), kRequestsPerCancelMax);
        const auto first = cancel.request_ids.end() - static_cast<std::ptrdiff_t>(count);
        if (const auto sent = send(ChunkCancel{.request_ids = {first, cancel.request_ids.end()}});
            !sent) {
            return sent;
        }
        cancel.request_ids.erase(first, cancel.request_ids.end());
    }
    return {};
}

Result<void> Client::Session::view(const ViewUpdate& update) {
    if (hello_.limits.view_radius_max == 0) {
        return fail(ErrorCode::unsupported, "this server gives no views");
    }
    // What the server would refuse is told here, where it can be put right.
    FrameReader reader(kInboundFrameLimits);
    reader.feed(encode_message(update));
    const auto frame = reader.next();
    if (!frame || !*frame) {
        return fail(ErrorCode::invalid_argument, "ViewUpdate: too large for a frame");
    }
    if (const auto checked = decode_message(**frame); !checked) {
        return tl::unexpected(checked.error());
    }
    has_view_ = true;
    return send(update);
}

/// Gives back what has been consumed, if it is more than `above_bytes`.
Result<void> Client::Session::give_credit(std::size_t above_bytes) {
    if (consumed_bytes_ <= above_bytes) {
        return {};
    }
    return send(Credit{.bytes = std::exchange(consumed_bytes_, 0)});
}

Result<void> Client::Session::send(const AnyMessage& message) {
    if (error_) {
        return tl::unexpected(*error_);
    }
    const auto sent =
        connection_.send(encode_message(message), steady_clock::now() + send_timeout_);
    if (!sent) {
        return broken(sent);
    }
    return {};
}

Result<void> Client::Session::send_what_is_due() {
    const auto now = steady_clock::now();
    while (!paused_.empty() && paused_.begin()->first <= now) {
        waiting_.push_back(paused_.begin()->second);
        paused_.erase(paused_.begin());
    }
    while (!waiting_.empty() && keys_in_flight_ < hello_.limits.keys_in_flight_max) {
        if (const auto sent = send_batch(); !sent) {
            return sent;
        }
    }
    return {};
}

/// One request of the first waiting keys that were asked for together.
Result<void> Client::Session::send_batch() {
    const std::size_t room =
        std::min({std::size_t{hello_.limits.keys_per_request_max}, kKeysPerRequestMax,
                  std::size_t{hello_.limits.keys_in_flight_max} - keys_in_flight_});
    const Wanted first = waiting_.front();
    const std::uint32_t wire_id = next_id();
    ChunkRequest request{.request_id = wire_id,
                         .format = first.format,
                         .keys = {},
                         .known_etags = {},
                         .priority = first.priority,
                         .without_flow = false};
    std::vector<Wanted> batch;
    const auto now = steady_clock::now();
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
    return send(request);
}

/// The next message of what has been received, its payload copied out; nothing if it is not whole
/// yet.
Result<std::optional<AnyMessage>> Client::Session::read_message(Bytes& payload) {
    auto frame = reader_.next();
    while (frame && *frame && !is_known(**frame)) {  // a newer server's: passed over
        frame = reader_.next();
    }
    if (!frame) {
        return tl::unexpected(frame.error());
    }
    if (!*frame) {
        return std::nullopt;
    }
    auto message = decode_message(**frame);
    if (!message) {
        return tl::unexpected(message.error());
    }
    payload.assign((*frame)->payload.begin(), (*frame)->payload.end());
    return std::move(*message);
}

Result<void> Client::Session::receive(Deadline deadline) {
    const auto bytes = connection_.receive(deadline);
    if (!bytes) {
        Error error = bytes.error();
        if (reader_.buffered_bytes() > 0) {
            error.message += " in the middle of a frame";
        }
        return tl::unexpected(std::move(error));
    }
    reader_.feed(*bytes);
    return {};
}

Result<std::optional<ClientEvent>> Client::Session::next(Deadline deadline) {
    consumed_bytes_ += std::exchange(given_bytes_, 0);
    // In quarters of the window: a message for several chunks, and the server never has to wait.
    if (const auto given = give_credit(hello_.limits.credit_window_bytes / 4); !given) {
        return broken(given);
    }
    for (bool is_expired = false;;) {
        if (!events_.empty()) {
            ClientEvent event = std::move(events_.front());
            events_.pop_front();
            if (const auto* chunk = std::get_if<ReceivedChunk>(&event);
                chunk != nullptr && chunk->answer.request_id == 0) {
                given_bytes_ = chunk->payload.size();
            }
            return event;
        }
        if (error_) {
            return tl::unexpected(*error_);
        }
        if (const auto sent = send_what_is_due(); !sent) {
            return broken(sent);
        }
        Bytes payload;
        auto message = read_message(payload);
        if (!message) {
            return broken(message);
        }
        if (*message) {
            if (const auto taken = take(std::move(**message), std::move(payload)); !taken) {
                return broken(taken);
            }
            continue;
        }
        if (is_expired) {
            return std::nullopt;
        }
        if (const auto given = give_credit(0); !given) {  // nothing else is at hand
            return broken(given);
        }
        const Deadline wake =
            paused_.empty() ? deadline : std::min(deadline, paused_.begin()->first);
        if (const auto received = receive(wake); !received) {
            return broken(received);
        }
        is_expired = steady_clock::now() >= deadline;
    }
}

Result<void> Client::Session::take(AnyMessage message, Bytes payload) {
    if (const auto* chunk = std::get_if<ChunkAnswer>(&message)) {
        return take_chunk(*chunk, std::move(payload));
    }
    if (const auto* failure = std::get_if<Failure>(&message)) {
        return take_failure(*failure);
    }
    if (const auto* ping = std::get_if<Ping>(&message)) {
        return send(Pong{.nonce = ping->nonce});
    }
    if (auto* column = std::get_if<ColumnAnswer>(&message);
        column != nullptr && queries_.erase(column->request_id) > 0) {
        events_.emplace_back(std::move(*column));
        return {};
    }
    if (auto* world = std::get_if<WorldAnswer>(&message);
        world != nullptr && queries_.erase(world->request_id) > 0) {
        events_.emplace_back(std::move(*world));
        return {};
    }
    if (const auto* pong = std::get_if<Pong>(&message)) {
        events_.emplace_back(*pong);
        return {};
    }
    if (auto* forget = std::get_if<ChunkForget>(&message); forget != nullptr && has_view_) {
        events_.emplace_back(std::move(*forget));
        return {};
    }
    if (auto* goodbye = std::get_if<Goodbye>(&message)) {
        events_.emplace_back(std::move(*goodbye));
        return {};
    }
    return fail(ErrorCode::malformed,
                "the server sent a " + std::string(name_of(message)) + " that nobody asked for");
}

Result<void> Client::Session::take_chunk(const ChunkAnswer& answer, Bytes payload) {
    if (answer.request_id == 0 && has_view_) {
        events_.emplace_back(
            ReceivedChunk{.answer = answer, .payload = std::move(payload), .waited = {}});
        return {};
    }
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
        return {};
    }
    --unanswered_;
    ReceivedChunk chunk{.answer = answer,
                        .payload = std::move(payload),
                        .waited = std::chrono::duration_cast<std::chrono::microseconds>(
                            steady_clock::now() - wanted.first_sent)};
    chunk.answer.request_id = wanted.request_id;
    events_.emplace_back(std::move(chunk));
    return {};
}

Result<void> Client::Session::take_failure(const Failure& failure) {
    if (failure.request_id == 0) {
        if (has_view_ && (failure.key || is_about_one_message(failure.error.code))) {
            events_.emplace_back(failure);
            return {};
        }
        return tl::unexpected(failure.error);
    }
    if (queries_.erase(failure.request_id) > 0) {
        events_.emplace_back(failure);
        return {};
    }
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
    for (const Wanted& wanted : refused) {
        settle_failure(wanted, failure);
    }
    return {};
}

/// A busy key is tried again later, until it has been tried enough; everything else is told.
void Client::Session::settle_failure(const Wanted& wanted, const Failure& failure) {
    if (wanted.is_cancelled) {
        return;
    }
    if (failure.error.code == ErrorCode::busy && wanted.tries < kBusyTriesMax) {
        const std::uint64_t grown_ms = std::uint64_t{std::max(failure.retry_after_ms, 1U)}
                                       << static_cast<unsigned>(wanted.tries - 1);
        const auto pause_ms = std::max<std::uint64_t>(
            failure.retry_after_ms, std::min<std::uint64_t>(grown_ms, kBusyPauseMaxMs));
        paused_.emplace(steady_clock::now() + std::chrono::milliseconds(pause_ms), wanted);
        return;
    }
    --unanswered_;
    Failure told = failure;
    told.request_id = wanted.request_id;
    told.key = wanted.key;
    events_.emplace_back(std::move(told));
}

Client::Client(std::unique_ptr<Session> session) : session_(std::move(session)) {}

Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;
Client::~Client() = default;

Result<Client> Client::connect(const ClientOptions& options) {
    const Deadline deadline = steady_clock::now() + options.timeout;
    auto connection = Connection::open(options.host, options.port, options.tls, deadline);
    if (!connection) {
        return tl::unexpected(connection.error());
    }
    auto session = std::make_unique<Session>(std::move(*connection), options.timeout);
    if (const auto greeted = session->greet(options, deadline); !greeted) {
        return tl::unexpected(greeted.error());
    }
    return Client(std::move(session));
}

const ServerHello& Client::hello() const {
    return session_->hello();
}

Result<std::uint32_t> Client::request(std::span<const ChunkPos> keys, ChunkFormat format,
                                      std::int32_t priority) {
    return session_->request(keys, format, priority);
}

Result<void> Client::cancel(std::uint32_t request_id) {
    return session_->cancel(request_id);
}

Result<void> Client::view(const ViewUpdate& update) {
    return session_->view(update);
}

Result<std::uint32_t> Client::query_column(ColumnPos column) {
    const std::uint32_t id = session_->next_id();
    return session_->query(ColumnQuery{.request_id = id, .column = column}, id);
}

Result<std::uint32_t> Client::query_world() {
    const std::uint32_t id = session_->next_id();
    return session_->query(WorldQuery{.request_id = id}, id);
}

Result<void> Client::ping(std::uint64_t nonce) {
    return session_->send(Ping{.nonce = nonce});
}

std::size_t Client::unanswered() const {
    return session_->unanswered();
}

Result<std::optional<ClientEvent>> Client::next(Deadline deadline) {
    return session_->next(deadline);
}

}  // namespace terrane
