#include "server/net/session.h"

#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/frame.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"
#include "server/net/outbox.h"
#include "server/net/session_caps.h"
#include "server/net/token_bucket.h"

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>

namespace terrane {

namespace {

TokenBucket request_rate_of(const SessionCaps& caps, Session::Clock::time_point now) {
    return {static_cast<double>(caps.requests_per_second_max),
            static_cast<double>(caps.requests_per_second_max), now};
}

}  // namespace

Session::Session(const SessionContext& context, Post post, Clock::time_point now,
                 SessionOrigin origin)
    : context_(context),
      post_(std::move(post)),
      flow_(context.service->new_flow_id()),
      token_(std::move(origin.token)),
      log_(context.requests_log, context.next_request_id, origin.id),
      caps_(clamped(context.caps)),
      byte_rate_(0, 0, now),
      request_rate_(request_rate_of(caps_, now)),
      now_(now),
      connected_(now),
      last_sign_(now),
      last_frame_(now) {
    set_rate();
}

void Session::receive(std::span<const std::byte> bytes, Clock::time_point now) {
    now_ = now;
    last_sign_ = now;
    ping_sent_.reset();
    if (reader_.buffered_bytes() == 0) {
        last_frame_ = now;
    }
    reader_.feed(bytes);
    process(now);
    if (stage_ == Stage::hello && reader_.buffered_bytes() > kHelloBytesMax) {
        close_with(
            {.code = ErrorCode::too_large,
             .message = "a ClientHello has at most " + std::to_string(kHelloBytesMax) + " bytes"});
    }
}

void Session::written(std::size_t size_bytes, Clock::time_point now) {
    now_ = now;
    write_waits_since_.reset();
    const bool wanted_input = wants_input();
    outbox_.consume(size_bytes);
    // Who reads is there. But that our ping alone went out says nothing.
    if (!only_ping_waits_) {
        last_sign_ = now;
    }
    only_ping_waits_ = only_ping_waits_ && !outbox_.empty();
    if (!wanted_input && wants_input()) {  // until now the client was not listened to
        last_frame_ = now;
        ping_sent_.reset();
    }
    submit();
    process(now);
}

bool Session::wants_input() const {
    return (stage_ == Stage::hello || stage_ == Stage::open) && !outbox_.full() &&
           !(view_ && view_->has_forgotten());
}

void Session::process(Clock::time_point now) {
    while (wants_input()) {
        const auto next = reader_.next();
        if (!next) {
            close_with(next.error());
            return;
        }
        const std::optional<Frame>& frame = *next;
        if (!frame) {
            return;
        }
        last_frame_ = now;
        const auto message = decode_message(*frame);
        if (message) {
            handle(*message);
        } else if (message.error().code == ErrorCode::malformed || stage_ == Stage::hello) {
            close_with(message.error());
        } else {
            fail_request(request_id_of(*frame), message.error());
        }
    }
}

void Session::handle(const AnyMessage& message) {
    const bool is_hello = std::holds_alternative<ClientHello>(message);
    if (is_hello != (stage_ == Stage::hello)) {
        const std::string name(name_of(message));
        close_with({.code = ErrorCode::malformed,
                    .message = is_hello ? "ClientHello comes once"
                                        : "ClientHello comes first, not " + name});
        return;
    }
    std::visit([this](const auto& body) { handle_one(body); }, message);
}

void Session::handle_one(const ClientHello& hello) {
    client_name_ = hello.client_name;
    if (hello.protocol_version != kProtocolVersion) {
        close_with({.code = ErrorCode::version_mismatch,
                    .message = "protocol version " + std::to_string(hello.protocol_version) +
                               ": this server speaks " + std::to_string(kProtocolVersion)});
        return;
    }
    if (context_.admit) {
        ClientHello shown = hello;
        shown.token = hello.token.empty() ? token_ : hello.token;
        const auto caps = context_.admit(shown);
        if (!caps) {
            close_with(caps.error());
            return;
        }
        caps_ = clamped(*caps);
        request_rate_ = request_rate_of(caps_, now_);
        set_rate();
    }
    stage_ = Stage::open;
    ServerHello answer = context_.hello;
    answer.limits = limits_of(caps_);
    send(answer);
}

void Session::handle_one(const Ping& ping) {
    send(Pong{.nonce = ping.nonce});
}

void Session::handle_one(const Pong&) {}  // that it came is all that matters

void Session::handle_one(const Goodbye&) {
    stage_ = Stage::dead;
}

template <typename Other>
void Session::handle_one(const Other& other) {
    close_with({.code = ErrorCode::malformed,
                .message = std::string(name_of(AnyMessage(other))) + " is a server's to send"});
}

void Session::close_with(Error error) {
    close_reason_ = std::string(to_string(error.code)) + ": " + error.message;
    fail_request(0, std::move(error));
    stage_ = Stage::closing;
}

void Session::send(const AnyMessage& message, SharedBytes payload,
                   std::optional<ChunkPos> of_view) {
    if (stage_ != Stage::closing && stage_ != Stage::dead) {
        only_ping_waits_ = only_ping_waits_ && outbox_.empty();
        const std::size_t before_bytes = outbox_.bytes();
        outbox_.push(encode_message(message), std::move(payload), of_view);
        byte_rate_.take(static_cast<double>(outbox_.bytes() - before_bytes));
    }
}

void Session::tick(Clock::time_point now) {
    now_ = now;
    submit();
    const SessionTimeouts& limits = context_.timeouts;
    if (outbox_.empty()) {
        write_waits_since_.reset();
    } else if (!write_waits_since_) {
        write_waits_since_ = now;
    } else if (now - *write_waits_since_ > limits.stall) {
        close_reason_ = "the client does not read";
        stage_ = Stage::dead;
        return;
    }
    if (!wants_input()) {
        return;
    }
    if (stage_ == Stage::hello && now - connected_ > limits.hello) {
        close_with({.code = ErrorCode::malformed, .message = "no ClientHello in time"});
    } else if (reader_.buffered_bytes() > 0 && now - last_frame_ > limits.stall) {
        close_with({.code = ErrorCode::malformed, .message = "a frame was not ended in time"});
    } else if (ping_sent_ && now - last_sign_ > limits.idle &&
               now - *ping_sent_ > limits.idle - limits.ping && under_way_.empty()) {
        close_reason_ = "silent for too long";
        send(Goodbye{.code = std::nullopt, .reason = close_reason_});
        stage_ = Stage::closing;
    } else if (now - last_sign_ > limits.ping && !ping_sent_ && stage_ == Stage::open) {
        ping_sent_ = now;
        only_ping_waits_ = outbox_.empty();
        send(Ping{.nonce = next_sequence_});
    }
}

void Session::drain() {
    if (stage_ == Stage::hello || stage_ == Stage::open) {
        close_reason_ = "the server is shutting down";
        end_view();
        send(Goodbye{.code = ErrorCode::draining, .reason = close_reason_});
        stage_ = Stage::finishing;
        submit();
    }
}

void Session::finish_if_done() {
    if (stage_ == Stage::finishing && waiting_.empty() && under_way_.empty()) {
        stage_ = Stage::closing;
    }
}

void Session::end() {
    for (const auto& [waiter, wish] : under_way_) {
        context_.service->cancel(wish.key, waiter);
    }
    under_way_.clear();
    waiting_.clear();
    view_under_way_ = 0;
    view_.reset();
    log_.end_all();
    stage_ = Stage::dead;
}

}  // namespace terrane
