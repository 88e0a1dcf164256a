#include "server/net/http_session.h"

#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "server/http/http_message.h"
#include "server/http/problem.h"
#include "server/net/byte_protocol.h"
#include "server/net/http_reader.h"
#include "server/net/tokens.h"
#include "server/net/websocket_frames.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace terrane {

namespace {

constexpr std::size_t kHeadBytes = 512;  ///< of an ordinary answer, with room to spare
/// Pipelined requests that wait while one is answered.
constexpr std::size_t kWaitingBytesMax = kHttpHeaderBytesMax;

/// What every answer says.
constexpr std::string_view kCommonHeaders =
    "Server: terrane\r\n"
    "Access-Control-Allow-Origin: *\r\n"
    "Access-Control-Expose-Headers: *\r\n";
/// What the answer to OPTIONS says besides.
constexpr std::string_view kPreflightHeaders =
    "Access-Control-Allow-Methods: GET, HEAD, OPTIONS\r\n"
    "Access-Control-Allow-Headers: Authorization, If-None-Match\r\n"
    "Access-Control-Max-Age: 86400\r\n";

/// Says nothing, but a client that has gone answers it with a reset (RFC 9110, 15.2: a client reads
/// over what it did not expect).
Bytes probe_bytes() {
    const auto text = bytes_of("HTTP/1.1 100 Continue\r\n\r\n");
    return {text.begin(), text.end()};
}

std::string_view cache_header(HttpCaching caching) {
    switch (caching) {
        case HttpCaching::immutable:
            return "Cache-Control: public, max-age=31536000, immutable\r\n";
        case HttpCaching::revalidate:
            return "Cache-Control: no-cache\r\n";
        case HttpCaching::none:
            return "Cache-Control: no-store\r\n";
    }
    return {};
}

/// Appends text to bytes: a plain copy each, because a head is made for every request.
class HeadWriter {
  public:
    HeadWriter& operator<<(std::string_view text) {
        const std::size_t end = size_ + text.size();
        if (end > out_.size()) {
            out_.resize(2 * end);
        }
        std::ranges::copy(bytes_of(text), out_.begin() + static_cast<std::ptrdiff_t>(size_));
        size_ = end;
        return *this;
    }

    HeadWriter& operator<<(std::uint64_t number) {
        std::array<char, 20> digits{};
        std::size_t first = digits.size();
        do {
            digits[--first] = static_cast<char>('0' + number % 10);
            number /= 10;
        } while (number > 0);
        return *this << std::string_view(digits.data() + first, digits.size() - first);
    }

    /// A header's value may have no line end in it.
    void value(std::string text) {
        std::ranges::replace_if(
            text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
        *this << text;
    }

    Bytes take() {
        out_.resize(size_);
        return std::move(out_);
    }

  private:
    Bytes out_ = Bytes(kHeadBytes);
    std::size_t size_ = 0;
};

}  // namespace

std::string_view http_date(std::chrono::system_clock::time_point now) {
    thread_local std::time_t made_for = 0;
    thread_local std::array<char, 40> text{};
    thread_local std::size_t size = 0;
    const std::time_t seconds = std::chrono::system_clock::to_time_t(now);
    if (size == 0 || seconds != made_for) {
        std::tm parts{};
        gmtime_r(&seconds, &parts);
        size = std::strftime(text.data(), text.size(), "%a, %d %b %Y %H:%M:%S GMT", &parts);
        made_for = seconds;
    }
    return {text.data(), size};
}

Bytes http_head(const HttpResponse& response, std::uint64_t request_id, bool keep_alive,
                std::string_view date) {
    HeadWriter out;
    out << "HTTP/1.1 " << std::uint64_t{response.status} << " " << reason_phrase(response.status)
        << "\r\nDate: " << date << "\r\n"
        << kCommonHeaders << cache_header(response.caching) << "Terrane-Request: " << request_id
        << "\r\n";
    if (response.etag) {
        out << "ETag: \"" << to_hex(*response.etag) << "\"\r\n";
    }
    if (!response.content_type.empty()) {
        out << "Content-Type: " << response.content_type << "\r\n";
    }
    for (const auto& [name, value] : response.headers) {
        out << name << ": ";
        out.value(value);
        out << "\r\n";
    }
    if (response.status == 204) {
        out << kPreflightHeaders;
    } else if (response.status != 304 && response.status != 101) {
        out << "Content-Length: " << std::uint64_t{response.body ? response.body->size() : 0}
            << "\r\n";
    }
    if (!keep_alive) {
        out << "Connection: close\r\n";
    }
    out << "\r\n";
    return out.take();
}

HttpSession::HttpSession(const HttpContext& context, ConnectionOrigin origin, ConnectionPost post,
                         Clock::time_point now)
    : context_(context),
      origin_(std::move(origin)),
      post_(std::move(post)),
      flow_(context.new_flow()),
      idle_since_(now),
      request_since_(now) {}

void HttpSession::receive(std::span<const std::byte> bytes, Clock::time_point now) {
    if (!reader_.is_inside_request()) {
        request_since_ = now;
    }
    reader_.feed(bytes);
    process(now);
}

void HttpSession::process(Clock::time_point now) {
    while (!asked_ && !upgrade_ && !closing_ && !dead_ && !outbox_.full()) {
        if ((draining_ || input_ended_) && !reader_.is_inside_request()) {
            close_with(draining_ ? "the server is shutting down" : "");
            return;
        }
        byte_rate_.refill(now);
        if (!draining_ && !byte_rate_.has()) {
            wake_at_ = byte_rate_.ready_at();
            return;
        }
        auto next = reader_.next();
        if (!next) {
            refuse(next.error());
            return;
        }
        if (!*next) {
            if (input_ended_) {
                close_with({});
            }
            return;
        }
        had_request_ = true;
        request_since_ = now;
        dispatch(**next, now);
    }
}

void HttpSession::dispatch(ReceivedRequest& received, Clock::time_point now) {
    context_.counters->requests.fetch_add(1, std::memory_order_relaxed);
    received.request.id = context_.next_request_id->fetch_add(1, std::memory_order_relaxed);
    received.request.session = origin_.id;
    received.request.flow = flow_;
    received.request.stop = stop_.get_token();
    Asked& asked = asked_.emplace(Asked{.id = received.request.id,
                                        .keep_alive = received.keep_alive && !draining_,
                                        .is_http_1_0 = received.is_http_1_0,
                                        .is_head = received.request.method == "HEAD",
                                        .since = now,
                                        .method = {},
                                        .path = {}});
    if (context_.requests_log != nullptr) {
        asked.method = received.request.method;
        asked.path = received.request.path;
    }
    keep_to_rates_of(received.request);
    request_rate_.refill(now);
    if (!takes_request()) {
        context_.counters->limited.fetch_add(1, std::memory_order_relaxed);
        const std::string most = std::to_string(rates_.requests_per_second_max);
        answer(http_problem({.code = ErrorCode::busy,
                             .message = most + " requests a second are the most for this session"},
                            1000 / rates_.requests_per_second_max + 1));
        return;
    }
    if (received.request.path == context_.websocket.path && context_.websocket.make) {
        if (upgrades(received)) {
            log_answer(asked, 101, 0);
            asked_.reset();
            upgrade_ = std::move(received);
            return;
        }
        HttpResponse refusal =
            http_problem(426, "here the native messages are spoken over WebSocket, version 13");
        refusal.headers = {{"Upgrade", "websocket"}, {"Sec-WebSocket-Version", "13"}};
        answer(std::move(refusal));
        return;
    }
    const auto later_to_this = [this, id = received.request.id] { return later(id); };
    if (auto response = context_.router->handle(received.request, later_to_this)) {
        answer(*std::move(response));
    } else if (input_ended_) {
        probe();
    }
}

/// Finds out whether a client that sends no more still wants its answer. HTTP/1.0 knows no 1xx.
void HttpSession::probe() {
    if (asked_ && !asked_->is_http_1_0) {
        outbox_.push(probe_bytes(), nullptr);
    }
}

/// The way by which the answer to a request comes from another thread, or later.
HttpRespond HttpSession::later(std::uint64_t id) {
    return [weak = weak_from_this(), post = post_, id](HttpResponse response) {
        post([weak, id, response = std::move(response)]() mutable {
            const auto session = weak.lock();
            if (session && session->asked_ && session->asked_->id == id) {
                session->answer(std::move(response));
                session->process(Clock::now());
            }
        });
    };
}

void HttpSession::keep_to_rates_of(const HttpRequest& request) {
    if (!context_.rates_of) {
        return;
    }
    std::string token = token_of(request.authorization, request.query);
    if (token_ == token) {
        return;
    }
    const bool is_first = !token_;
    rates_ = context_.rates_of(token_.emplace(std::move(token)));
    const double requests = rates_.requests_per_second_max;
    const auto bytes = static_cast<double>(rates_.bytes_per_second_max);
    if (is_first) {  // full; but who shows one token after another has one bucket
        request_rate_ = TokenBucket(requests, requests, request_since_);
        byte_rate_ = TokenBucket(bytes, bytes / 4, request_since_);
    } else {
        request_rate_.set(requests, requests);
        byte_rate_.set(bytes, bytes / 4);
    }
}

/// Counts it against the client's rate; false if that is used up.
bool HttpSession::takes_request() {
    if (!request_rate_.has(1 - 1e-9)) {
        return false;
    }
    request_rate_.take(1);
    return true;
}

bool HttpSession::upgrades(const ReceivedRequest& received) {
    return received.request.method == "GET" && received.wants_websocket &&
           is_websocket_key(received.websocket_key) && received.websocket_version == "13" &&
           !draining_;
}

void HttpSession::answer(HttpResponse response) {
    const std::optional<Asked> asked = std::exchange(asked_, std::nullopt);
    TERRANE_ASSERT(asked.has_value());
    HttpCounters& counters = *context_.counters;
    counters.by_class.at(std::min(response.status / 100, 5U))
        .fetch_add(1, std::memory_order_relaxed);
    if (response.status == 304) {
        counters.not_modified.fetch_add(1, std::memory_order_relaxed);
    }
    const bool keep_alive = asked->keep_alive;
    if (asked->is_http_1_0 && keep_alive) {
        response.headers.emplace_back("Connection", "keep-alive");
    }
    const bool has_body = !asked->is_head && response.status != 304;
    const std::size_t before_bytes = outbox_.bytes();
    outbox_.push(
        http_head(response, asked->id, keep_alive, http_date(std::chrono::system_clock::now())),
        has_body ? response.body : nullptr);
    byte_rate_.take(static_cast<double>(outbox_.bytes() - before_bytes));
    log_answer(*asked, response.status, response.body ? response.body->size() : 0);
    if (!keep_alive) {
        close_with({});
    }
}

void HttpSession::log_answer(const Asked& asked, unsigned status, std::size_t body_bytes) const {
    if (context_.requests_log == nullptr) {
        return;
    }
    const auto took =
        std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - asked.since);
    context_.requests_log->debug("http", {{"request", asked.id},
                                          {"session", origin_.id},
                                          {"method", asked.method},
                                          {"path", asked.path},
                                          {"status", std::uint64_t{status}},
                                          {"bytes", std::uint64_t{body_bytes}},
                                          {"us", std::int64_t{took.count()}}});
}

void HttpSession::refuse(const HttpFault& fault) {
    context_.counters->by_class.at(fault.status / 100).fetch_add(1, std::memory_order_relaxed);
    const HttpResponse response = http_problem(fault.status, fault.detail);
    const auto id = context_.next_request_id->fetch_add(1, std::memory_order_relaxed);
    outbox_.push(http_head(response, id, false, http_date(std::chrono::system_clock::now())),
                 response.body);
    if (context_.requests_log != nullptr) {
        context_.requests_log->debug("http", {{"request", id},
                                              {"session", origin_.id},
                                              {"status", std::uint64_t{fault.status}},
                                              {"fault", fault.detail}});
    }
    close_with(std::string(to_string(ErrorCode::malformed)) + ": " + fault.detail);
}

void HttpSession::close_with(std::string reason) {
    closing_ = true;
    close_reason_ = std::move(reason);
}

void HttpSession::input_ended() {
    input_ended_ = true;
    if (asked_) {
        probe();
    } else if (!wake_at_) {
        process(Clock::now());
    }
}

std::size_t HttpSession::gather(Outbox::Gather& out) {
    return outbox_.gather(out);
}

void HttpSession::written(std::size_t size_bytes, Clock::time_point now) {
    outbox_.consume(size_bytes);
    write_waits_since_.reset();
    if (outbox_.empty()) {
        idle_since_ = now;
    }
    process(now);
}

void HttpSession::tick(Clock::time_point now) {
    if (wake_at_ && *wake_at_ <= now) {
        wake_at_.reset();
        process(now);
    }
    if (outbox_.empty()) {
        write_waits_since_.reset();
    } else if (!write_waits_since_) {
        write_waits_since_ = now;
    } else if (now - *write_waits_since_ > context_.timeouts.stall) {
        close_reason_ = "the client does not read";
        dead_ = true;
        return;
    }
    if (closing_ || asked_ || wake_at_ || !outbox_.empty()) {
        return;
    }
    const HttpTimeouts& limits = context_.timeouts;
    if (reader_.is_inside_body()) {
        if (now - request_since_ > limits.stall) {
            refuse({.status = 408, .detail = "the body did not come in time"});
        }
    } else if (reader_.is_inside_request()) {
        if (now - request_since_ > limits.header) {
            refuse({.status = 408, .detail = "the headers did not come in time"});
        }
    } else if (now - idle_since_ > (had_request_ ? limits.keep_alive : limits.header)) {
        close_with({});
    }
}

void HttpSession::drain() {
    draining_ = true;
    if (asked_) {
        asked_->keep_alive = false;
    }
    process(Clock::now());
}

void HttpSession::end() {
    stop_.request_stop();
    asked_.reset();
    dead_ = true;
}

bool HttpSession::wants_input() const {
    return !closing_ && !dead_ && !upgrade_ && !input_ended_ && !outbox_.full() &&
           ((!asked_ && !wake_at_) || reader_.buffered_bytes() < kWaitingBytesMax);
}

bool HttpSession::is_closing() const {
    return closing_;
}

bool HttpSession::is_dead() const {
    return dead_;
}

std::string HttpSession::client_name() const {
    return {};
}

std::string HttpSession::close_reason() const {
    return close_reason_;
}

std::shared_ptr<ByteProtocol> HttpSession::take_successor() {
    if (!outbox_.empty()) {
        return nullptr;
    }
    const std::optional<ReceivedRequest> request = std::exchange(upgrade_, std::nullopt);
    if (!request) {
        return nullptr;
    }
    return context_.websocket.make(*request, reader_.take_rest(), post_, Clock::now());
}

ProtocolFactory http_protocol(const HttpContext& context) {
    return [&context](const ConnectionOrigin& origin, ConnectionPost post,
                      ByteProtocol::Clock::time_point now) {
        return std::make_shared<HttpSession>(context, origin, std::move(post), now);
    };
}

}  // namespace terrane
