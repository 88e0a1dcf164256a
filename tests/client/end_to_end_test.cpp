// The client library against a real server in this process: generation, meshing, encoding, store
// and sockets.
#include "client-sample/cpp/chunk_reader.h"
#include "client-sample/cpp/client.h"
#include "server/server.h"
#include "tests/support/test_world.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <limits>
#include <map>
#include <random>
#include <vector>

namespace terrane {
namespace {

using std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto kPatience = 60s;  // sanitizers on a busy machine

class EndToEnd : public testing::Test {
  protected:
    static void SetUpTestSuite() { world_ = load_shipped_world("paper-B3"); }

    static void TearDownTestSuite() { world_.reset(); }

    void SetUp() override {
        ASSERT_NE(world_, nullptr);
        const std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
        data_ = std::filesystem::temp_directory_path() /
                ("terrane_e2e_" + std::to_string(::getpid()) + "_" + name);
    }

    void TearDown() override { std::filesystem::remove_all(data_); }

    std::unique_ptr<Server> start(StoreKind store = StoreKind::memory, std::size_t workers = 2) {
        auto server = Server::start({.world = world_,
                                     .listen = {.endpoint = {.address = "127.0.0.1", .port = 0},
                                                .io_threads = 1,
                                                .sessions_max = kSessionsMax,
                                                .sessions_per_address_max = kSessionsPerAddressMax,
                                                .tick = 1000ms,
                                                .on_event = {}},
                                     .timeouts = {},
                                     .workers = workers,
                                     .cache_bytes_max = std::size_t{64} << 20U,
                                     .stack_cache_bytes_max = std::size_t{16} << 20U,
                                     .store = store,
                                     .data_directory = data_},
                                    log_);
        if (!server) {
            ADD_FAILURE() << server.error().message;
            return nullptr;
        }
        return std::move(*server);
    }

    static Client connect(const Server& server) {
        auto client = Client::connect({.host = "127.0.0.1",
                                       .port = server.endpoint().port,
                                       .timeout = 30s,
                                       .client_name = "end_to_end_test",
                                       .token = {}});
        EXPECT_TRUE(client) << client.error().message;
        return std::move(client.value());
    }

    static std::shared_ptr<const World> world_;

  private:
    Log log_{LogFormat::text, LogLevel::off};
    std::filesystem::path data_;
};

std::shared_ptr<const World> EndToEnd::world_;

/// Everything that comes until all is answered; a key that fails fails the test.
std::map<ChunkPos, ReceivedChunk> fetch(Client& client, std::span<const ChunkPos> keys,
                                        ChunkFormat format) {
    std::map<ChunkPos, ReceivedChunk> chunks;
    EXPECT_TRUE(client.request(keys, format));
    const Deadline deadline = steady_clock::now() + kPatience;
    while (client.unanswered() > 0) {
        const auto event = client.next(deadline);
        if (!event || !*event) {
            ADD_FAILURE() << (event ? "nothing came in time" : event.error().message);
            break;
        }
        if (const auto* chunk = std::get_if<ReceivedChunk>(&**event)) {
            chunks.emplace(chunk->answer.key, *chunk);
        } else if (const auto* failure = std::get_if<Failure>(&**event)) {
            ADD_FAILURE() << failure->error.message;
        }
    }
    return chunks;
}

/// Above, at and below the ground, on both sides of the origin.
std::vector<ChunkPos> block_of_keys() {
    std::vector<ChunkPos> keys;
    for (std::int32_t z = -2; z < 2; ++z) {
        for (std::int32_t y = -1; y < 12; ++y) {
            for (std::int32_t x = -3; x < 3; ++x) {
                keys.push_back({.lod = 0, .x = x, .y = y, .z = z});
            }
        }
    }
    return keys;
}

TEST_F(EndToEnd, EveryChunkDecodesInEveryFormat) {
    const auto server = start();
    ASSERT_TRUE(server);
    Client client = connect(*server);
    EXPECT_EQ(client.hello().fingerprint, world_->fingerprint);
    const auto keys = block_of_keys();
    std::size_t triangles = 0;
    std::size_t columns = 0;
    for (const ChunkFormat format :
         {ChunkFormat::draco, ChunkFormat::draco_blocky, ChunkFormat::columns}) {
        const auto chunks = fetch(client, keys, format);
        ASSERT_EQ(chunks.size(), keys.size());
        for (const auto& [key, chunk] : chunks) {
            const auto content = read_chunk(chunk.answer, chunk.payload, client.hello());
            ASSERT_TRUE(content) << content.error().message;
            triangles += content->triangle_count();
            columns += content->chunk ? 1U : 0U;
            EXPECT_EQ(chunk.answer.status == ChunkStatus::full, !chunk.payload.empty());
        }
    }
    EXPECT_GT(triangles, 1000U);
    EXPECT_GT(columns, 20U);
}

TEST_F(EndToEnd, TwoServersAskedInOtherOrdersGiveTheSameBytes) {
    const auto first = start(StoreKind::memory, 1);
    const auto second = start(StoreKind::memory, 3);
    ASSERT_TRUE(first && second);
    Client first_client = connect(*first);
    Client second_client = connect(*second);
    auto keys = block_of_keys();
    for (const ChunkFormat format : {ChunkFormat::draco, ChunkFormat::columns}) {
        const auto expected = fetch(first_client, keys, format);
        std::shuffle(keys.begin(), keys.end(), std::mt19937(7));
        const auto shuffled = fetch(second_client, keys, format);
        ASSERT_EQ(expected.size(), shuffled.size());
        for (const auto& [key, chunk] : expected) {
            const ReceivedChunk& other = shuffled.at(key);
            EXPECT_EQ(chunk.payload, other.payload) << key.x << "," << key.y << "," << key.z;
            EXPECT_EQ(chunk.answer.etag, other.answer.etag);
            EXPECT_EQ(chunk.answer.status, other.answer.status);
        }
    }
}

TEST_F(EndToEnd, ManyClientsAskingOneColdChunkCauseOneGeneration) {
    constexpr int kClients = 200;
    const auto server = start();
    ASSERT_TRUE(server);
    std::vector<Client> clients;
    for (int i = 0; i < kClients; ++i) {
        clients.push_back(connect(*server));
    }
    const std::vector<ChunkPos> keys = {{.lod = 0, .x = 5, .y = 1, .z = -9}};
    for (Client& client : clients) {
        ASSERT_TRUE(client.request(keys, ChunkFormat::draco));
    }
    std::optional<Bytes> payload;
    for (Client& client : clients) {
        const auto event = client.next(steady_clock::now() + kPatience);
        ASSERT_TRUE(event && *event);
        const auto* chunk = std::get_if<ReceivedChunk>(&**event);
        ASSERT_NE(chunk, nullptr);
        EXPECT_EQ(payload.value_or(chunk->payload), chunk->payload);
        payload = chunk->payload;
    }
    EXPECT_EQ(count_of(server->counters().generations), 1U);
}

TEST_F(EndToEnd, AfterARestartTheStoreAnswers) {
    const auto keys = block_of_keys();
    std::map<ChunkPos, ReceivedChunk> before;
    {
        const auto server = start(StoreKind::rocksdb);
        ASSERT_TRUE(server);
        Client client = connect(*server);
        before = fetch(client, keys, ChunkFormat::draco);
        const auto again = fetch(client, keys, ChunkFormat::draco);
        EXPECT_TRUE(std::ranges::all_of(again, [](const auto& chunk) {
            return chunk.second.answer.source == ChunkSource::cache;
        }));
        server->stop();
    }
    const auto server = start(StoreKind::rocksdb);
    ASSERT_TRUE(server);
    Client client = connect(*server);
    const auto after = fetch(client, keys, ChunkFormat::draco);
    EXPECT_EQ(count_of(server->counters().generations), 0U);
    ASSERT_EQ(after.size(), before.size());
    for (const auto& [key, chunk] : after) {
        EXPECT_EQ(chunk.payload, before.at(key).payload);
        if (chunk.answer.status == ChunkStatus::full) {
            EXPECT_EQ(chunk.answer.source, ChunkSource::store);
        }
    }
}

TEST_F(EndToEnd, ExtremeCoordinatesGetAnAnswerAndTheServerGoesOn) {
    const auto server = start();
    ASSERT_TRUE(server);
    Client client = connect(*server);
    constexpr std::int32_t kLeast = std::numeric_limits<std::int32_t>::min();
    constexpr std::int32_t kMost = std::numeric_limits<std::int32_t>::max();
    std::vector<ChunkPos> keys;
    for (const std::int32_t lod : {0, 1, 17, 18, -1, kLeast, kMost}) {
        for (const std::int32_t value : {kLeast, kMost}) {
            keys.push_back({.lod = lod, .x = value, .y = value, .z = value});
            keys.push_back({.lod = lod, .x = value, .y = 0, .z = value});
        }
    }
    ASSERT_TRUE(client.request(keys, ChunkFormat::draco));
    std::map<ChunkPos, bool> is_served;
    while (client.unanswered() > 0) {
        const auto event = client.next(steady_clock::now() + kPatience);
        ASSERT_TRUE(event && *event);
        if (const auto* chunk = std::get_if<ReceivedChunk>(&**event)) {
            EXPECT_TRUE(read_chunk(chunk->answer, chunk->payload, client.hello()));
            is_served[chunk->answer.key] = true;
        } else if (const auto* failure = std::get_if<Failure>(&**event)) {
            EXPECT_FALSE(failure->error.message.empty());
            is_served[failure->key.value()] = false;
        }
    }
    EXPECT_EQ(is_served.size(), keys.size());
    for (const auto& [key, served] : is_served) {
        const bool is_level = key.lod >= 0 && key.lod < client.hello().levels;
        EXPECT_FALSE(served && !is_level) << key.lod;
        EXPECT_TRUE(served || key.lod != 0) << key.x << "," << key.y;
    }
    EXPECT_EQ(fetch(client, std::vector<ChunkPos>{{}}, ChunkFormat::draco).size(), 1U);
}

TEST_F(EndToEnd, ColumnsAndTheWorldFileAreTold) {
    const auto server = start();
    ASSERT_TRUE(server);
    Client client = connect(*server);
    ASSERT_TRUE(client.query_column({.x = -7, .z = 1'000'000'000'000}));
    ASSERT_TRUE(client.query_column({.x = kColumnCoordinateLimit, .z = 0}));
    ASSERT_TRUE(client.query_world());
    int answers = 0;
    while (client.unanswered() > 0) {
        const auto event = client.next(steady_clock::now() + kPatience);
        ASSERT_TRUE(event && *event);
        ++answers;
        if (const auto* column = std::get_if<ColumnAnswer>(&**event)) {
            EXPECT_EQ(column->column, (ColumnPos{.x = -7, .z = 1'000'000'000'000}));
            EXPECT_GT(column->limits.size(), 1U);
            EXPECT_TRUE(std::ranges::is_sorted(column->limits, {}, &WireLimit::y256));
        } else if (const auto* world = std::get_if<WorldAnswer>(&**event)) {
            EXPECT_EQ(world->fingerprint, world_->fingerprint);
            const auto parsed = parse_world_file(world->toml, "received", {});
            ASSERT_TRUE(parsed.ok());
            EXPECT_EQ(world_fingerprint(parsed.definition), client.hello().fingerprint);
        } else if (const auto* failure = std::get_if<Failure>(&**event)) {
            EXPECT_EQ(failure->error.code, ErrorCode::out_of_range);
        }
    }
    EXPECT_EQ(answers, 3);
}

/// Sends bytes as they are and reads until the server closes.
Bytes converse(std::uint16_t port, std::span<const std::byte> bytes) {
    const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(port);
    EXPECT_EQ(::connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    ::shutdown(socket, SHUT_WR);
    Bytes received;
    std::array<std::byte, 4096> piece{};
    for (auto size = ::recv(socket, piece.data(), piece.size(), 0); size > 0;
         size = ::recv(socket, piece.data(), piece.size(), 0)) {
        received.insert(received.end(), piece.begin(), piece.begin() + size);
    }
    ::close(socket);
    return received;
}

/// The first Failure in what a server sent.
std::optional<Failure> failure_in(std::span<const std::byte> bytes) {
    FrameReader reader(kOutboundFrameLimits);
    reader.feed(bytes);
    for (auto frame = reader.next(); frame && *frame; frame = reader.next()) {
        const auto message = decode_message(**frame);
        if (message && std::holds_alternative<Failure>(*message)) {
            return std::get<Failure>(*message);
        }
    }
    return std::nullopt;
}

TEST_F(EndToEnd, BadInputIsAnsweredByAClearErrorAndTheServerGoesOn) {
    const auto server = start();
    ASSERT_TRUE(server);
    const std::uint16_t port = server->endpoint().port;
    ClientHello hello{.protocol_version = kProtocolVersion, .client_name = "bad", .token = {}};
    Bytes wrong_identifier = encode_message(hello);
    wrong_identifier[12] = std::byte{'X'};
    hello.protocol_version = 99;
    const Bytes wrong_version = encode_message(hello);
    hello.protocol_version = kProtocolVersion;
    Bytes too_many_keys = encode_message(hello);
    ByteWriter(too_many_keys)
        .raw(encode_message(ChunkRequest{.request_id = 9,
                                         .format = ChunkFormat::draco,
                                         .keys = std::vector<ChunkPos>(65),
                                         .known_etags = {},
                                         .priority = 0,
                                         .without_flow = false}));
    Bytes oversize = encode_message(hello);
    ByteWriter(oversize).fixed(std::uint32_t{0x8000'0000});
    const auto code_of = [&](const Bytes& bytes) {
        const auto failure = failure_in(converse(port, bytes));
        return failure ? failure->error.code : static_cast<ErrorCode>(0);
    };
    EXPECT_EQ(code_of(wrong_identifier), ErrorCode::malformed);
    EXPECT_EQ(code_of(wrong_version), ErrorCode::version_mismatch);
    EXPECT_EQ(code_of(oversize), ErrorCode::too_large);
    const auto refused = failure_in(converse(port, too_many_keys));
    ASSERT_TRUE(refused);
    EXPECT_EQ(refused->error.code, ErrorCode::invalid_argument);
    EXPECT_EQ(refused->request_id, 9U);
    const Bytes whole = encode_message(hello);
    for (std::size_t size = 0; size < whole.size(); ++size) {
        converse(port, std::span(whole).first(size));
    }
    Client client = connect(*server);
    EXPECT_EQ(fetch(client, std::vector<ChunkPos>{{}}, ChunkFormat::columns).size(), 1U);
}

}  // namespace
}  // namespace terrane
