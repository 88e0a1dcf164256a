// One client's session, from its hello to its goodbye, without a socket: bytes in, an outbox out,
// the time given. A transport (client_connection.cpp) feeds it, writes the outbox and closes when
// told.
//
//     hello ──ClientHello──> open ──drain──> finishing ──last answer──> closing ──> dead
//       └──── malformed, too late, wrong version ─────────────────────────┘
//
// Wishes (keys and columns) wait in the session, most urgent first, and beside them the wishes of
// the client's view (view.h). They go to the service only while the outbox, with the answers
// expected for what is under way, has room, and those of the view only while there is credit for
// them: a client that doesn't read makes no work and holds little memory. Answers come back through
// `post` on the session's own thread.
//
// What the session does for its requests is in session_requests.cpp, for its view in
// session_view.cpp.
#pragma once

#include "protocol/wire/frame.h"
#include "protocol/wire/messages.h"
#include "server/chunks/chunk_service.h"
#include "server/net/outbox.h"
#include "server/net/request_log.h"
#include "server/net/session_caps.h"
#include "server/net/token_bucket.h"
#include "server/net/view.h"

#include <atomic>
#include <chrono>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>

namespace terrane {

/// What a client's priority is clamped to. It counts among the client's own wishes only.
inline constexpr std::int32_t kPriorityMin = -8;
inline constexpr std::int32_t kPriorityMax = 8;
/// Between two priorities of a client there is room for a whole view: requests of priority 0 come
/// before all but its near ring, those below 0 after all of it.
inline constexpr std::int32_t kPriorityStep = 1 << 16;
/// Answers out of the cache in one go; then the thread's other sessions have their turn.
inline constexpr std::size_t kAnswersPerTurnMax = 64;

/// What is kept of a client that has not said who it is; a hello has at most some 5 KiB.
inline constexpr std::size_t kHelloBytesMax = std::size_t{8} << 10U;

struct SessionTimeouts {
    std::chrono::milliseconds hello{10'000};  ///< connected, and no ClientHello yet
    std::chrono::milliseconds stall{30'000};  ///< a frame begun and not ended; a write that stands
    std::chrono::milliseconds ping{30'000};   ///< silent: asked whether it is still there
    std::chrono::milliseconds idle{60'000};   ///< silent for so long: gone
};

/// What all sessions of a server share; outlives them, and is used from any thread.
struct SessionContext {
    ChunkService* service = nullptr;
    ServerHello hello;
    std::string world_file;  ///< canonical
    SessionTimeouts timeouts;
    SessionCaps caps = {};  ///< of every session; `hello.limits` is made of them
    /// Asked at each ClientHello what this client may do, or why it may not come in; empty:
    /// everybody may, with `caps`.
    std::function<Result<SessionCaps>(const ClientHello&)> admit = {};
    const Log* requests_log = nullptr;  ///< gets a line a request and a Failure, if not null
    std::atomic<std::uint64_t>* next_request_id = nullptr;  ///< of all ways in; goes with it
};

/// Where a session comes from.
struct SessionOrigin {
    std::uint64_t id = 0;    ///< the connection's; stands in logs
    std::string token = {};  ///< shown to the transport already, for a ClientHello without one
};

/// All calls on one thread, the session's. Made by `std::make_shared`.
class Session : public std::enable_shared_from_this<Session> {
  public:
    using Clock = std::chrono::steady_clock;
    /// Runs a function on the session's thread, some time later; callable from any thread.
    using Post = std::function<void(std::function<void()>)>;

    /// `context` outlives the session.
    Session(const SessionContext& context, Post post, Clock::time_point now,
            SessionOrigin origin = {});

    /// Bytes from the client. All of them are kept, so call it only while `wants_input`.
    void receive(std::span<const std::byte> bytes, Clock::time_point now);
    /// The first bytes of the outbox have been written.
    void written(std::size_t size_bytes, Clock::time_point now);
    /// Looks at the deadlines, and goes on with what had to wait; about once a second, and at
    /// `wake_at`.
    void tick(Clock::time_point now);

    /// When there is something to send that the client's rate, or a busy service, holds back now:
    /// the time to call `tick`. Nothing if only events are waited for.
    std::optional<Clock::time_point> wake_at() const { return wake_at_; }

    /// Says Goodbye{draining}; takes no new requests, answers what is under way, then closes.
    void drain();
    /// The connection is gone: cancels what it waits for. Only the destructor may follow.
    void end();

    const Outbox& outbox() const { return outbox_; }

    bool wants_input() const;

    /// Nothing more will come: write what is left, then close.
    bool is_closing() const { return stage_ == Stage::closing; }

    /// Close at once, whatever is left.
    bool is_dead() const { return stage_ == Stage::dead; }

    /// Who it says it is; for logs.
    const std::string& client_name() const { return client_name_; }

    /// Bytes of the view's payloads that were sent and not credited.
    std::size_t uncredited_bytes() const { return uncredited_bytes_; }

    /// Why the session closes, for logs; empty for a client that just left.
    const std::string& close_reason() const { return close_reason_; }

  private:
    enum class Stage : std::uint8_t { hello, open, finishing, closing, dead };

    struct Rank {
        std::int64_t urgency = 0;  ///< the priority negated
        std::uint64_t sequence = 0;

        friend auto operator<=>(const Rank&, const Rank&) = default;
    };

    /// One key or column that has no answer yet.
    struct Wish {
        std::uint32_t request_id = 0;  ///< 0: the view's
        WorkKey key;
        Hash128 known_etag;         ///< zero: none
        std::int32_t priority = 0;  ///< as the service takes it
        Rank rank;                  ///< given by `add`
        std::uint64_t number = 0;   ///< of its request, in the log; the view has its own

        bool is_of_view() const { return request_id == 0; }
    };

    void process(Clock::time_point now);
    void handle(const AnyMessage& message);
    void handle_one(const ClientHello& hello);
    void handle_one(const ChunkRequest& request);
    void handle_one(const ChunkCancel& cancel);
    void handle_one(const ColumnQuery& query);
    void handle_one(const WorldQuery& query);
    void handle_one(const ViewUpdate& update);
    void handle_one(const Credit& credit);
    void handle_one(const Ping& ping);
    void handle_one(const Pong& pong);
    void handle_one(const Goodbye& goodbye);
    /// Every other kind is a server's to send.
    template <typename Other>
    void handle_one(const Other& other);

    bool takes_request(std::uint32_t request_id, std::uint64_t number);
    void add(Wish wish);
    void submit();
    bool has_room() const;
    Result<std::optional<Answer>> ask(Wish wish);
    bool submit_request();
    void deliver(WaiterId waiter, const Result<Answer>& result);
    void go_on_later();

    bool view_has_credit() const;
    View* view_to_ask();
    View* view_if_next();
    bool submit_of_view(View& view);
    void answer_of_view(View& view, const Wish& wish, const Result<Answer>& result);
    bool has_room_for(const ServedChunk& served) const;
    void drop_unwanted(View& view, bool all);
    void tell_forgotten();
    void end_view();
    void set_rate();

    void answer(const Wish& wish, const Result<Answer>& result);
    void answer_chunk(const Wish& wish, const ServedChunk& served);
    void answer_column(const Wish& wish, const ServedColumn& column);
    void fail_wish(const Wish& wish, Error error);
    void fail_request(std::uint32_t request_id, Error error, std::uint64_t number = 0);

    std::uint64_t number_of(const Wish& wish) const {
        return wish.is_of_view() ? view_number_ : wish.number;
    }

    void send_failure(std::uint64_t number, const Failure& failure);
    void close_with(Error error);
    void send(const AnyMessage& message, SharedBytes payload = nullptr,
              std::optional<ChunkPos> of_view = std::nullopt);
    void finish_if_done();

    const SessionContext& context_;
    const Post post_;
    const FlowId flow_;
    const std::string token_;  ///< shown before the hello
    RequestLog log_;
    SessionCaps caps_;
    Stage stage_ = Stage::hello;
    FrameReader reader_{kInboundFrameLimits};
    Outbox outbox_;
    std::map<Rank, Wish> waiting_;
    std::unordered_map<WaiterId, Wish> under_way_;
    std::uint64_t next_sequence_ = 0;
    std::size_t expected_bytes_ = 4096;  ///< mean of the answers so far; the start is a guess
    bool goes_on_later_ = false;         ///< `submit` has been posted
    std::optional<View> view_;
    ViewUpdate last_update_;         ///< without its radii
    std::uint64_t view_number_ = 0;  ///< of the last ViewUpdate, in the log
    std::size_t view_under_way_ = 0;
    std::size_t uncredited_bytes_ = 0;
    bool is_stalled_ = false;  ///< its next wish waits for credit
    bool view_waits_ = false;  ///< its last wish found no room: until something changes
    std::optional<Clock::time_point> view_retry_at_;  ///< the service was busy
    TokenBucket byte_rate_;
    TokenBucket request_rate_;
    Clock::time_point now_;  ///< the last that we were told
    std::optional<Clock::time_point> wake_at_;
    std::string client_name_;
    std::string close_reason_;
    const Clock::time_point connected_;
    Clock::time_point last_sign_;   ///< of life: it sent something, or read what we sent
    Clock::time_point last_frame_;  ///< ended, or the next one's first bytes
    std::optional<Clock::time_point> write_waits_since_;
    std::optional<Clock::time_point> ping_sent_;  ///< and no answer yet
    bool only_ping_waits_ = false;                ///< the outbox holds our ping and nothing else
};

}  // namespace terrane
