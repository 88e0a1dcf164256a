// Native messages over the WebSocket of a whole server.
#include "protocol/wire/frame.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"
#include "server/server.h"
#include "tests/server/http_client.h"
#include "tests/server/raw_client.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <set>
#include <thread>

namespace terrane {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view kUpgrade =
    "Connection: keep-alive, Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

struct Running {
    Running() {
        options.world = load_shipped_world("paper-B2");
        options.listen.endpoint = {.address = "127.0.0.1", .port = 0};
        options.http = Endpoint{.address = "127.0.0.1", .port = 0};
        options.listen.tick = 20ms;
        options.workers = 2;
        options.store = StoreKind::memory;
        auto started = Server::start(options, log);
        if (!started) {
            ADD_FAILURE() << started.error().message;
            std::abort();
        }
        server = *std::move(started);
    }

    std::uint16_t port() const { return server->http_endpoint()->port; }

    ServerOptions options;
    const Log log{LogFormat::text, LogLevel::error};
    std::unique_ptr<Server> server;
};

/// A browser's side of a WebSocket.
class WebSocketClient {
  public:
    explicit WebSocketClient(std::uint16_t port) : http_(port) {
        const auto reply = http_.get("/ws", kUpgrade);
        upgraded_ = reply && reply->status == 101 &&
                    reply->header("sec-websocket-accept") == "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=";
    }

    bool upgraded() const { return upgraded_; }

    void send_frame(unsigned first, std::string_view payload) {
        std::string out(1, static_cast<char>(first));
        if (payload.size() < 126) {
            out += static_cast<char>(0x80U | payload.size());
        } else {
            out += static_cast<char>(0x80U | 126U);
            out += static_cast<char>(payload.size() >> 8U);
            out += static_cast<char>(payload.size() & 0xFFU);
        }
        const std::string mask = "\x11\x22\x33\x44";
        out += mask;
        for (std::size_t i = 0; i < payload.size(); ++i) {
            out += static_cast<char>(payload[i] ^ mask[i % 4]);
        }
        http_.send(out);
    }

    void send(const AnyMessage& message) {
        const Bytes bytes = encode_message(message);
        send_frame(0x82, text_of(bytes));
    }

    struct Frame {
        unsigned first = 0;
        std::string payload;
    };

    std::optional<Frame> next_frame() {
        const std::string head = http_.take(2);
        if (head.size() < 2) {
            return std::nullopt;
        }
        std::size_t size = static_cast<unsigned char>(head[1]);
        if (size >= 126) {
            const std::string extended = http_.take(size == 126 ? 2 : 8);
            size = 0;
            for (const char c : extended) {
                size = (size << 8U) | static_cast<unsigned char>(c);
            }
        }
        return Frame{.first = static_cast<unsigned char>(head[0]), .payload = http_.take(size)};
    }

    /// A binary frame, which must hold one native message and no more.
    std::optional<ReceivedMessage> next() {
        const auto ws = next_frame();
        if (!ws || ws->first != 0x82) {
            return std::nullopt;
        }
        FrameReader reader{kOutboundFrameLimits};
        reader.feed(bytes_of(ws->payload));
        const auto frame = reader.next();
        if (!frame || !*frame) {
            ADD_FAILURE() << "no whole message in a frame of " << ws->payload.size() << " bytes";
            return std::nullopt;
        }
        auto message = decode_message(**frame);
        if (!message) {
            ADD_FAILURE() << message.error().message;
            return std::nullopt;
        }
        const auto payload = (*frame)->payload;
        ReceivedMessage out{.message = *std::move(message),
                            .payload = {payload.begin(), payload.end()}};
        EXPECT_EQ(reader.buffered_bytes(), 0U) << "more than one message in a frame";
        return out;
    }

    bool hello() {
        send(ClientHello{.protocol_version = kProtocolVersion, .client_name = "ws", .token = {}});
        const auto reply = next();
        return reply && std::holds_alternative<ServerHello>(reply->message);
    }

    HttpClient& http() { return http_; }

  private:
    HttpClient http_;
    bool upgraded_ = false;
};

TEST(WebSocket, SpeaksTheNativeMessages) {
    const Running r;
    WebSocketClient client(r.port());
    ASSERT_TRUE(client.upgraded());
    ASSERT_TRUE(client.hello());
    ChunkRequest request;
    request.request_id = 7;
    for (std::int32_t i = 0; i < 64; ++i) {
        request.keys.push_back({.lod = 0, .x = i % 8, .y = 0, .z = i / 8});
    }
    client.send(request);
    request.request_id = 8;
    request.format = ChunkFormat::columns;
    client.send(request);
    std::set<std::pair<std::uint32_t, ChunkPos>> answered;
    for (int i = 0; i < 128; ++i) {
        const auto received = client.next();
        ASSERT_TRUE(received) << i;
        const auto& chunk = std::get<ChunkAnswer>(received->message);
        EXPECT_TRUE(answered.emplace(chunk.request_id, chunk.key).second);
        if (chunk.status == ChunkStatus::full) {
            EXPECT_EQ(hash128(received->payload), chunk.etag);
        }
    }
}

TEST(WebSocket, TakesMessagesInPiecesAndAnswersPings) {
    const Running r;
    WebSocketClient client(r.port());
    ASSERT_TRUE(client.hello());
    const Bytes ping = encode_message(Ping{.nonce = 3});
    const std::string_view text = text_of(ping);
    client.send_frame(0x02, text.substr(0, 5));
    client.send_frame(0x89, "are you there");
    client.send_frame(0x00, text.substr(5, 1));
    client.send_frame(0x80, text.substr(6));
    const auto first = client.next_frame();
    const auto second = client.next_frame();
    ASSERT_TRUE(first && second);
    EXPECT_EQ(first->first, 0x8AU);
    EXPECT_EQ(first->payload, "are you there");
    EXPECT_EQ(second->first, 0x82U);
    client.send_frame(0x88, std::string("\x03\xE8", 2));
    const auto closed = client.next_frame();
    ASSERT_TRUE(closed);
    EXPECT_EQ(closed->first, 0x88U);
    EXPECT_EQ(closed->payload, std::string("\x03\xE8", 2));
    EXPECT_TRUE(client.http().is_closed());
}

TEST(WebSocket, ClosesWithACodeThatSaysWhy) {
    const Running r;
    const auto code_after = [&](unsigned first, std::string_view payload) {
        WebSocketClient client(r.port());
        EXPECT_TRUE(client.hello());
        client.send_frame(first, payload);
        while (const auto frame = client.next_frame()) {
            if (frame->first == 0x88 && frame->payload.size() >= 2) {
                EXPECT_TRUE(client.http().is_closed());
                return static_cast<unsigned char>(frame->payload[0]) * 256 +
                       static_cast<unsigned char>(frame->payload[1]);
            }
        }
        return 0;
    };
    EXPECT_EQ(code_after(0x81, "text"), 1003);
    EXPECT_EQ(code_after(0x83, "?"), 1002);
    EXPECT_EQ(code_after(0x82, std::string_view("\xFF\xFF\xFF\xFF....", 8)), 1008);
}

TEST(WebSocket, NeedsAWholeHandshake) {
    const Running r;
    for (const std::string headers :
         {"", "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n",
          "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 12\r\n"
          "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n",
          "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
          "Sec-WebSocket-Key: short\r\n"}) {
        HttpClient client(r.port());
        const auto reply = client.get("/ws", headers);
        ASSERT_TRUE(reply);
        EXPECT_EQ(reply->status, 426U) << headers;
        EXPECT_EQ(reply->header("sec-websocket-version"), "13");
        EXPECT_TRUE(client.get("/healthz"));
    }
}

TEST(WebSocket, ASlowReaderStillGetsEverything) {
    const Running r;
    WebSocketClient client(r.port());
    ASSERT_TRUE(client.hello());
    constexpr std::uint32_t kRequests = 12;
    for (std::uint32_t id = 1; id <= kRequests; ++id) {
        ChunkRequest request;
        request.request_id = id;
        request.format = ChunkFormat::columns;
        for (std::int32_t i = 0; i < 64; ++i) {
            request.keys.push_back({.lod = 0, .x = i % 8, .y = 0, .z = i / 8});
        }
        client.send(request);  // and reads nothing yet
    }
    for (std::uint32_t i = 0; i < kRequests * 64; ++i) {
        const auto received = client.next();
        ASSERT_TRUE(received && std::holds_alternative<ChunkAnswer>(received->message)) << i;
    }
}

TEST(WebSocket, SaysGoodbyeWhenTheServerStops) {
    const Running r;
    WebSocketClient client(r.port());
    ASSERT_TRUE(client.hello());
    std::jthread stopping([&] { r.server->stop(); });
    const auto goodbye = client.next();
    ASSERT_TRUE(goodbye && std::holds_alternative<Goodbye>(goodbye->message));
    const auto closed = client.next_frame();
    ASSERT_TRUE(closed);
    EXPECT_EQ(closed->first, 0x88U);
    EXPECT_EQ(closed->payload.substr(0, 2), std::string("\x03\xE9", 2));
    EXPECT_TRUE(client.http().is_closed());
}

}  // namespace
}  // namespace terrane
