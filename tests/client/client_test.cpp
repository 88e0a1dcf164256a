#include "client-sample/cpp/client.h"

#include "tests/client/scripted_peer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>

namespace terrane {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
using namespace std::chrono_literals;

Result<Client> connect(const ScriptedPeer& peer, milliseconds timeout = 5s) {
    return Client::connect({.host = "127.0.0.1",
                            .port = peer.port(),
                            .timeout = timeout,
                            .client_name = "client_test",
                            .token = {}});
}

Result<std::optional<ClientEvent>> next(Client& client) {
    return client.next(steady_clock::now() + 5s);
}

ErrorCode code_of_next(Client& client) {
    const auto event = next(client);
    return event ? static_cast<ErrorCode>(0) : event.error().code;
}

template <typename T>
std::optional<T> next_kind(Client& client) {
    const auto event = next(client);
    const T* found = event && *event ? std::get_if<T>(&**event) : nullptr;
    return found != nullptr ? std::optional(*found) : std::nullopt;
}

ChunkAnswer answer_to(const ChunkRequest& request, ChunkPos key, std::uint32_t payload_bytes = 0) {
    return {.request_id = request.request_id,
            .key = key,
            .format = request.format,
            .status = payload_bytes > 0 ? ChunkStatus::full : ChunkStatus::empty,
            .source = ChunkSource::generated,
            .etag = {},
            .timings = {},
            .payload_bytes = payload_bytes,
            .uniform = {}};
}

std::vector<ChunkPos> row_of_keys(std::int32_t count) {
    std::vector<ChunkPos> keys;
    for (std::int32_t x = 0; x < count; ++x) {
        keys.push_back({.lod = 0, .x = x, .y = 0, .z = 0});
    }
    return keys;
}

TEST(Client, GreetsAndKnowsTheServer) {
    ScriptedPeer peer([](PeerSocket& socket) {
        const auto hello = socket.receive_kind<ClientHello>();
        ASSERT_TRUE(hello);
        EXPECT_EQ(hello->protocol_version, kProtocolVersion);
        EXPECT_EQ(hello->client_name, "client_test");
        socket.send(test_hello());
        socket.wait_for_end();
    });
    const auto client = connect(peer);
    ASSERT_TRUE(client) << client.error().message;
    EXPECT_EQ(client->hello(), test_hello());
}

TEST(Client, GivesUpOnAServerThatNeverGreets) {
    ScriptedPeer peer([](PeerSocket& socket) { socket.wait_for_end(); });
    const auto client = connect(peer, 50ms);
    ASSERT_FALSE(client);
    EXPECT_EQ(client.error().code, ErrorCode::io_error);
}

TEST(Client, SaysThatNobodyListens) {
    std::uint16_t port = 0;
    {
        const ScriptedPeer peer([](PeerSocket&) {});
        port = peer.port();
    }
    const auto client = Client::connect(
        {.host = "127.0.0.1", .port = port, .timeout = 5s, .client_name = {}, .token = {}});
    ASSERT_FALSE(client);
    EXPECT_EQ(client.error().code, ErrorCode::io_error);
    EXPECT_NE(client.error().message.find(std::to_string(port)), std::string::npos);
}

TEST(Client, RefusesAServerOfAnotherVersion) {
    ScriptedPeer peer([](PeerSocket& socket) {
        auto hello = test_hello();
        hello.protocol_version = 99;
        socket.greet(hello);
        socket.wait_for_end();
    });
    const auto client = connect(peer);
    ASSERT_FALSE(client);
    EXPECT_EQ(client.error().code, ErrorCode::version_mismatch);
}

TEST(Client, TellsWhatTheServerSaysInsteadOfAGreeting) {
    ScriptedPeer peer([](PeerSocket& socket) {
        socket.receive();
        socket.send(Failure{.request_id = 0,
                            .error = {.code = ErrorCode::unauthorized, .message = "no token"},
                            .retry_after_ms = 0,
                            .key = std::nullopt});
    });
    const auto client = connect(peer);
    ASSERT_FALSE(client);
    EXPECT_EQ(client.error(), (Error{.code = ErrorCode::unauthorized, .message = "no token"}));
}

TEST(Client, TakesAnswersInAnyOrderWithTheirPayloads) {
    ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        const auto request = socket.receive_kind<ChunkRequest>();
        ASSERT_TRUE(request);
        const Bytes payload = {std::byte{7}, std::byte{8}};
        socket.send(answer_to(*request, request->keys[1], 2), payload);
        socket.send(answer_to(*request, request->keys[0]));
        socket.wait_for_end();
    });
    auto client = connect(peer);
    ASSERT_TRUE(client);
    const auto keys = row_of_keys(2);
    const auto id = client->request(keys, ChunkFormat::columns);
    ASSERT_TRUE(id);
    EXPECT_EQ(client->unanswered(), 2U);
    const auto first = next_kind<ReceivedChunk>(*client);
    ASSERT_TRUE(first);
    EXPECT_EQ(first->answer.key, keys[1]);
    EXPECT_EQ(first->answer.request_id, *id);
    EXPECT_EQ(first->payload, (Bytes{std::byte{7}, std::byte{8}}));
    const auto second = next_kind<ReceivedChunk>(*client);
    ASSERT_TRUE(second);
    EXPECT_EQ(second->answer.key, keys[0]);
    EXPECT_TRUE(second->payload.empty());
    EXPECT_EQ(client->unanswered(), 0U);
}

TEST(Client, SplitsManyKeysAndStaysWithinTheServersLimits) {
    constexpr std::int32_t kCount = 50;
    ScriptedPeer peer([](PeerSocket& socket) {
        auto hello = test_hello();
        hello.limits.keys_per_request_max = 4;
        hello.limits.keys_in_flight_max = 10;
        socket.greet(hello);
        std::vector<std::pair<ChunkRequest, ChunkPos>> in_flight;
        std::int32_t asked = 0;
        while (asked < kCount || !in_flight.empty()) {
            // Answer one only when no more keys may come.
            if (in_flight.size() == 10 || asked == kCount) {
                socket.send(answer_to(in_flight.back().first, in_flight.back().second));
                in_flight.pop_back();
                continue;
            }
            const auto request = socket.receive_kind<ChunkRequest>();
            ASSERT_TRUE(request);
            EXPECT_LE(request->keys.size(), 4U);
            for (const ChunkPos key : request->keys) {
                in_flight.emplace_back(*request, key);
                ++asked;
            }
            ASSERT_LE(in_flight.size(), 10U);
        }
        socket.wait_for_end();
    });
    auto client = connect(peer);
    ASSERT_TRUE(client);
    ASSERT_TRUE(client->request(row_of_keys(kCount), ChunkFormat::draco));
    std::set<ChunkPos> received;
    while (client->unanswered() > 0) {
        const auto chunk = next_kind<ReceivedChunk>(*client);
        ASSERT_TRUE(chunk);
        received.insert(chunk->answer.key);
    }
    EXPECT_EQ(std::ssize(received), kCount);
}

TEST(Client, AsksABusyServerAgainAfterTheTimeItNames) {
    ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        const auto first = socket.receive_kind<ChunkRequest>();
        ASSERT_TRUE(first);
        // One key by itself, the rest of the request as a whole.
        socket.send(Failure{.request_id = first->request_id,
                            .error = {.code = ErrorCode::busy, .message = "full"},
                            .retry_after_ms = 30,
                            .key = first->keys[1]});
        socket.send(Failure{.request_id = first->request_id,
                            .error = {.code = ErrorCode::busy, .message = "full"},
                            .retry_after_ms = 30,
                            .key = std::nullopt});
        const auto refused_at = steady_clock::now();
        std::size_t answered = 0;
        while (answered < 3) {
            const auto again = socket.receive_kind<ChunkRequest>();
            ASSERT_TRUE(again);
            EXPECT_GE(steady_clock::now() - refused_at, 29ms);
            EXPECT_NE(again->request_id, first->request_id);
            for (const ChunkPos key : again->keys) {
                socket.send(answer_to(*again, key));
                ++answered;
            }
        }
        socket.wait_for_end();
    });
    auto client = connect(peer);
    ASSERT_TRUE(client);
    ASSERT_TRUE(client->request(row_of_keys(3), ChunkFormat::draco));
    for (int i = 0; i < 3; ++i) {
        EXPECT_TRUE(next_kind<ReceivedChunk>(*client));
    }
    EXPECT_EQ(client->unanswered(), 0U);
}

TEST(Client, GivesUpOnAServerThatStaysBusy) {
    ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        int refused = 0;
        while (const auto request = socket.receive_kind<ChunkRequest>()) {
            ++refused;
            socket.send(Failure{.request_id = request->request_id,
                                .error = {.code = ErrorCode::busy, .message = "full"},
                                .retry_after_ms = 0,
                                .key = std::nullopt});
        }
        EXPECT_EQ(refused, kBusyTriesMax);
    });
    auto client = connect(peer);
    ASSERT_TRUE(client);
    const auto keys = row_of_keys(1);
    ASSERT_TRUE(client->request(keys, ChunkFormat::draco));
    const auto event = client->next(steady_clock::now() + 30s);
    ASSERT_TRUE(event && *event);
    const auto* failure = std::get_if<Failure>(&**event);
    ASSERT_NE(failure, nullptr);
    EXPECT_EQ(failure->error.code, ErrorCode::busy);
    EXPECT_EQ(failure->key, keys[0]);
    EXPECT_EQ(client->unanswered(), 0U);
}

TEST(Client, OtherFailuresAreToldAtOnce) {
    ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        const auto request = socket.receive_kind<ChunkRequest>();
        ASSERT_TRUE(request);
        socket.send(Failure{.request_id = request->request_id,
                            .error = {.code = ErrorCode::unsupported, .message = "lod 9"},
                            .retry_after_ms = 0,
                            .key = request->keys[0]});
        socket.wait_for_end();
    });
    auto client = connect(peer);
    ASSERT_TRUE(client);
    ASSERT_TRUE(client->request(row_of_keys(1), ChunkFormat::draco));
    const auto failure = next_kind<Failure>(*client);
    ASSERT_TRUE(failure);
    EXPECT_EQ(failure->error, (Error{.code = ErrorCode::unsupported, .message = "lod 9"}));
}

TEST(Client, NothingOfACancelledRequestIsGivenOut) {
    ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        const auto request = socket.receive_kind<ChunkRequest>();
        ASSERT_TRUE(request);
        const auto cancel = socket.receive_kind<ChunkCancel>();
        ASSERT_TRUE(cancel);
        EXPECT_EQ(cancel->request_ids, std::vector{request->request_id});
        socket.send(answer_to(*request, request->keys[0]));  // crossed the cancel on its way
        socket.send(Failure{.request_id = request->request_id,
                            .error = {.code = ErrorCode::cancelled, .message = {}},
                            .retry_after_ms = 0,
                            .key = request->keys[1]});
        const auto ping = socket.receive_kind<Ping>();
        ASSERT_TRUE(ping);
        socket.send(Pong{.nonce = ping->nonce});
        socket.wait_for_end();
    });
    auto client = connect(peer);
    ASSERT_TRUE(client);
    const auto id = client->request(row_of_keys(2), ChunkFormat::draco);
    ASSERT_TRUE(id);
    ASSERT_TRUE(client->cancel(*id));
    EXPECT_EQ(client->unanswered(), 0U);
    ASSERT_TRUE(client->ping(5));
    const auto pong = next_kind<Pong>(*client);
    ASSERT_TRUE(pong);
    EXPECT_EQ(pong->nonce, 5U);
}

TEST(Client, AsksForColumnsAndTheWorld) {
    ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        const auto column = socket.receive_kind<ColumnQuery>();
        const auto world = socket.receive_kind<WorldQuery>();
        ASSERT_TRUE(column && world);
        socket.send(
            WorldAnswer{.request_id = world->request_id, .toml = "a = 1", .fingerprint = {}});
        socket.send(
            ColumnAnswer{.request_id = column->request_id, .column = column->column, .limits = {}});
        socket.wait_for_end();
    });
    auto client = connect(peer);
    ASSERT_TRUE(client);
    const auto column_id = client->query_column({.x = -3, .z = 4});
    const auto world_id = client->query_world();
    ASSERT_TRUE(column_id && world_id);
    EXPECT_EQ(client->unanswered(), 2U);
    const auto world = next_kind<WorldAnswer>(*client);
    ASSERT_TRUE(world);
    EXPECT_EQ(world->request_id, *world_id);
    EXPECT_EQ(world->toml, "a = 1");
    const auto column = next_kind<ColumnAnswer>(*client);
    ASSERT_TRUE(column);
    EXPECT_EQ(column->request_id, *column_id);
    EXPECT_EQ(column->column, (ColumnPos{.x = -3, .z = 4}));
    EXPECT_EQ(client->unanswered(), 0U);
}

TEST(Client, AnswersPings) {
    ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        socket.send(Ping{.nonce = 42});
        const auto pong = socket.receive_kind<Pong>();
        ASSERT_TRUE(pong);
        EXPECT_EQ(pong->nonce, 42U);
        socket.send(Goodbye{.code = ErrorCode::draining, .reason = "restart"});
        socket.wait_for_end();
    });
    auto client = connect(peer);
    ASSERT_TRUE(client);
    const auto goodbye = next_kind<Goodbye>(*client);
    ASSERT_TRUE(goodbye);
    EXPECT_EQ(goodbye->reason, "restart");
}

TEST(Client, NextGivesNothingAtItsDeadline) {
    ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        const Bytes half = encode_message(Ping{.nonce = 1});
        socket.send_bytes(std::span(half).first(9));  // half a frame must not keep it waiting
        socket.wait_for_end();
    });
    auto client = connect(peer);
    ASSERT_TRUE(client);
    const auto begin = steady_clock::now();
    const auto event = client->next(begin + 50ms);
    ASSERT_TRUE(event) << event.error().message;
    EXPECT_FALSE(*event);
    EXPECT_GE(steady_clock::now() - begin, 50ms);
}

TEST(Client, AServerThatClosesInAFrameIsAnErrorThatStays) {
    ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        const Bytes half = encode_message(Ping{.nonce = 1});
        socket.send_bytes(std::span(half).first(half.size() - 1));
    });
    auto client = connect(peer);
    ASSERT_TRUE(client);
    const auto event = next(*client);
    ASSERT_FALSE(event);
    EXPECT_EQ(event.error().code, ErrorCode::io_error);
    EXPECT_NE(event.error().message.find("middle of a frame"), std::string::npos);
    EXPECT_EQ(next(*client).error(), event.error());
    EXPECT_FALSE(client->request(row_of_keys(1), ChunkFormat::draco));
}

TEST(Client, BytesThatAreNoFrameAreMalformed) {
    ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        socket.send_bytes(bytes_of("HTTP/1.1 400 Bad Request\r\n\r\n"));
        socket.wait_for_end();
    });
    auto client = connect(peer);
    ASSERT_TRUE(client);
    EXPECT_EQ(code_of_next(*client), ErrorCode::malformed);  // and is told to be HTTP
}

TEST(Client, ChunksThatNobodyAskedForAreMalformed) {
    for (const bool known_request : {false, true}) {
        ScriptedPeer peer([&](PeerSocket& socket) {
            socket.greet();
            auto request = socket.receive_kind<ChunkRequest>();
            ASSERT_TRUE(request);
            request->request_id += known_request ? 0 : 1;
            socket.send(
                answer_to(*request, {.lod = 0, .x = known_request ? 99 : 0, .y = 0, .z = 0}));
            socket.wait_for_end();
        });
        auto client = connect(peer);
        ASSERT_TRUE(client);
        ASSERT_TRUE(client->request(row_of_keys(1), ChunkFormat::draco));
        EXPECT_EQ(code_of_next(*client), ErrorCode::malformed);
    }
}

ServerHello view_hello() {
    ServerHello hello = test_hello();
    hello.limits.view_radius_max = 16;
    hello.limits.credit_window_bytes = 1000;
    return hello;
}

ChunkAnswer view_chunk(std::int32_t x, std::uint32_t payload_bytes) {
    return {.request_id = 0,
            .key = {.lod = 0, .x = x, .y = 0, .z = 0},
            .format = ChunkFormat::draco,
            .status = ChunkStatus::full,
            .source = ChunkSource::cache,
            .etag = {},
            .timings = {},
            .payload_bytes = payload_bytes,
            .uniform = {}};
}

TEST(Client, AViewsChunksComeAndCreditFollowsWhenTheyAreConsumed) {
    const ScriptedPeer peer([](PeerSocket& server) {
        server.greet(view_hello());
        const auto update = server.receive_kind<ViewUpdate>();
        ASSERT_TRUE(update);
        EXPECT_EQ(update->radius_chunks, (std::vector<std::uint32_t>{2, 1}));
        server.send(view_chunk(1, 100), Bytes(100));
        server.send(view_chunk(2, 300), Bytes(300));
        server.send(ChunkForget{.keys = {{.lod = 1, .x = 3, .y = 0, .z = 4}}});
        // In one message or two, as the chunks happen to arrive.
        std::uint64_t credit = 0;
        while (credit < 400) {
            const auto some = server.receive_kind<Credit>();
            ASSERT_TRUE(some);
            credit += some->bytes;
        }
        EXPECT_EQ(credit, 400U);
        server.send(view_chunk(3, 10), Bytes(10));
        server.send(Failure{.request_id = 0,
                            .error = {.code = ErrorCode::internal, .message = "no"},
                            .retry_after_ms = 0,
                            .key = ChunkPos{}});
        server.send(Failure{.request_id = 0,
                            .error = {.code = ErrorCode::busy, .message = "later"},
                            .retry_after_ms = 9,
                            .key = std::nullopt});
        const auto second = server.receive_kind<Credit>();
        ASSERT_TRUE(second);
        EXPECT_EQ(second->bytes, 10U) << "little, but nothing else is at hand";
        server.send(Failure{.request_id = 0,
                            .error = {.code = ErrorCode::draining, .message = "the end"},
                            .retry_after_ms = 0,
                            .key = std::nullopt});
    });
    auto client = connect(peer);
    ASSERT_TRUE(client) << client.error().message;
    ViewUpdate update;
    update.radius_chunks = {2, 1};
    ASSERT_TRUE(client->view(update));
    for (const std::int32_t x : {1, 2}) {
        const auto event = next(*client);
        ASSERT_TRUE(event && *event);
        EXPECT_EQ(std::get<ReceivedChunk>(**event).answer.key.x, x);
    }
    auto event = next(*client);
    ASSERT_TRUE(event && *event);
    EXPECT_EQ(std::get<ChunkForget>(**event).keys.at(0).z, 4);
    event = next(*client);
    ASSERT_TRUE(event && *event);
    EXPECT_EQ(std::get<ReceivedChunk>(**event).payload.size(), 10U);
    event = next(*client);
    ASSERT_TRUE(event && *event);
    EXPECT_TRUE(std::get<Failure>(**event).key);
    event = next(*client);
    ASSERT_TRUE(event && *event);
    EXPECT_EQ(std::get<Failure>(**event).error.code, ErrorCode::busy);
    EXPECT_EQ(next(*client).error().code, ErrorCode::draining);
}

TEST(Client, RefusesAViewThatNoServerTakes) {
    const ScriptedPeer peer([](PeerSocket& server) {
        server.greet(view_hello());
        EXPECT_TRUE(server.receive_kind<ViewUpdate>());
    });
    auto client = connect(peer);
    ASSERT_TRUE(client) << client.error().message;
    ViewUpdate update;
    update.x = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(client->view(update).error().code, ErrorCode::invalid_argument);
    update.x = 1e300;
    EXPECT_EQ(client->view(update).error().code, ErrorCode::out_of_range);
    update.x = 0;
    update.radius_chunks.resize(19);
    EXPECT_EQ(client->view(update).error().code, ErrorCode::invalid_argument);
    update.radius_chunks.resize(1);
    EXPECT_TRUE(client->view(update)) << "nothing was sent before";
}

TEST(Client, SaysThatAServerGivesNoViews) {
    const ScriptedPeer peer([](PeerSocket& server) { server.greet(); });
    auto client = connect(peer);
    ASSERT_TRUE(client) << client.error().message;
    EXPECT_EQ(client->view(ViewUpdate{}).error().code, ErrorCode::unsupported);
}

TEST(Client, ViewChunksWithoutAViewAreMalformed) {
    const ScriptedPeer peer([](PeerSocket& server) {
        server.greet(view_hello());
        server.send(view_chunk(1, 1), Bytes(1));
        server.wait_for_end();
    });
    auto client = connect(peer);
    ASSERT_TRUE(client) << client.error().message;
    EXPECT_EQ(next(*client).error().code, ErrorCode::malformed);
}

TEST(Client, PassesOverKindsThatOnlyANewerServerKnows) {
    const ScriptedPeer peer([](PeerSocket& server) {
        server.greet(view_hello());
        Bytes unknown = encode_message(Credit{.bytes = 1});
        ASSERT_EQ(unknown[35], std::byte{16}) << "WIRE_FORMAT.md shows where the kind stands";
        unknown[35] = std::byte{99};
        server.send_bytes(unknown);
        server.send(Pong{.nonce = 5});
        server.wait_for_end();
    });
    auto client = connect(peer);
    ASSERT_TRUE(client) << client.error().message;
    const auto event = next(*client);
    ASSERT_TRUE(event && *event) << event.error().message;
    EXPECT_EQ(std::get<Pong>(**event).nonce, 5U);
}

}  // namespace
}  // namespace terrane
