// The whole server on a port of its own, talked to in raw frames.
#include "server/server.h"

#include "generator/mesh/draco_codec.h"
#include "generator/world/world_file.h"
#include "protocol/wire/limits.h"
#include "server/chunks/build_chunk.h"
#include "tests/server/raw_client.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <thread>

namespace terrane {
namespace {

using namespace std::chrono_literals;

struct Running {
    explicit Running(ServerOptions changed = {}) : options(std::move(changed)) {
        options.world = load_shipped_world("paper-B2");
        options.listen.endpoint = {.address = "127.0.0.1", .port = 0};
        options.listen.tick = 20ms;
        options.workers = 2;
        options.cache_bytes_max = std::size_t{64} << 20U;
        options.store = StoreKind::memory;
        auto started = Server::start(options, log);
        if (!started) {
            ADD_FAILURE() << started.error().message;
            std::abort();
        }
        server = *std::move(started);
    }

    std::uint16_t port() const { return server->endpoint().port; }

    /// A new client is served: whatever happened before hurt nobody else.
    void expect_serving() const {
        RawClient client(port());
        EXPECT_TRUE(client.hello());
        client.send(Ping{.nonce = 42});
        const auto pong = client.next_as<Pong>();
        EXPECT_TRUE(pong && pong->nonce == 42);
    }

    ServerOptions options;
    const Log log{LogFormat::text, LogLevel::error};
    std::unique_ptr<Server> server;
};

ChunkRequest request_of(std::uint32_t id, std::vector<ChunkPos> keys,
                        ChunkFormat format = ChunkFormat::draco) {
    ChunkRequest request;
    request.request_id = id;
    request.format = format;
    request.keys = std::move(keys);
    return request;
}

TEST(Server, TellsItsWorldInTheHello) {
    const Running r;
    RawClient client(r.port());
    const auto hello = client.hello();
    ASSERT_TRUE(hello);
    EXPECT_EQ(hello->fingerprint, r.options.world->fingerprint);
    EXPECT_EQ(hello->content_id, content_id_of(*r.options.world));
    EXPECT_EQ(hello->levels, kLodMax + 1);
    EXPECT_EQ(hello->materials.size(), r.options.world->definition.materials.size());
    EXPECT_EQ(hello->limits.keys_per_request_max, kKeysPerRequestMax);
    client.send(WorldQuery{.request_id = 9});
    const auto world = client.next_as<WorldAnswer>();
    ASSERT_TRUE(world);
    EXPECT_EQ(world->toml, canonical_world_file(r.options.world->definition));
    EXPECT_EQ(world->fingerprint, hello->fingerprint);
}

TEST(Server, AnswersEveryKeyOnceInBothFormats) {
    const Running r;
    RawClient client(r.port());
    ASSERT_TRUE(client.hello());
    std::vector<ChunkPos> keys;
    for (std::int32_t i = 0; i < 64; ++i) {
        keys.push_back({.lod = 0, .x = i % 8 - 4, .y = i / 32, .z = (i / 8) % 4});
    }
    client.send(request_of(1, keys, ChunkFormat::draco));
    client.send(request_of(2, keys, ChunkFormat::columns));
    std::set<std::pair<std::uint32_t, ChunkPos>> answered;
    for (int i = 0; i < 128; ++i) {
        const auto received = client.next();
        ASSERT_TRUE(received);
        const auto& chunk = std::get<ChunkAnswer>(received->message);
        EXPECT_TRUE(answered.emplace(chunk.request_id, chunk.key).second);
        EXPECT_EQ(received->payload.size(), chunk.payload_bytes);
        if (chunk.status == ChunkStatus::full) {
            EXPECT_EQ(hash128(received->payload), chunk.etag);
        }
        if (chunk.status == ChunkStatus::full && chunk.format == ChunkFormat::draco) {
            EXPECT_TRUE(decode_draco(received->payload));
        }
    }
    EXPECT_EQ(count_of(r.server->counters().generations), 32U) << "8 x 4 stacks";
}

TEST(Server, TwoHundredClientsOfOneColdChunkAreOneGeneration) {
    const Running r;
    constexpr std::size_t kClients = 200;
    for (std::int32_t round = 0; round < 5; ++round) {
        std::vector<std::unique_ptr<RawClient>> clients;
        for (std::size_t i = 0; i < kClients; ++i) {
            clients.push_back(std::make_unique<RawClient>(r.port()));
            ASSERT_TRUE(clients.back()->hello());
        }
        for (const auto& client : clients) {
            client->send(request_of(1, {{.lod = 0, .x = 1000 + round, .y = 0, .z = 7}}));
        }
        std::set<Hash128> etags;
        for (const auto& client : clients) {
            const auto chunk = client->next_as<ChunkAnswer>();
            ASSERT_TRUE(chunk);
            etags.insert(chunk->etag);
        }
        EXPECT_EQ(etags.size(), 1U);
        EXPECT_EQ(count_of(r.server->counters().generations), static_cast<unsigned>(round) + 1U);
    }
}

TEST(Server, AnswersColumnsAndRefusesThoseOutsideTheWorld) {
    const Running r;
    RawClient client(r.port());
    ASSERT_TRUE(client.hello());
    client.send(ColumnQuery{.request_id = 1, .column = {.x = -33, .z = 64}});
    const auto column = client.next_as<ColumnAnswer>();
    ASSERT_TRUE(column);
    EXPECT_EQ(column->column, (ColumnPos{.x = -33, .z = 64}));
    EXPECT_GE(column->limits.size(), 2U);
    for (const std::int64_t far :
         {kColumnCoordinateLimit - 1, kColumnCoordinateLimit,
          std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max()}) {
        client.send(ColumnQuery{.request_id = 2, .column = {.x = far, .z = 0}});
        const auto failure = client.next_as<Failure>();
        ASSERT_TRUE(failure);
        EXPECT_EQ(failure->error.code, ErrorCode::out_of_range);
        EXPECT_EQ(failure->request_id, 2U);
    }
}

TEST(Server, AnswersTheExtremesOfEveryCoordinate) {
    const Running r;
    RawClient client(r.port());
    ASSERT_TRUE(client.hello());
    constexpr std::int32_t kMin = std::numeric_limits<std::int32_t>::min();
    constexpr std::int32_t kMax = std::numeric_limits<std::int32_t>::max();
    std::vector<ChunkPos> keys;
    for (const std::int32_t x : {kMin, kMax}) {
        for (const std::int32_t y : {kMin, 0, kMax}) {
            for (const std::int32_t z : {kMin, kMax}) {
                keys.push_back({.lod = 0, .x = x, .y = y, .z = z});
            }
        }
    }
    client.send(request_of(1, keys));
    for (std::size_t i = 0; i < keys.size(); ++i) {
        EXPECT_TRUE(client.next_as<ChunkAnswer>());
    }
    for (const std::int32_t lod : {kMin, -1, kLodMax + 1, kMax}) {
        client.send(request_of(2, {{.lod = lod, .x = 0, .y = 0, .z = 0}}));
        const auto failure = client.next_as<Failure>();
        ASSERT_TRUE(failure);
        EXPECT_EQ(failure->error.code, ErrorCode::unsupported);
        EXPECT_TRUE(failure->key);
    }
}

TEST(Server, AMalformedFrameEndsItsOwnConnectionOnly) {
    const Running r;
    RawClient bystander(r.port());
    ASSERT_TRUE(bystander.hello());
    const Bytes hello = encode_message(
        ClientHello{.protocol_version = kProtocolVersion, .client_name = "x", .token = {}});
    std::vector<Bytes> bad;
    for (const std::uint32_t length : {0U, 1U, 65537U, 1U << 31U, 0xFFFFFFFFU}) {
        Bytes bytes;
        ByteWriter(bytes).fixed(length);
        bytes.resize(64);
        bad.push_back(std::move(bytes));
    }
    Bytes identifier = hello;
    identifier[12] = std::byte{'X'};
    bad.push_back(identifier);
    Bytes noise = hello;
    for (std::size_t i = 8; i < noise.size(); ++i) {
        noise[i] = static_cast<std::byte>(i * 37);
    }
    bad.push_back(noise);
    for (const Bytes& bytes : bad) {
        RawClient client(r.port());
        ASSERT_TRUE(client.send(bytes));
        const auto failure = client.next_as<Failure>();
        ASSERT_TRUE(failure);
        EXPECT_EQ(failure->request_id, 0U);
        EXPECT_TRUE(failure->error.code == ErrorCode::malformed ||
                    failure->error.code == ErrorCode::too_large);
        EXPECT_TRUE(client.is_closed());
    }
    bystander.send(Ping{.nonce = 5});
    EXPECT_TRUE(bystander.next_as<Pong>());
    r.expect_serving();
}

TEST(Server, RefusesAnotherProtocolVersion) {
    const Running r;
    RawClient client(r.port());
    client.send(ClientHello{.protocol_version = 99, .client_name = "x", .token = {}});
    const auto failure = client.next_as<Failure>();
    ASSERT_TRUE(failure);
    EXPECT_EQ(failure->error.code, ErrorCode::version_mismatch);
    EXPECT_TRUE(client.is_closed());
}

TEST(Server, ATruncatedFrameIsForgottenWithItsConnection) {
    const Running r;
    const Bytes request = encode_message(request_of(1, {{.lod = 0, .x = 0, .y = 0, .z = 0}}));
    for (std::size_t size = 0; size < request.size(); size += 7) {
        RawClient client(r.port());
        ASSERT_TRUE(client.hello());
        client.send(std::span(request).first(size));
    }
    r.expect_serving();
    EXPECT_EQ(count_of(r.server->counters().generations), 0U);
}

TEST(Server, EndsAConnectionWithoutAHelloInTime) {
    ServerOptions options;
    options.timeouts.hello = 50ms;
    const Running r(options);
    RawClient client(r.port());
    const auto failure = client.next_as<Failure>();
    ASSERT_TRUE(failure);
    EXPECT_TRUE(client.is_closed());
}

TEST(Server, RefusesSessionsAboveItsLimits) {
    ServerOptions options;
    options.listen.sessions_per_address_max = 2;
    const Running r(options);
    {
        RawClient first(r.port());
        RawClient second(r.port());
        ASSERT_TRUE(first.hello());
        ASSERT_TRUE(second.hello());
        RawClient third(r.port());
        const auto failure = third.next_as<Failure>();
        ASSERT_TRUE(failure);
        EXPECT_EQ(failure->error.code, ErrorCode::busy);
        EXPECT_TRUE(third.is_closed());
        for (int i = 0; i < 20; ++i) {  // what it sends first must not take the answer away
            RawClient hasty(r.port());
            hasty.send(ClientHello{
                .protocol_version = kProtocolVersion, .client_name = "hasty", .token = {}});
            EXPECT_TRUE(hasty.next_as<Failure>());
        }
    }
    while (r.server->sessions() > 0) {
        std::this_thread::yield();
    }
    r.expect_serving();
}

TEST(Server, WhoLeavesCancelsItsWork) {
    const Running r;
    {
        RawClient client(r.port());
        ASSERT_TRUE(client.hello());
        for (std::uint32_t id = 1; id <= 8; ++id) {
            std::vector<ChunkPos> keys;
            for (std::int32_t i = 0; i < 64; ++i) {
                keys.push_back({.lod = 0, .x = i, .y = 0, .z = static_cast<std::int32_t>(id)});
            }
            client.send(request_of(id, keys));
        }
        ASSERT_TRUE(client.next());
    }
    while (r.server->sessions() > 0) {
        std::this_thread::yield();
    }
    const auto& counters = r.server->counters();
    EXPECT_GT(count_of(counters, &OutcomeCounters::cancelled), 0U);
    EXPECT_LT(count_of(counters.generations), 512U);
    r.expect_serving();
}

TEST(Server, ASlowReaderStillGetsEverything) {
    const Running r;
    RawClient client(r.port());
    ASSERT_TRUE(client.hello());
    std::size_t wanted = 0;
    for (std::uint32_t id = 1; id <= 12; ++id) {
        std::vector<ChunkPos> keys;
        for (std::int32_t i = 0; i < 64; ++i) {
            keys.push_back({.lod = 0, .x = i % 8, .y = 0, .z = i / 8});
        }
        wanted += keys.size();
        client.send(request_of(id, keys));  // and reads nothing yet
    }
    for (std::size_t i = 0; i < wanted; ++i) {
        ASSERT_TRUE(client.next_as<ChunkAnswer>()) << i;
    }
    EXPECT_EQ(count_of(r.server->counters().generations), 64U);
}

TEST(Server, DrainingAnswersWhatIsUnderWayAndSaysGoodbye) {
    Running r;
    RawClient client(r.port());
    RawClient idle(r.port());
    ASSERT_TRUE(client.hello());
    ASSERT_TRUE(idle.hello());
    std::vector<ChunkPos> keys;
    for (std::int32_t i = 0; i < 64; ++i) {
        keys.push_back({.lod = 0, .x = i, .y = 0, .z = -9});
    }
    client.send(request_of(1, keys));
    ASSERT_TRUE(client.next());  // so the request has been read whole
    const std::uint16_t port = r.port();
    std::jthread stopping([&] { r.server->stop(); });
    std::size_t chunks = 1;
    bool goodbye = false;
    while (const auto received = client.next()) {
        chunks += std::holds_alternative<ChunkAnswer>(received->message) ? 1U : 0U;
        goodbye = goodbye || std::holds_alternative<Goodbye>(received->message);
    }
    EXPECT_EQ(chunks, 64U);
    EXPECT_TRUE(goodbye);
    EXPECT_TRUE(client.is_closed());
    const auto farewell = idle.next_as<Goodbye>();
    ASSERT_TRUE(farewell);
    EXPECT_EQ(farewell->code, ErrorCode::draining);
    EXPECT_TRUE(idle.is_closed());
    stopping.join();
    EXPECT_FALSE(RawClient(port).connected());
}

TEST(Server, APortInUseIsAnErrorThatNamesIt) {
    const Running r;
    ServerOptions options = r.options;
    options.listen.endpoint.port = r.port();
    const auto second = Server::start(options, r.log);
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().code, ErrorCode::io_error);
    EXPECT_NE(second.error().message.find(std::to_string(r.port())), std::string::npos);
}

TEST(Server, ItsMemoryBoundIsTheSumOfItsParts) {
    ServerOptions options;
    options.listen.sessions_max = 10;
    options.cache_bytes_max = 1000;
    options.stack_cache_bytes_max = 500;
    const MemoryBound bound = memory_bound_of(options);
    EXPECT_EQ(bound.caches, 1500U);
    EXPECT_GE(bound.sessions, 10 * (kOutboxBytesMax + kInboundFrameBytesMax));
    EXPECT_EQ(bound.sum(),
              bound.caches + bound.store + bound.workers + bound.sessions + bound.queue);
}

}  // namespace
}  // namespace terrane
