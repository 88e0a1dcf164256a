#include "server/net/websocket_protocol.h"

#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/result.h"
#include "server/net/byte_protocol.h"
#include "server/net/http_reader.h"
#include "server/net/http_session.h"
#include "server/net/outbox.h"
#include "server/net/session.h"
#include "server/net/tokens.h"
#include "server/net/websocket_frames.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace terrane {

namespace {

constexpr std::size_t kLengthBytes = 4;  ///< a native message's prefix
/// Our own frames that wait; a ping beyond gets no pong (section 5.5.3 lets one answer several).
constexpr std::size_t kControlQueueMax = 4;

Bytes control_frame(WebSocketOpcode opcode, std::span<const std::byte> payload) {
    std::array<std::byte, kServerFrameHeadMax> head{};
    const std::size_t size = write_frame_head(head, opcode, payload.size());
    Bytes out(head.begin(), head.begin() + static_cast<std::ptrdiff_t>(size));
    out.insert(out.end(), payload.begin(), payload.end());
    return out;
}

Bytes close_frame(WebSocketCloseCode code, std::string_view reason) {
    const auto number = static_cast<std::uint16_t>(code);
    Bytes payload = {static_cast<std::byte>(number >> 8U), static_cast<std::byte>(number & 0xFFU)};
    const auto text = bytes_of(reason.substr(0, kControlPayloadMax - payload.size()));
    payload.insert(payload.end(), text.begin(), text.end());
    return control_frame(WebSocketOpcode::close, payload);
}

class WebSocketProtocol final : public ByteProtocol {
  public:
    WebSocketProtocol(std::shared_ptr<Session> session, std::string_view handshake)
        : session_(std::move(session)) {
        const auto bytes = bytes_of(handshake);
        control_.emplace_back(bytes.begin(), bytes.end());
    }

    void receive(std::span<const std::byte> bytes, Clock::time_point now) override {
        Bytes data;
        std::vector<WebSocketControl> controls;
        const auto outcome = reader_.feed(data, controls, bytes);
        if (!data.empty() && !closing_) {
            session_->receive(data, now);
        }
        for (const WebSocketControl& control : controls) {
            handle(control);
        }
        if (!outcome) {
            close_with(outcome.error().code == ErrorCode::unsupported
                           ? WebSocketCloseCode::unsupported_data
                           : WebSocketCloseCode::protocol_error,
                       outcome.error());
        }
        hold_begun_message();
    }

    void input_ended() override { dead_ = true; }

    /// The rest of the message under way, then control frames, then messages that begin: in this
    /// order also when frames are added before the bytes are written, so the plan is kept.
    std::size_t gather(Outbox::Gather& out) override {
        plan_.clear();
        new_heads_.clear();
        std::size_t count = 0;
        const auto add = [&](Piece piece, std::span<const std::byte> bytes,
                             std::uint64_t message_bytes = 0) {
            plan_.push_back(
                {.piece = piece, .size_bytes = bytes.size(), .message_bytes = message_bytes});
            out[count++] = bytes;
        };
        Outbox::Gather parts;
        const std::size_t part_count = session_->outbox().gather(parts);
        if (head_written_ < head_.size) {
            add(Piece::head, head_.rest(head_written_));
        }
        std::uint64_t left = message_left_;
        bool controls_are_due = true;
        for (std::size_t i = 0; i < part_count; ++i) {
            std::span<const std::byte> part = parts[i];
            while (!part.empty()) {
                if (left == 0 && controls_are_due) {
                    add_controls(out, count);
                    controls_are_due = false;
                }
                if (count + 2 > out.size() || (left == 0 && close_queued_)) {
                    return count;
                }
                if (left == 0) {
                    left = message_bytes(part);
                    new_heads_.push_back(head_of(left));
                    add(Piece::new_head, new_heads_.back().rest(0), left);
                }
                const auto taken = part.first(
                    static_cast<std::size_t>(std::min<std::uint64_t>(part.size(), left)));
                add(Piece::message, taken);
                left -= taken.size();
                part = part.subspan(taken.size());
            }
        }
        if (controls_are_due && left == 0) {
            add_controls(out, count);
        }
        return count;
    }

    void written(std::size_t size_bytes, Clock::time_point now) override {
        std::size_t of_session = 0;
        for (const Planned& planned : plan_) {
            const std::size_t taken = std::min(size_bytes, planned.size_bytes);
            size_bytes -= taken;
            if (taken == 0) {
                break;
            }
            switch (planned.piece) {
                case Piece::control:
                    control_written_ += taken;
                    if (control_written_ == control_.front().size()) {
                        control_.pop_front();
                        control_written_ = 0;
                    }
                    break;
                case Piece::head:
                    head_written_ += taken;
                    break;
                case Piece::new_head:
                    message_left_ = planned.message_bytes;
                    head_ = head_of(message_left_);
                    head_written_ = taken;
                    break;
                case Piece::message:
                    message_left_ -= taken;
                    of_session += taken;
                    break;
            }
        }
        TERRANE_ASSERT(size_bytes == 0);
        plan_.clear();
        if (of_session > 0) {
            session_->written(of_session, now);
        }
        after_step();
        hold_begun_message();
    }

    void tick(Clock::time_point now) override {
        session_->tick(now);
        after_step();
    }

    std::optional<Clock::time_point> wake_at() const override { return session_->wake_at(); }

    void drain() override {
        draining_ = true;
        session_->drain();
        after_step();
    }

    void end() override { session_->end(); }

    bool wants_input() const override { return !closing_ && session_->wants_input(); }

    bool is_closing() const override { return close_queued_; }

    bool is_dead() const override { return dead_ || session_->is_dead(); }

    std::string client_name() const override { return session_->client_name(); }

    std::string close_reason() const override {
        return close_reason_.empty() ? session_->close_reason() : close_reason_;
    }

  private:
    struct Head {
        std::array<std::byte, kServerFrameHeadMax> bytes{};
        std::size_t size = 0;

        std::span<const std::byte> rest(std::size_t written) const {
            return std::span(bytes).first(size).subspan(written);
        }
    };

    enum class Piece : std::uint8_t { control, head, new_head, message };

    struct Planned {
        Piece piece = Piece::control;
        std::size_t size_bytes = 0;
        std::uint64_t message_bytes = 0;  ///< of the message that a new head begins
    };

    static Head head_of(std::uint64_t message_bytes) {
        Head head;
        head.size = write_frame_head(head.bytes, WebSocketOpcode::binary, message_bytes);
        return head;
    }

    /// Its own first bytes tell its length.
    static std::uint64_t message_bytes(std::span<const std::byte> part) {
        TERRANE_ASSERT(part.size() >= kLengthBytes);
        std::uint32_t length = 0;
        std::memcpy(&length, part.data(), kLengthBytes);
        return std::uint64_t{length} + kLengthBytes;
    }

    void add_controls(Outbox::Gather& out, std::size_t& count) {
        std::size_t skip = control_written_;
        for (const Bytes& frame : control_) {
            if (count == out.size()) {
                return;
            }
            const auto bytes = std::span(frame).subspan(std::exchange(skip, 0));
            plan_.push_back(
                {.piece = Piece::control, .size_bytes = bytes.size(), .message_bytes = 0});
            out[count++] = bytes;
        }
    }

    /// The client has been told how long the message under way is, so its session must not take it
    /// back: what is gathered stays.
    void hold_begun_message() {
        if (message_left_ > 0) {
            Outbox::Gather parts;
            session_->outbox().gather(parts);
        }
    }

    void handle(const WebSocketControl& control) {
        if (closing_) {
            return;
        }
        const auto payload = std::span(control.payload).first(control.size_bytes);
        if (control.opcode == WebSocketOpcode::ping) {
            if (control_.size() < kControlQueueMax) {
                control_.push_back(control_frame(WebSocketOpcode::pong, payload));
            }
        } else if (control.opcode == WebSocketOpcode::close) {
            // Its code comes back, and what has not been written is not wanted.
            closing_ = true;
            queue_close(control_frame(WebSocketOpcode::close,
                                      payload.first(std::min<std::size_t>(payload.size(), 2))));
        }
    }

    void close_with(WebSocketCloseCode code, const Error& error) {
        close_reason_ = std::string(to_string(ErrorCode::malformed)) + ": " + error.message;
        closing_ = true;
        queue_close(close_frame(code, error.message));
    }

    void queue_close(Bytes frame) {
        if (!close_queued_) {
            close_queued_ = true;
            control_.push_back(std::move(frame));
        }
    }

    /// When the session has said its last word, a close frame follows it.
    void after_step() {
        if (session_->is_closing() && session_->outbox().empty() && !close_queued_) {
            closing_ = true;
            const std::string& reason = session_->close_reason();
            const bool is_leaving = draining_ || reason.starts_with("silent");
            queue_close(close_frame(reason.empty() ? WebSocketCloseCode::normal
                                    : is_leaving   ? WebSocketCloseCode::going_away
                                                   : WebSocketCloseCode::policy_violation,
                                    reason));
        }
    }

    std::shared_ptr<Session> session_;

    WebSocketReader reader_;
    std::deque<Bytes> control_;  ///< frames of our own: the handshake's answer, pongs, a close
    std::size_t control_written_ = 0;  ///< of the first
    Head head_;                        ///< of the message under way
    std::size_t head_written_ = 0;
    std::uint64_t message_left_ = 0;  ///< of the message under way
    std::vector<Planned> plan_;       ///< what the last `gather` gave out
    std::deque<Head> new_heads_;      ///< of the messages that it begins
    bool closing_ = false;            ///< nothing more is taken from the client
    bool close_queued_ = false;       ///< nothing follows `control_`
    bool draining_ = false;
    bool dead_ = false;
    std::string close_reason_;
};

}  // namespace

std::string websocket_handshake(std::string_view key) {
    return "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
           "Sec-WebSocket-Accept: " +
           websocket_accept(key) + "\r\n\r\n";
}

WebSocketUpgrade websocket_upgrade(const SessionContext& context) {
    return {.path = std::string(kWebSocketPath),
            .make = [&context](const ReceivedRequest& request, Bytes rest, ConnectionPost post,
                               ByteProtocol::Clock::time_point now) {
                auto protocol = std::make_shared<WebSocketProtocol>(
                    std::make_shared<Session>(
                        context, std::move(post), now,
                        SessionOrigin{.id = request.request.session,
                                      .token = token_of(request.request.authorization,
                                                        request.request.query)}),
                    websocket_handshake(request.websocket_key));
                protocol->receive(rest, now);
                return protocol;
            }};
}

}  // namespace terrane
