#include "client-sample/cpp/client.h"

#include "client-sample/cpp/connection.h"
#include "client-sample/cpp/wanted_chunks.h"
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
#include <iterator>
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

    std::size_t unanswered() const { return wanted_.unanswered() + queries_.size(); }

  private:
    template <typename T>
    tl::unexpected<Error> broken(const Result<T>& result) {
        error_ = result.error();
        return tl::unexpected(*error_);
    }

    Result<void> send_what_is_due();
    Result<void> give_credit(std::size_t above_bytes);
    Result<std::optional<AnyMessage>> read_message(Bytes& payload);
    Result<void> receive(Deadline deadline);
    Result<void> take(AnyMessage message, Bytes payload);
    Result<void> take_chunk(const ChunkAnswer& answer, Bytes payload);
    Result<void> take_failure(const Failure& failure);

    Connection connection_;
    std::chrono::milliseconds send_timeout_;
    FrameReader reader_{kOutboundFrameLimits};
    ServerHello hello_;
    std::optional<Error> error_;
    std::uint32_t last_id_ = 0;
    WantedChunks wanted_;
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
        if (std::optional<AnyMessage>& read = *message) {
            if (const auto* failure = std::get_if<Failure>(&*read)) {
                return tl::unexpected(failure->error);
            }
            auto* hello = std::get_if<ServerHello>(&*read);
            if (hello == nullptr) {
                return fail(ErrorCode::malformed,
                            "the server greets with " + std::string(name_of(*read)));
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
    if (const auto room = wanted_.make_room_for(keys.size()); !room) {
        return tl::unexpected(room.error());
    }
    if (error_) {
        return tl::unexpected(*error_);
    }
    const std::uint32_t id = next_id();
    wanted_.add(keys, format, priority, id);
    if (const auto sent = send_what_is_due(); !sent) {
        return broken(sent);
    }
    return id;
}

Result<void> Client::Session::cancel(std::uint32_t request_id) {
    if (request_id == 0) {  // the view's
        return {};
    }
    std::erase_if(events_, [&](const ClientEvent& event) {
        const auto* chunk = std::get_if<ReceivedChunk>(&event);
        const auto* failure = std::get_if<Failure>(&event);
        return (chunk != nullptr && chunk->answer.request_id == request_id) ||
               (failure != nullptr && failure->request_id == request_id);
    });
    std::vector<std::uint32_t> wire_ids = wanted_.cancel(request_id);
    while (!wire_ids.empty()) {
        const std::size_t count = std::min(wire_ids.size(), kRequestsPerCancelMax);
        const auto first = wire_ids.end() - static_cast<std::ptrdiff_t>(count);
        if (const auto sent = send(ChunkCancel{.request_ids = {first, wire_ids.end()}}); !sent) {
            return sent;
        }
        wire_ids.erase(first, wire_ids.end());
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
    const auto frame = reader.next().value_or(std::nullopt);
    if (!frame) {
        return fail(ErrorCode::invalid_argument, "ViewUpdate: too large for a frame");
    }
    if (const auto checked = decode_message(*frame); !checked) {
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
    wanted_.wake(steady_clock::now());
    while (wanted_.may_send(hello_.limits)) {
        const ChunkRequest request =
            wanted_.next_request(hello_.limits, next_id(), steady_clock::now());
        if (const auto sent = send(request); !sent) {
            return sent;
        }
    }
    return {};
}

/// The next message of what has been received, its payload copied out; nothing if it is not whole
/// yet.
Result<std::optional<AnyMessage>> Client::Session::read_message(Bytes& payload) {
    return next_message(reader_).map([&](std::optional<IncomingMessage> next) {
        std::optional<AnyMessage> message;
        if (next) {
            payload.assign(next->payload.begin(), next->payload.end());
            message = std::move(next->message);
        }
        return message;
    });
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
        if (std::optional<AnyMessage>& read = *message) {
            if (const auto taken = take(*std::move(read), std::move(payload)); !taken) {
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
        const Deadline wake = std::min(deadline, wanted_.wake_at().value_or(deadline));
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
    auto taken = wanted_.take(answer, std::move(payload), steady_clock::now());
    if (!taken) {
        return tl::unexpected(taken.error());
    }
    if (std::optional<ReceivedChunk>& chunk = *taken) {
        events_.emplace_back(*std::move(chunk));
    }
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
    auto told = wanted_.take(failure, steady_clock::now());
    if (!told) {
        return tl::unexpected(told.error());
    }
    std::ranges::move(*told, std::back_inserter(events_));
    return {};
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
