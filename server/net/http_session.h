// One HTTP/1.1 connection without a socket: requests in, answers out, one at a time.
//
//     idle ──first byte──> reading ──whole──> answering ──answer──> idle, or closing
//
// A client above its requests a second gets 429; one above its bytes a second is read again when
// they have come back.
//
// A client may say that it sends no more (a half-close): what it has sent is answered, then the
// connection closes. That looks like a client that has gone, until something is sent to it: so one
// that waits for an answer is told "100 Continue" (not in HTTP/1.0, which knows no such thing). Who
// has gone resets the connection, which ends the session and takes the question back.
//
// The router makes the answers. One that it gives at once is written in the same step, by gather
// write: the head is made here, the body is shared with the cache. One that comes later is posted
// to the session's thread. Pipelined requests wait in the reader.
#pragma once

#include "server/http/router.h"
#include "server/log.h"
#include "server/net/byte_protocol.h"
#include "server/net/http_reader.h"
#include "server/net/token_bucket.h"

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

namespace terrane {

struct HttpTimeouts {
    std::chrono::milliseconds header{10'000};  ///< from a request's first byte to its last header
    std::chrono::milliseconds stall{30'000};   ///< a body not ended; a write that stands
    std::chrono::milliseconds keep_alive{60'000};  ///< between two requests
};

/// Only ever rise; any thread.
struct HttpCounters {
    std::atomic<std::uint64_t> requests{0};
    std::array<std::atomic<std::uint64_t>, 6> by_class{};  ///< answers; [4]: status 400 to 499
    std::atomic<std::uint64_t> not_modified{0};
    std::atomic<std::uint64_t> limited{0};  ///< refused at the connection's rate of requests
};

/// Makes the protocol that follows an upgrade to WebSocket at `path`. `request` is the one that
/// asked for it; `rest` are bytes that came behind it.
struct WebSocketUpgrade {
    std::string path;
    std::function<std::shared_ptr<ByteProtocol>(const ReceivedRequest& request, Bytes rest,
                                                ConnectionPost post,
                                                ByteProtocol::Clock::time_point now)>
        make;
};

/// What one connection may take; 0: no cap.
struct HttpRates {
    std::uint32_t requests_per_second_max = 0;
    std::uint64_t bytes_per_second_max = 0;
};

/// What all HTTP sessions share; outlives them, and is used from any thread.
struct HttpContext {
    const Router* router = nullptr;
    HttpCounters* counters = nullptr;
    std::atomic<std::uint64_t>* next_request_id = nullptr;
    std::function<std::uint64_t()> new_flow;  ///< of a connection, for the service
    HttpTimeouts timeouts;
    WebSocketUpgrade websocket;
    const Log* requests_log = nullptr;  ///< gets a line a request, if not null
    /// Asked what the bearer of a token may take, when a connection shows another than before: it
    /// keeps these caps while it shows the same one. Empty: no caps.
    std::function<HttpRates(std::string_view token)> rates_of = {};
};

/// The head of an answer, up to and with the empty line: status, headers that all answers have, and
/// those that this one has. `date` is an IMF-fixdate.
Bytes http_head(const HttpResponse& response, std::uint64_t request_id, bool keep_alive,
                std::string_view date);

/// "Sun, 06 Nov 1994 08:49:37 GMT", for now; made once a second.
std::string_view http_date(std::chrono::system_clock::time_point now);

class HttpSession final : public ByteProtocol, public std::enable_shared_from_this<HttpSession> {
  public:
    /// `context` outlives the session. Made by `std::make_shared`.
    HttpSession(const HttpContext& context, ConnectionOrigin origin, ConnectionPost post,
                Clock::time_point now);

    void receive(std::span<const std::byte> bytes, Clock::time_point now) override;
    void input_ended() override;
    std::size_t gather(Outbox::Gather& out) override;
    void written(std::size_t size_bytes, Clock::time_point now) override;
    void tick(Clock::time_point now) override;
    void drain() override;
    void end() override;
    bool wants_input() const override;
    bool is_closing() const override;
    bool is_dead() const override;

    std::optional<Clock::time_point> wake_at() const override { return wake_at_; }

    std::string client_name() const override;
    std::string close_reason() const override;
    std::shared_ptr<ByteProtocol> take_successor() override;

  private:
    /// The request that is being answered.
    struct Asked {
        std::uint64_t id = 0;
        bool keep_alive = true;
        bool is_http_1_0 = false;
        bool is_head = false;
        Clock::time_point since;
        std::string method;  ///< this and the path: for the log
        std::string path;
    };

    void process(Clock::time_point now);
    void dispatch(ReceivedRequest& received, Clock::time_point now);
    void keep_to_rates_of(const HttpRequest& request);
    bool takes_request();
    HttpRespond later(std::uint64_t id);
    void probe();
    void answer(HttpResponse response);
    void log_answer(const Asked& asked, unsigned status, std::size_t body_bytes) const;
    void refuse(const HttpFault& fault);
    void close_with(std::string reason);
    bool upgrades(const ReceivedRequest& received);

    const HttpContext& context_;
    const ConnectionOrigin origin_;
    const ConnectionPost post_;
    const std::uint64_t flow_;
    HttpReader reader_;
    Outbox outbox_;
    std::stop_source stop_;
    std::optional<Asked> asked_;  ///< the request that has no answer yet
    std::optional<ReceivedRequest> upgrade_;
    bool draining_ = false;
    bool input_ended_ = false;
    bool closing_ = false;
    bool dead_ = false;
    std::string close_reason_;
    Clock::time_point idle_since_;     ///< connected, or the last answer was written
    Clock::time_point request_since_;  ///< its first byte came
    bool had_request_ = false;
    std::optional<Clock::time_point> write_waits_since_;
    std::optional<std::string> token_;  ///< the last that was shown; empty: none was
    HttpRates rates_;
    TokenBucket request_rate_;
    TokenBucket byte_rate_;
    std::optional<Clock::time_point> wake_at_;  ///< requests wait for the byte rate until then
};

/// `context` outlives what the factory makes.
ProtocolFactory http_protocol(const HttpContext& context);

}  // namespace terrane
