#include "server/net/native_protocol.h"

#include "server/net/byte_protocol.h"
#include "server/net/outbox.h"
#include "server/net/session.h"

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

namespace terrane {

namespace {

class NativeProtocol final : public ByteProtocol {
  public:
    explicit NativeProtocol(std::shared_ptr<Session> session) : session_(std::move(session)) {}

    void receive(std::span<const std::byte> bytes, Clock::time_point now) override {
        session_->receive(bytes, now);
    }

    /// Waiting for answers means reading: who has stopped sending has left.
    void input_ended() override { ended_ = true; }

    std::size_t gather(Outbox::Gather& out) override { return session_->outbox().gather(out); }

    void written(std::size_t size_bytes, Clock::time_point now) override {
        session_->written(size_bytes, now);
    }

    void tick(Clock::time_point now) override { session_->tick(now); }

    std::optional<Clock::time_point> wake_at() const override { return session_->wake_at(); }

    void drain() override { session_->drain(); }

    void end() override { session_->end(); }

    bool wants_input() const override { return session_->wants_input(); }

    bool is_closing() const override { return session_->is_closing(); }

    bool is_dead() const override { return ended_ || session_->is_dead(); }

    std::string client_name() const override { return session_->client_name(); }

    std::string close_reason() const override { return session_->close_reason(); }

  private:
    std::shared_ptr<Session> session_;
    bool ended_ = false;
};

}  // namespace

ProtocolFactory native_protocol(const SessionContext& context) {
    return [&context](const ConnectionOrigin& origin, ConnectionPost post,
                      ByteProtocol::Clock::time_point now) {
        return std::make_shared<NativeProtocol>(std::make_shared<Session>(
            context, std::move(post), now, SessionOrigin{.id = origin.id}));
    };
}

}  // namespace terrane
