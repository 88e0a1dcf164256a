// Who gets into a server and how: TLS and tokens on both ports, tried by the client library, by
// openssl and by curl.
#include "client-sample/cpp/client.h"
#include "client-sample/cpp/program/load.h"
#include "client-sample/cpp/program/program.h"
#include "protocol/wire/frame.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"
#include "server/net/tokens.h"
#include "server/server.h"
#include "tests/server/http_client.h"
#include "tests/support/test_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <thread>

namespace terrane {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::Not;

/// What a command prints, errors too.
std::string output_of(const std::string& command) {
    std::FILE* pipe = ::popen((command + " 2>&1 </dev/null").c_str(), "r");
    std::string out;
    std::array<char, 4096> buffer{};
    while (const std::size_t got = std::fread(buffer.data(), 1, buffer.size(), pipe)) {
        out.append(buffer.data(), got);
    }
    ::pclose(pipe);
    return out;
}

class Doors : public testing::Test {
  protected:
    static void SetUpTestSuite() { world_ = load_shipped_world("paper-B2"); }

    static void TearDownTestSuite() { world_.reset(); }

    void SetUp() override {
        std::string name =
            (std::filesystem::temp_directory_path() / "terrane-doors-XXXXXX").string();
        ASSERT_NE(::mkdtemp(name.data()), nullptr);
        folder_ = name;
    }

    void TearDown() override { std::filesystem::remove_all(folder_); }

    std::string path(const std::string& name) const { return (folder_ / name).string(); }

    /// cert.pem and key.pem, for 127.0.0.1.
    void make_certificate(const std::string& common_name) const {
        const std::string out = output_of(
            "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 "
            "-subj /CN=" +
            common_name + " -addext subjectAltName=IP:127.0.0.1 -keyout " + path("key.pem") +
            " -out " + path("cert.pem"));
        ASSERT_TRUE(std::filesystem::exists(path("cert.pem"))) << out;
    }

    ServerOptions plain_options() const {
        ServerOptions options;
        options.world = world_;
        options.listen.endpoint = {.address = "127.0.0.1", .port = 0};
        options.http = Endpoint{.address = "127.0.0.1", .port = 0};
        options.listen.tick = 20ms;
        options.store = StoreKind::memory;
        return options;
    }

    ServerOptions tls_options() const {
        ServerOptions options = plain_options();
        options.tls = {.certificate = path("cert.pem"), .key = path("key.pem")};
        return options;
    }

    std::unique_ptr<Server> start(const ServerOptions& options) {
        auto server = Server::start(options, log_);
        EXPECT_TRUE(server) << server.error().message;
        return server ? *std::move(server) : nullptr;
    }

    static Result<Client> connect(const Server& server, const TlsUse& tls,
                                  const std::string& token = {}) {
        return Client::connect({.host = "127.0.0.1",
                                .port = server.endpoint().port,
                                .timeout = 20s,
                                .client_name = "doors_test",
                                .token = token,
                                .tls = tls});
    }

    static std::string s_client(std::uint16_t port, const std::string& flags) {
        return output_of("timeout 20 openssl s_client -connect 127.0.0.1:" + std::to_string(port) +
                         " " + flags);
    }

    static std::shared_ptr<const World> world_;
    Log log_{LogFormat::text, LogLevel::off};
    std::filesystem::path folder_;
};

std::shared_ptr<const World> Doors::world_;

TEST_F(Doors, SpeakTlsOnBothPorts) {
    make_certificate("first");
    const auto server = start(tls_options());
    ASSERT_TRUE(server);
    auto client = connect(*server, {.enabled = true, .ca_file = path("cert.pem")});
    ASSERT_TRUE(client) << client.error().message;
    std::vector<ChunkPos> keys;
    for (std::int32_t i = 0; i < 64; ++i) {
        keys.push_back({.lod = 0, .x = i % 8, .y = i / 32, .z = i / 8 % 4});
    }
    ASSERT_TRUE(client->request(keys, ChunkFormat::columns));
    while (client->unanswered() > 0) {
        const auto event = client->next(std::chrono::steady_clock::now() + 60s);
        ASSERT_TRUE(event && *event);
        const auto* chunk = std::get_if<ReceivedChunk>(&**event);
        ASSERT_NE(chunk, nullptr);
        if (chunk->answer.status == ChunkStatus::full) {
            EXPECT_EQ(hash128(chunk->payload), chunk->answer.etag);
        }
    }
    EXPECT_FALSE(connect(*server, {})) << "no TLS";
    EXPECT_FALSE(connect(*server, {.enabled = true})) << "a certificate that nobody signed";
    const std::string url = "https://127.0.0.1:" + std::to_string(server->http_endpoint()->port);
    EXPECT_EQ(output_of("curl -s --cacert " + path("cert.pem") + " " + url + "/healthz"), "ok\n");
    EXPECT_THAT(output_of("curl -s --cacert " + path("cert.pem") + " " + url + "/v1/world"),
                HasSubstr("\"paper-B2\""));
}

TEST_F(Doors, RefuseWhatIsOlderThanTls12) {
    make_certificate("first");
    const auto server = start(tls_options());
    ASSERT_TRUE(server);
    for (const std::uint16_t port : {server->endpoint().port, server->http_endpoint()->port}) {
        for (const char* old : {"-tls1", "-tls1_1"}) {
            const std::string out =
                s_client(port, std::string(old) + " -cipher DEFAULT@SECLEVEL=0");
            EXPECT_THAT(out, HasSubstr("alert protocol version")) << old;
        }
        EXPECT_THAT(s_client(port, "-tls1_2"), HasSubstr("Protocol  : TLSv1.2"));
        EXPECT_THAT(s_client(port, "-tls1_3"), HasSubstr("New, TLSv1.3"));
    }
}

TEST_F(Doors, TakeANewCertificateAndKeepTheOldOneIfItIsBad) {
    make_certificate("first");
    const auto server = start(tls_options());
    ASSERT_TRUE(server);
    const std::uint16_t port = server->http_endpoint()->port;
    EXPECT_THAT(s_client(port, ""), HasSubstr("CN = first"));
    make_certificate("second");
    EXPECT_THAT(s_client(port, ""), HasSubstr("CN = first"));
    server->reload();
    EXPECT_THAT(s_client(port, ""), HasSubstr("CN = second"));
    std::ofstream(path("cert.pem")) << "no certificate";
    server->reload();
    EXPECT_THAT(s_client(port, ""), HasSubstr("CN = second"));
    std::filesystem::remove(path("key.pem"));
    server->reload();
    EXPECT_THAT(s_client(port, ""), HasSubstr("CN = second"));
    const auto broken = Server::start(tls_options(), log_);
    ASSERT_FALSE(broken);
    EXPECT_THAT(broken.error().message, HasSubstr("cert.pem"));
}

TEST_F(Doors, CloseOnWhoDoesNotShakeHands) {
    make_certificate("first");
    ServerOptions options = tls_options();
    options.listen.tls_handshake = 50ms;
    const auto server = start(options);
    ASSERT_TRUE(server);
    HttpClient silent(server->http_endpoint()->port);
    EXPECT_TRUE(silent.is_closed());
    HttpClient plain(server->http_endpoint()->port);
    plain.send("GET / HTTP/1.1\r\nHost: a\r\n\r\n");
    EXPECT_THAT(plain.take(1000), Not(HasSubstr("HTTP")));
    EXPECT_TRUE(plain.is_closed());
    while (server->sessions() > 0) {
        std::this_thread::yield();
    }
}

/// A small load: three viewers for a moment.
LoadOptions small_load(const Server& server, CarrierKind carrier) {
    LoadOptions options;
    options.host = "127.0.0.1";
    options.port =
        carrier == CarrierKind::tcp ? server.endpoint().port : server.http_endpoint()->port;
    options.carrier = carrier;
    options.clients = 3;
    options.seconds = 0.3;
    options.ramp_seconds = 0;
    options.check_every = 10;
    options.client.radius_chunks = {1};
    options.client.by_view = carrier != CarrierKind::http;
    options.client.patience = 20s;
    return options;
}

constexpr std::array kCarriers = {CarrierKind::tcp, CarrierKind::web_socket, CarrierKind::http};

TEST_F(Doors, LoadComesInByTlsOnAllWays) {
    make_certificate("first");
    const auto server = start(tls_options());
    ASSERT_TRUE(server);
    for (const CarrierKind carrier : kCarriers) {
        LoadOptions options = small_load(*server, carrier);
        options.tls = {.enabled = true, .ca_file = path("cert.pem")};
        const auto result = run_load(options, [](const std::string&) {});
        ASSERT_TRUE(result) << result.error().message;
        EXPECT_TRUE(result->is_good()) << load_text(*result);
        EXPECT_GE(result->chunks, 3U * 9U) << load_text(*result);
        EXPECT_GT(result->checked, 0U) << load_text(*result);
    }
    for (const TlsUse& tls :
         {TlsUse{}, TlsUse{.enabled = true}}) {  // the system trusts nobody here
        LoadOptions options = small_load(*server, CarrierKind::tcp);
        options.tls = tls;
        const auto result = run_load(options, [](const std::string&) {});
        ASSERT_TRUE(result) << result.error().message;
        EXPECT_EQ(result->disconnected, 3U) << load_text(*result);
        EXPECT_EQ(result->chunks, 0U);
    }
    LoadOptions options = small_load(*server, CarrierKind::tcp);
    options.tls = {.enabled = true, .ca_file = path("missing.pem")};
    const auto result = run_load(options, [](const std::string&) {});
    ASSERT_FALSE(result);
    EXPECT_THAT(result.error().message, HasSubstr("missing.pem"));
}

TEST_F(Doors, LoadTakesTheFlagsOfTls) {
    make_certificate("first");
    const auto server = start(tls_options());
    ASSERT_TRUE(server);
    const std::string at = "127.0.0.1:" + std::to_string(server->endpoint().port);
    const std::string ca = path("cert.pem");
    std::vector<const char*> arguments = {
        "terrane-client", "load", "--server", at.c_str(), "--clients", "1", "--seconds", "0.2",
        "--radius",       "1",    "--tls",    "--ca",     ca.c_str()};
    EXPECT_EQ(run_client_program(static_cast<int>(arguments.size()), arguments.data()), 0);
    arguments.resize(arguments.size() - 2);
    EXPECT_EQ(run_client_program(static_cast<int>(arguments.size()), arguments.data()), 1)
        << "a certificate that nobody signed";
}

/// A server that wants tokens: "right" is good, "late" has expired.
class TokenDoors : public Doors {
  protected:
    void SetUp() override {
        Doors::SetUp();
        TokenEntry right{
            .name = "right", .hash = sha256_of("right"), .expires = {}, .world = {}, .caps = {}};
        right.caps.credit_window_bytes = 8192;
        TokenEntry late{
            .name = "late", .hash = sha256_of("late"), .expires = {}, .world = {}, .caps = {}};
        late.expires = std::chrono::sys_seconds(1s);
        ASSERT_TRUE(add_token(path("tokens.toml"), right));
        ASSERT_TRUE(add_token(path("tokens.toml"), late));
        ServerOptions options = plain_options();
        options.token_file = path("tokens.toml");
        server_ = start(options);
        ASSERT_TRUE(server_);
    }

    /// Whether a WebSocket at `target` and the hello's token let one in.
    std::string websocket(const std::string& target, const std::string& token) const {
        HttpClient client(server_->http_endpoint()->port);
        const auto reply =
            client.get(target,
                       "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                       "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n");
        if (!reply || reply->status != 101) {
            return "refused";
        }
        const Bytes hello = encode_message(
            ClientHello{.protocol_version = kProtocolVersion, .client_name = "ws", .token = token});
        std::string frame = "\x82";
        frame += static_cast<char>(0x80U | hello.size());
        frame += std::string(4, '\0');
        frame += text_of(hello);
        EXPECT_LT(hello.size(), 126U);
        client.send(frame);
        // A binary frame's head has 2 bytes, or 4 if it is longer than 125.
        std::string answer = client.take(4);
        const bool is_long = answer.size() == 4 && static_cast<unsigned char>(answer[1]) == 126;
        const std::size_t size = is_long ? static_cast<unsigned char>(answer[2]) * 256U +
                                               static_cast<unsigned char>(answer[3])
                                         : static_cast<unsigned char>(answer[1]) - 2U;
        answer = is_long ? client.take(size) : answer.substr(2) + client.take(size);
        FrameReader reader{kOutboundFrameLimits};
        reader.feed(bytes_of(answer));
        const auto got = reader.next();
        const auto message = got && *got ? decode_message(**got) : fail(ErrorCode::malformed, "");
        EXPECT_TRUE(message);
        const auto* failure = message ? std::get_if<Failure>(&*message) : nullptr;
        EXPECT_TRUE(failure == nullptr || failure->error.code == ErrorCode::unauthorized);
        return failure != nullptr ? "refused" : "welcome";
    }

    std::unique_ptr<Server> server_;
};

TEST_F(TokenDoors, LetGoodTokensInOnAllWaysAndNoOthers) {
    for (const std::string token : {"", "wrong", "late", "right"}) {
        const bool is_good = token == "right";
        const auto native = connect(*server_, {}, token);
        EXPECT_EQ(native.has_value(), is_good) << token;
        if (native) {
            EXPECT_EQ(native->hello().limits.credit_window_bytes, 8192U);
        } else {
            EXPECT_EQ(native.error().code, ErrorCode::unauthorized) << native.error().message;
        }
        HttpClient http(server_->http_endpoint()->port);
        const std::string header =
            token.empty() ? std::string() : "Authorization: Bearer " + token + "\r\n";
        const auto by_header = http.get("/v1/world", header);
        const auto by_query = http.get("/v1/world?token=" + token);
        ASSERT_TRUE(by_header && by_query);
        EXPECT_EQ(by_header->status, is_good ? 200U : 401U) << token;
        EXPECT_EQ(by_query->status, is_good ? 200U : 401U) << token;
        if (!is_good) {
            EXPECT_EQ(by_header->header("www-authenticate"), "Bearer");
        }
        EXPECT_EQ(websocket("/ws", token), is_good ? "welcome" : "refused") << token;
        EXPECT_EQ(websocket("/ws?token=" + token, ""), is_good ? "welcome" : "refused") << token;
    }
    HttpClient http(server_->http_endpoint()->port);
    for (const char* open : {"/healthz", "/readyz", "/"}) {
        const auto reply = http.get(open);
        ASSERT_TRUE(reply);
        EXPECT_EQ(reply->status, 200U) << open;
    }
    const auto metrics = http.get("/metrics");
    ASSERT_TRUE(metrics);
    EXPECT_EQ(metrics->status, 401U);
}

TEST_F(TokenDoors, LetALoadInByItsToken) {
    for (const CarrierKind carrier : kCarriers) {
        LoadOptions options = small_load(*server_, carrier);
        options.client.token = "right";
        const auto good = run_load(options, [](const std::string&) {});
        ASSERT_TRUE(good) << good.error().message;
        EXPECT_TRUE(good->is_good()) << load_text(*good);
        EXPECT_GE(good->chunks, 3U * 9U);
        options.client.token = "wrong";
        const auto bad = run_load(options, [](const std::string&) {});
        ASSERT_TRUE(bad) << bad.error().message;
        EXPECT_EQ(bad->disconnected, 3U) << load_text(*bad);
    }
}

TEST_F(TokenDoors, ReadTheFileAgain) {
    ASSERT_TRUE(add_token(
        path("tokens.toml"),
        {.name = "new", .hash = sha256_of("new"), .expires = {}, .world = {}, .caps = {}}));
    EXPECT_FALSE(connect(*server_, {}, "new"));
    server_->reload();
    EXPECT_TRUE(connect(*server_, {}, "new"));
    std::ofstream(path("tokens.toml")) << "[[token]]\n";
    server_->reload();
    EXPECT_TRUE(connect(*server_, {}, "new"));
}

}  // namespace
}  // namespace terrane
