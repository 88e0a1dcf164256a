// One simulated viewer against messages written by hand, the clock given.
#include "client-sample/cpp/program/load_client.h"

#include "tests/client/scripted_peer.h"

#include <gtest/gtest.h>

#include <array>

namespace terrane {
namespace {

using namespace std::chrono_literals;
using Clock = LoadClient::Clock;

/// The world of the hello has 100 voxels' bound: heights 0..3.
ServerHello hello_with_views() {
    ServerHello hello = test_hello();
    hello.limits.view_radius_max = 8;
    hello.limits.credit_window_bytes = 1 << 18U;
    return hello;
}

class LoadClientTest : public testing::Test {
  protected:
    void SetUp() override {
        handlers_.chunk = [this](const ChunkAnswer&, std::span<const std::byte>) { ++decoded_; };
        handlers_.world = [this](const WorldAnswer&, const ServerHello&) { ++worlds_; };
    }

    LoadClient make(const LoadClientOptions& options) {
        LoadClient client(options,
                          {.kind = MovementKind::path,
                           .seed = 1,
                           .x = 0,
                           .y = 0,
                           .z = 0,
                           .spread_voxels = 0,
                           .path = path_,
                           .path_offset_seconds = 0},
                          make_carrier(CarrierKind::tcp, {}), handlers_);
        client.open(now_);
        return client;
    }

    static LoadClientOptions options(bool by_view) {
        LoadClientOptions options;
        options.radius_chunks = {0};
        options.by_view = by_view;
        return options;
    }

    Result<void> tell(LoadClient& client, const AnyMessage& message, const Bytes& payload = {}) {
        Bytes bytes = encode_message(message);
        bytes.insert(bytes.end(), payload.begin(), payload.end());
        return client.receive(bytes, now_);
    }

    /// What the client has said since the last call, in the server's eyes.
    std::vector<AnyMessage> said(LoadClient& client) {
        std::vector<AnyMessage> messages;
        server_.feed(client.take_output());
        for (auto frame = server_.next(); frame && *frame; frame = server_.next()) {
            auto message = decode_message(**frame);
            EXPECT_TRUE(message);
            messages.push_back(std::move(*message));
        }
        return messages;
    }

    static ChunkAnswer empty_chunk(std::uint32_t request_id, ChunkPos key) {
        ChunkAnswer answer;
        answer.request_id = request_id;
        answer.key = key;
        answer.status = ChunkStatus::empty;
        return answer;
    }

    /// Stands at (16, 16) for 10 s, then at (80, 16): two stacks on.
    std::shared_ptr<const std::vector<PathPoint>> path_ =
        std::make_shared<const std::vector<PathPoint>>(
            std::vector<PathPoint>{{.seconds = 0, .x = 16, .y = 50, .z = 16},
                                   {.seconds = 10, .x = 16, .y = 50, .z = 16},
                                   {.seconds = 10.001, .x = 80, .y = 50, .z = 16},
                                   {.seconds = 100, .x = 80, .y = 50, .z = 16}});
    Clock::time_point now_ = Clock::now();
    LoadClient::Handlers handlers_;
    FrameReader server_{kInboundFrameLimits};
    int decoded_ = 0;
    int worlds_ = 0;
};

TEST_F(LoadClientTest, TellsItsViewAndCountsWhatComes) {
    LoadClient client = make(options(true));
    EXPECT_TRUE(std::holds_alternative<ClientHello>(said(client).at(0)));
    ASSERT_TRUE(tell(client, hello_with_views()));
    const auto messages = said(client);
    ASSERT_EQ(messages.size(), 1U);
    const auto& view = std::get<ViewUpdate>(messages[0]);
    EXPECT_EQ(view.x, 16);
    EXPECT_EQ(view.y, 50);
    EXPECT_EQ(client.missing(), 4U);
    for (std::int32_t y = 0; y < 4; ++y) {
        ASSERT_TRUE(tell(client, empty_chunk(0, {.lod = 0, .x = 0, .y = y, .z = 0})));
    }
    EXPECT_EQ(client.missing(), 0U);
    EXPECT_EQ(client.counts().chunks, 4U);
    EXPECT_EQ(client.counts().latency.count(), 4U);
    EXPECT_EQ(decoded_, 4);
    EXPECT_TRUE(client.counts().fill);
}

TEST_F(LoadClientTest, WhatComesAfterItHasLeftTheViewIsWasted) {
    LoadClient client = make(options(true));
    ASSERT_TRUE(tell(client, hello_with_views()));
    said(client);
    now_ += 11s;
    client.tick(now_);
    EXPECT_EQ(std::get<ViewUpdate>(said(client).at(0)).x, 80);
    EXPECT_EQ(client.missing(), 4U);
    ASSERT_TRUE(tell(client, empty_chunk(0, {.lod = 0, .x = 0, .y = 0, .z = 0})));
    EXPECT_EQ(client.counts().wasted_chunks, 1U);
    EXPECT_EQ(client.missing(), 4U);
}

TEST_F(LoadClientTest, WhatIsForgottenAndStillWantedIsMissingAgain) {
    LoadClient client = make(options(true));
    ASSERT_TRUE(tell(client, hello_with_views()));
    const ChunkPos key{.lod = 0, .x = 0, .y = 2, .z = 0};
    ASSERT_TRUE(tell(client, empty_chunk(0, key)));
    EXPECT_EQ(client.missing(), 3U);
    ASSERT_TRUE(tell(client, ChunkForget{.keys = {key, {.lod = 0, .x = 9, .y = 0, .z = 0}}}));
    EXPECT_EQ(client.missing(), 4U);
    EXPECT_EQ(client.counts().forgotten, 2U);
}

TEST_F(LoadClientTest, GivesCreditForWhatItDecoded) {
    auto with_columns = options(true);
    LoadClient client = make(with_columns);
    ASSERT_TRUE(tell(client, hello_with_views()));
    said(client);
    ChunkAnswer answer = empty_chunk(0, {.lod = 0, .x = 0, .y = 0, .z = 0});
    answer.status = ChunkStatus::full;
    answer.payload_bytes = 40;
    ASSERT_TRUE(tell(client, answer, Bytes(40, std::byte{0x55})));
    const auto messages = said(client);
    ASSERT_EQ(messages.size(), 1U);
    EXPECT_EQ(std::get<Credit>(messages[0]).bytes, 40U);
    EXPECT_EQ(client.counts().undecodable, 1U) << "40 bytes of 0x55 are no Draco";
    EXPECT_NE(client.counts().first_fault.find("undecodable"), std::string::npos);
}

TEST_F(LoadClientTest, DecodesEveryNthChunkOnlyIfAskedTo) {
    auto seldom = options(true);
    seldom.decode_every = 2;
    LoadClient client = make(seldom);
    ASSERT_TRUE(tell(client, hello_with_views()));
    for (std::int32_t y = 0; y < 4; ++y) {
        ChunkAnswer answer = empty_chunk(0, {.lod = 0, .x = 0, .y = y, .z = 0});
        answer.status = ChunkStatus::full;
        answer.payload_bytes = 40;
        ASSERT_TRUE(tell(client, answer, Bytes(40, std::byte{0x55})));
    }
    EXPECT_EQ(client.counts().undecodable, 2U);
    EXPECT_EQ(client.missing(), 0U);
    EXPECT_EQ(decoded_, 0);
}

TEST_F(LoadClientTest, WithoutViewsItAsksByKeyAndAsksBusyOnesAgain) {
    LoadClient client = make(options(false));
    ASSERT_TRUE(tell(client, test_hello()));
    auto messages = said(client);
    if (messages.size() > 1) {  // the hello of the client comes first
        messages.erase(messages.begin());
    }
    const auto request = std::get<ChunkRequest>(messages.at(0));
    ASSERT_EQ(request.keys.size(), 4U);
    ASSERT_TRUE(tell(client, Failure{.request_id = request.request_id,
                                     .error = {.code = ErrorCode::busy, .message = "later"},
                                     .retry_after_ms = 500,
                                     .key = request.keys[1]}));
    ASSERT_TRUE(tell(client, Failure{.request_id = request.request_id,
                                     .error = {.code = ErrorCode::internal, .message = "broken"},
                                     .retry_after_ms = 0,
                                     .key = request.keys[2]}));
    EXPECT_EQ(client.counts().busy, 1U);
    EXPECT_EQ(client.counts().refused, 1U);
    EXPECT_EQ(client.missing(), 3U);
    now_ += 400ms;
    client.tick(now_);
    EXPECT_TRUE(said(client).empty());
    now_ += 200ms;
    client.tick(now_);
    const auto again = std::get<ChunkRequest>(said(client).at(0));
    EXPECT_EQ(again.keys, std::vector{request.keys[1]});
    ASSERT_TRUE(tell(client, empty_chunk(again.request_id, request.keys[1])));
    ASSERT_TRUE(tell(client, empty_chunk(request.request_id, request.keys[0])));
    EXPECT_EQ(client.missing(), 1U);
    ASSERT_TRUE(tell(client, empty_chunk(77, request.keys[3])));
    EXPECT_EQ(client.counts().undecodable, 1U) << "nobody asked for it";
}

TEST_F(LoadClientTest, SilenceWhileItWantsIsAHang) {
    LoadClient client = make(options(true));
    EXPECT_FALSE(client.is_hung(now_ + 9s));
    EXPECT_TRUE(client.is_hung(now_ + 11s)) << "no greeting";
    ASSERT_TRUE(tell(client, hello_with_views()));
    EXPECT_TRUE(client.is_hung(now_ + 11s));
    for (std::int32_t y = 0; y < 4; ++y) {
        ASSERT_TRUE(tell(client, empty_chunk(0, {.lod = 0, .x = 0, .y = y, .z = 0})));
    }
    EXPECT_FALSE(client.is_hung(now_ + 11s)) << "it wants nothing";
}

TEST_F(LoadClientTest, WhoWantedNothingForLongIsNotHungWhenItWantsAgain) {
    LoadClient client = make(options(true));
    ASSERT_TRUE(tell(client, hello_with_views()));
    for (std::int32_t y = 0; y < 4; ++y) {
        ASSERT_TRUE(tell(client, empty_chunk(0, {.lod = 0, .x = 0, .y = y, .z = 0})));
    }
    now_ += 11s;  // the path has led two stacks on
    client.tick(now_);
    EXPECT_EQ(client.missing(), 4U);
    EXPECT_FALSE(client.is_hung(now_ + 9s));
    EXPECT_TRUE(client.is_hung(now_ + 11s));
}

TEST_F(LoadClientTest, TheSessionEndsWithWhatTheServerSays) {
    LoadClient refused = make(options(true));
    const auto failed =
        tell(refused, Failure{.request_id = 0,
                              .error = {.code = ErrorCode::unauthorized, .message = "no token"},
                              .retry_after_ms = 0,
                              .key = std::nullopt});
    ASSERT_FALSE(failed);
    EXPECT_EQ(failed.error().code, ErrorCode::unauthorized);
    LoadClient without_views = make(options(true));
    const auto unsupported = tell(without_views, test_hello());
    ASSERT_FALSE(unsupported);
    EXPECT_NE(unsupported.error().message.find("--by request"), std::string::npos);
    LoadClient sent_away = make(options(true));
    ASSERT_TRUE(tell(sent_away, hello_with_views()));
    const auto goodbye =
        tell(sent_away, Goodbye{.code = ErrorCode::draining, .reason = "maintenance"});
    ASSERT_FALSE(goodbye);
    EXPECT_NE(goodbye.error().message.find("maintenance"), std::string::npos);
}

TEST_F(LoadClientTest, AnswersPingsAndAsksForTheWorldOnce) {
    auto asking = options(true);
    asking.asks_world = true;
    LoadClient client = make(asking);
    said(client);
    ASSERT_TRUE(tell(client, hello_with_views()));
    const auto messages = said(client);
    ASSERT_EQ(messages.size(), 2U);
    EXPECT_TRUE(std::holds_alternative<WorldQuery>(messages[0]));
    ASSERT_TRUE(tell(client, WorldAnswer{.request_id = 1, .toml = "x", .fingerprint = {}}));
    EXPECT_EQ(worlds_, 1);
    ASSERT_TRUE(tell(client, Ping{.nonce = 5}));
    EXPECT_EQ(std::get<Pong>(said(client).at(0)).nonce, 5U);
}

TEST_F(LoadClientTest, RefusesAWorldBeforeTheGreeting) {
    LoadClient client = make(options(true));
    const auto told = tell(client, WorldAnswer{.request_id = 1, .toml = "x", .fingerprint = {}});
    ASSERT_FALSE(told);
    EXPECT_EQ(told.error().code, ErrorCode::malformed);
    EXPECT_EQ(worlds_, 0);
}

}  // namespace
}  // namespace terrane
