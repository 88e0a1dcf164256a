#include "client-sample/cpp/program/carrier.h"

#include "client-sample/cpp/program/http_carrier.h"
#include "client-sample/cpp/program/websocket_stream.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "protocol/wire/frame.h"
#include "protocol/wire/messages.h"

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

namespace terrane {

namespace {

class TcpCarrier final : public Carrier {
  public:
    Bytes opening() override { return {}; }

    Bytes wrap(const AnyMessage& message) override { return encode_message(message); }

    Result<void> feed(std::span<const std::byte> bytes) override {
        reader_.feed(bytes);
        return {};
    }

    Result<std::optional<IncomingMessage>> next() override { return next_message(reader_); }

  private:
    FrameReader reader_{kOutboundFrameLimits};
};

/// A WebSocket message is a frame of the protocol, so the bytes inside are the same stream.
class WebSocketCarrier final : public Carrier {
  public:
    explicit WebSocketCarrier(const CarrierAddress& address)
        : stream_({.host = address.host + ":" + std::to_string(address.port),
                   .path = "/ws",
                   .seed = address.seed}) {}

    Bytes opening() override { return stream_.opening(); }

    Bytes wrap(const AnyMessage& message) override { return stream_.wrap(encode_message(message)); }

    Result<void> feed(std::span<const std::byte> bytes) override {
        unwrapped_.clear();
        if (const auto fed = stream_.feed(unwrapped_, bytes); !fed) {
            return fed;
        }
        reader_.feed(unwrapped_);
        return {};
    }

    Result<std::optional<IncomingMessage>> next() override { return next_message(reader_); }

    Bytes take_reply() override { return stream_.take_reply(); }

  private:
    WebSocketStream stream_;
    Bytes unwrapped_;
    FrameReader reader_{kOutboundFrameLimits};
};

}  // namespace

std::unique_ptr<Carrier> make_carrier(CarrierKind kind, const CarrierAddress& address) {
    if (kind == CarrierKind::tcp) {
        return std::make_unique<TcpCarrier>();
    }
    if (kind == CarrierKind::http) {
        return std::make_unique<HttpCarrier>(address);
    }
    return std::make_unique<WebSocketCarrier>(address);
}

}  // namespace terrane
