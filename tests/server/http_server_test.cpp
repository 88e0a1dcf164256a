// The HTTP port of a whole server, talked to in bytes.
#include "generator/mesh/draco_codec.h"
#include "generator/mesh/glb.h"
#include "generator/world/world_file.h"
#include "server/chunks/build_chunk.h"
#include "server/server.h"
#include "tests/server/http_client.h"
#include "tests/server/raw_client.h"
#include "tests/support/test_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <thread>

namespace terrane {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

struct Running {
    explicit Running(ServerOptions changed = {}) : options(std::move(changed)) {
        options.world = load_shipped_world("paper-B2");
        options.listen.endpoint = {.address = "127.0.0.1", .port = 0};
        options.http = Endpoint{.address = "127.0.0.1", .port = 0};
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
        prefix = "/v1/w/" + to_hex(content_id_of(*options.world));
    }

    std::uint16_t port() const { return server->http_endpoint()->port; }

    void expect_serving() const {
        HttpClient client(port());
        const auto reply = client.get("/healthz");
        ASSERT_TRUE(reply);
        EXPECT_EQ(reply->status, 200U);
    }

    ServerOptions options;
    const Log log{LogFormat::text, LogLevel::error};
    std::unique_ptr<Server> server;
    std::string prefix;
};

TEST(HttpServer, GivesTheBytesThatTheNativeProtocolGives) {
    const Running r;
    RawClient native(r.server->endpoint().port);
    ASSERT_TRUE(native.hello());
    HttpClient client(r.port());
    int full = 0;
    for (const auto& [format, ending] : {std::pair(ChunkFormat::draco, ".drc"),
                                         std::pair(ChunkFormat::draco_blocky, ".blocky.drc"),
                                         std::pair(ChunkFormat::columns, ".columns")}) {
        for (const int y : {-9, 0, 1, 2, 3, 4, 99}) {
            ChunkRequest request;
            request.request_id = 1;
            request.format = format;
            request.keys = {{.lod = 0, .x = -3, .y = y, .z = 5}};
            native.send(request);
            const auto expected = native.next();
            ASSERT_TRUE(expected);
            const auto& chunk = std::get<ChunkAnswer>(expected->message);
            const auto reply =
                client.get(r.prefix + "/chunks/0/-3/" + std::to_string(y) + "/5" + ending);
            ASSERT_TRUE(reply);
            EXPECT_EQ(reply->status, 200U);
            EXPECT_EQ(reply->body, text_of(expected->payload));
            EXPECT_EQ(reply->header("etag"), "\"" + to_hex(chunk.etag) + "\"");
            EXPECT_EQ(reply->header("cache-control"), "public, max-age=31536000, immutable");
            EXPECT_EQ(reply->header("access-control-allow-origin"), "*");
            const std::string status = reply->header("terrane-status");
            switch (chunk.status) {
                case ChunkStatus::empty:
                    EXPECT_EQ(status, "empty");
                    break;
                case ChunkStatus::uniform:
                    EXPECT_TRUE(status.starts_with("uniform; material=")) << status;
                    break;
                default:
                    EXPECT_EQ(status, "");
                    ++full;
            }
            const auto again =
                client.get(r.prefix + "/chunks/0/-3/" + std::to_string(y) + "/5" + ending,
                           "If-None-Match: " + reply->header("etag") + "\r\n");
            ASSERT_TRUE(again);
            EXPECT_EQ(again->status, 304U);
            EXPECT_EQ(again->body, "");
            EXPECT_EQ(again->header("content-length"), "");
            EXPECT_EQ(again->header("etag"), reply->header("etag"));
        }
    }
    EXPECT_GE(full, 3);
}

TEST(HttpServer, AnswersPipelinedRequestsInOrder) {
    const Running r;
    HttpClient client(r.port());
    std::string requests;
    for (int i = 0; i < 200; ++i) {
        requests += "GET " + r.prefix + "/columns/" + std::to_string(i) +
                    "/0.json HTTP/1.1\r\nHost: a\r\n\r\n";
    }
    std::jthread sending([&] { client.send(requests); });
    for (int i = 0; i < 200; ++i) {
        const auto reply = client.reply();
        ASSERT_TRUE(reply) << i;
        EXPECT_EQ(nlohmann::json::parse(reply->body)["x"], i);
    }
}

TEST(HttpServer, AnswersWhatCameBeforeAHalfCloseThenCloses) {
    const Running r;
    for (int i = 0; i < 20; ++i) {
        HttpClient client(r.port());
        std::string requests;
        for (int request = 0; request < 3; ++request) {
            requests += "GET " + r.prefix + "/columns/" + std::to_string(i * 100 + request) +
                        "/0.json HTTP/1.1\r\nHost: a\r\n\r\n";
        }
        client.send(requests);
        client.end_sending();
        for (int request = 0; request < 3; ++request) {
            auto reply = client.reply();
            while (reply && reply->status == 100) {
                reply = client.reply();
            }
            ASSERT_TRUE(reply) << i;
            EXPECT_EQ(reply->status, 200U);
            EXPECT_EQ(nlohmann::json::parse(reply->body)["x"], i * 100 + request);
        }
        EXPECT_TRUE(client.is_closed());
    }
}

TEST(HttpServer, WhoClosesTakesTheQuestionBack) {
    const Running r;
    const auto section = [&r](int z) {
        return "GET " + r.prefix + "/sections/0," + std::to_string(z) + "/4000," +
               std::to_string(z) + ".png HTTP/1.1\r\nHost: a\r\n\r\n";
    };
    std::vector<std::unique_ptr<HttpClient>> others;  // keep both workers busy for a while
    for (int i = 0; i < 8; ++i) {
        others.push_back(std::make_unique<HttpClient>(r.port()));
        others.back()->send(section(i));
    }
    HttpClient watching(r.port());
    const auto sees = [&watching](std::string_view line) {
        const auto reply = watching.get("/metrics");
        return reply && reply->body.find(line) != std::string::npos;
    };
    {
        HttpClient(r.port()).send(section(99));
    }
    while (!sees("terrane_requests_total{kind=\"section\",outcome=\"cancelled\"} 1\n")) {
        ASSERT_FALSE(sees("terrane_requests_total{kind=\"section\",outcome=\"generated\"} 9\n"));
        std::this_thread::yield();
    }
}

TEST(HttpServer, GivesColumnsWithoutFlow) {
    const Running r;
    RawClient native(r.server->endpoint().port);
    ASSERT_TRUE(native.hello());
    HttpClient client(r.port());
    const std::string path = r.prefix + "/chunks/0/0/0/0.columns";
    for (const bool without : {false, true}) {
        ChunkRequest request;
        request.request_id = 1;
        request.format = ChunkFormat::columns;
        request.without_flow = without;
        request.keys = {{.lod = 0, .x = 0, .y = 0, .z = 0}};
        native.send(request);
        const auto expected = native.next();
        ASSERT_TRUE(expected);
        const auto reply = client.get(path + (without ? "?flow=0" : "?flow=1"));
        ASSERT_TRUE(reply);
        EXPECT_EQ(reply->status, 200U);
        EXPECT_EQ(reply->body, text_of(expected->payload));
        EXPECT_EQ(reply->header("cache-control"), "public, max-age=31536000, immutable");
        EXPECT_EQ(reply->header("etag"),
                  "\"" + to_hex(std::get<ChunkAnswer>(expected->message).etag) + "\"");
        EXPECT_EQ(client.get(path)->header("etag") == reply->header("etag"), !without);
    }
    EXPECT_EQ(client.get(path + "?flow=no")->status, 400U);
    EXPECT_EQ(client.get("/v1/chunks/0/0/0/0.columns?flow=0")->header("location"),
              path + "?flow=0");
}

TEST(HttpServer, AGlbIsAFileWithoutASurfaceToo) {
    const Running r;
    HttpClient client(r.port());
    const std::string empty(text_of(empty_glb()));
    for (const int y : {-1, 99}) {
        const auto reply = client.get(r.prefix + "/chunks/0/0/" + std::to_string(y) + "/0.glb");
        ASSERT_TRUE(reply);
        EXPECT_EQ(reply->status, 200U);
        EXPECT_EQ(reply->header("content-type"), "model/gltf-binary");
        EXPECT_EQ(reply->body, empty);
        EXPECT_EQ(reply->header("etag"), "\"" + to_hex(hash128(bytes_of(empty))) + "\"");
        EXPECT_NE(reply->header("terrane-status"), "");
    }
}

TEST(HttpServer, DescribesItsWorld) {
    const Running r;
    HttpClient client(r.port());
    const auto reply = client.get("/v1/world");
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->header("content-type"), "application/json");
    EXPECT_EQ(reply->header("cache-control"), "no-cache");
    const auto world = nlohmann::json::parse(reply->body);
    EXPECT_EQ(world["fingerprint"], to_hex(r.options.world->fingerprint));
    EXPECT_EQ(world["content_id"], to_hex(content_id_of(*r.options.world)));
    EXPECT_EQ(world["materials"].size(), r.options.world->definition.materials.size());
    EXPECT_EQ(world["mesh_parts"], r.options.world->definition.has_landscape());
    for (std::size_t i = 0; i < world["materials"].size(); ++i) {
        EXPECT_EQ(world["materials"][i]["kind"],
                  to_string(r.options.world->definition.materials[i].kind));
    }
    const auto file = client.get(std::string(world["links"]["world_file"]));
    ASSERT_TRUE(file);
    EXPECT_EQ(file->body, canonical_world_file(r.options.world->definition));
    const auto page = client.get("/");
    ASSERT_TRUE(page);
    EXPECT_THAT(page->body, HasSubstr("/v1/world"));
    EXPECT_EQ(page->header("content-type"), "text/html; charset=utf-8");
}

TEST(HttpServer, CountsWhatItDoes) {
    const Running r;
    HttpClient client(r.port());
    const std::string chunk = r.prefix + "/chunks/0/4/0/4.columns";
    ASSERT_TRUE(client.get(chunk));
    ASSERT_TRUE(client.get(chunk));
    ASSERT_TRUE(client.get("/nothing"));
    for (const char* path :
         {"/map/18/131072/131072.png", "/map/18/131072/131072.png", "/sections/0,0/40,0.png",
          "/columns/4/4.json", "/3dtiles/content/17/65536/65536.glb",
          "/3dtiles/content/17/65536/65536.glb", "/chunks/99/0/0/0.drc"}) {
        ASSERT_TRUE(client.get(r.prefix + path)) << path;
    }
    const auto reply = client.get("/metrics");
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->header("content-type"), "text/plain; version=0.0.4; charset=utf-8");
    for (const char* line : {"terrane_requests_total{kind=\"chunk\",outcome=\"cache\"} 1\n",
                             "terrane_requests_total{kind=\"chunk\",outcome=\"generated\"} 1\n",
                             "terrane_requests_total{kind=\"chunk\",outcome=\"failed\"} 0\n",
                             "terrane_requests_total{kind=\"map\",outcome=\"generated\"} 1\n",
                             "terrane_requests_total{kind=\"map\",outcome=\"cache\"} 1\n",
                             "terrane_requests_total{kind=\"section\",outcome=\"generated\"} 1\n",
                             "terrane_requests_total{kind=\"section\",outcome=\"cache\"} 0\n",
                             "terrane_requests_total{kind=\"column\",outcome=\"generated\"} 1\n",
                             "terrane_requests_total{kind=\"tile\",outcome=\"generated\"} 1\n",
                             "terrane_requests_total{kind=\"tile\",outcome=\"cache\"} 1\n",
                             "terrane_requests_total{kind=\"tile\",outcome=\"busy\"} 0\n",
                             "terrane_stage_seconds_count{stage=\"queue\"} 5\n",
                             "terrane_stage_seconds_count{stage=\"generate\"} 1\n",
                             "terrane_sessions 1\n",
                             "terrane_http_answers_total{status=\"2xx\"} 8\n",
                             "terrane_http_answers_total{status=\"4xx\"} 2\n",
                             "terrane_queue_jobs 0\n",
                             "terrane_oldest_in_flight_seconds 0\n",
                             "terrane_credit_stalls_total 0\n",
                             "# TYPE terrane_sent_bytes_total counter\n"}) {
        EXPECT_THAT(reply->body, HasSubstr(line));
    }
}

TEST(HttpServer, HeadIsGetWithoutABody) {
    const Running r;
    HttpClient client(r.port());
    const auto get = client.get("/v1/world");
    const auto head = client.request("HEAD", "/v1/world");
    ASSERT_TRUE(get && head);
    EXPECT_EQ(head->status, 200U);
    EXPECT_EQ(head->header("content-length"), std::to_string(get->body.size()));
    EXPECT_EQ(head->header("etag"), get->header("etag"));
    const auto after = client.get("/healthz");
    ASSERT_TRUE(after);
    EXPECT_EQ(after->body, "ok\n");
    const auto options = client.request("OPTIONS", "/v1/world");
    ASSERT_TRUE(options);
    EXPECT_EQ(options->status, 204U);
    EXPECT_EQ(options->header("access-control-allow-methods"), "GET, HEAD, OPTIONS");
}

TEST(HttpServer, RefusesWhatIsWrongAndGoesOn) {
    const Running r;
    HttpClient client(r.port());
    const auto expect = [&](const std::string& target, unsigned status, const std::string& text) {
        const auto reply = client.get(target);
        ASSERT_TRUE(reply) << target;
        EXPECT_EQ(reply->status, status) << target;
        EXPECT_EQ(reply->header("content-type"), "application/problem+json");
        EXPECT_EQ(reply->header("cache-control"), "no-store");
        const auto body = nlohmann::json::parse(reply->body);
        EXPECT_EQ(body["status"], status);
        EXPECT_THAT(std::string(body["detail"]), HasSubstr(text));
    };
    expect("/nothing", 404, "/nothing");
    expect("/v1/w/ffffffffffffffffffffffffffffffff/world.toml", 404, "content id");
    expect(r.prefix + "/chunks/0/a/0/0.drc", 400, "\"a\"");
    expect(r.prefix + "/chunks/0/2147483648/0/0.drc", 400, "2147483648");
    expect(r.prefix + "/chunks/99/0/0/0.drc", 400, "lod");
    expect(r.prefix + "/chunks/1/0/1/0.drc", 400, "y 1");
    expect(r.prefix + "/chunks/1/0/0/0.blocky.drc", 400, "level");
    expect(r.prefix + "/columns/9007199254740992/0.json", 400, "9007199254740992");
    expect(r.prefix + "/columns/9007199254740990/0.json", 400, "2^31");
    const auto redirect = client.get("/v1/chunks/0/0/0/0.drc?x=1");
    ASSERT_TRUE(redirect);
    EXPECT_EQ(redirect->status, 307U);
    EXPECT_EQ(redirect->header("location"), r.prefix + "/chunks/0/0/0/0.drc?x=1");
    const auto post = client.request("POST", "/v1/world", "Content-Length: 3\r\n\r\nabc");
    ASSERT_TRUE(post);
    EXPECT_EQ(post->status, 405U);
}

TEST(HttpServer, ClosesWhatIsNoHttp) {
    const Running r;
    const std::string host = "Host: a\r\n";
    const std::vector<std::pair<std::string, unsigned>> cases = {
        {"\x16\x03\x01 hello\r\n\r\n", 400},
        {"GET\r\n\r\n", 400},
        {"GET / HTTP/2.0\r\n" + host + "\r\n", 505},
        {"GET / HTTP/1.1\r\n\r\n", 400},
        {"GET /%zz HTTP/1.1\r\n" + host + "\r\n", 400},
        {"GET /%00 HTTP/1.1\r\n" + host + "\r\n", 400},
        {"GET / HTTP/1.1\r\n" + host + "bad header\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\n" + host + "X: " + std::string(9000, 'a') + "\r\n\r\n", 431},
        {"GET /" + std::string(20000, 'a'), 431},
        {"POST / HTTP/1.1\r\n" + host + "Content-Length: 99999999\r\n\r\n", 413},
        {"POST / HTTP/1.1\r\n" + host +
             "Content-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
         400},
        {"POST / HTTP/1.1\r\n" + host + "Content-Length: 3\r\nContent-Length: 4\r\n\r\nabcd", 400},
    };
    for (const auto& [text, status] : cases) {
        HttpClient client(r.port());
        client.send(text);
        const auto reply = client.reply();
        ASSERT_TRUE(reply) << text.substr(0, 80);
        EXPECT_EQ(reply->status, status) << text.substr(0, 80);
        EXPECT_EQ(reply->header("connection"), "close");
        EXPECT_TRUE(client.is_closed());
    }
    r.expect_serving();
}

TEST(HttpServer, EndsSlowAndIdleConnections) {
    ServerOptions options;
    options.http_timeouts = {.header = 60ms, .stall = 60ms, .keep_alive = 60ms};
    const Running r(options);
    HttpClient silent(r.port());
    HttpClient slow(r.port());
    slow.send("GET / HTTP/1.1\r\nHost: ");
    HttpClient body(r.port());
    body.send("POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 10\r\n\r\nabc");
    HttpClient idle(r.port());
    ASSERT_TRUE(idle.get("/healthz"));
    EXPECT_TRUE(silent.is_closed());
    for (HttpClient* client : {&slow, &body}) {
        const auto reply = client->reply();
        ASSERT_TRUE(reply);
        EXPECT_EQ(reply->status, 408U);
        EXPECT_TRUE(client->is_closed());
    }
    EXPECT_TRUE(idle.is_closed());
    while (r.server->sessions() > 0) {
        std::this_thread::yield();
    }
}

TEST(HttpServer, CountsConnectionsOfBothPortsTogether) {
    ServerOptions options;
    options.listen.sessions_per_address_max = 2;
    const Running r(options);
    RawClient native(r.server->endpoint().port);
    HttpClient first(r.port());
    ASSERT_TRUE(native.hello());
    ASSERT_TRUE(first.get("/healthz"));
    HttpClient second(r.port());
    const auto refused = second.reply();
    ASSERT_TRUE(refused);
    EXPECT_EQ(refused->status, 429U);
    EXPECT_EQ(refused->header("retry-after"), "1");
    EXPECT_TRUE(second.is_closed());
}

TEST(HttpServer, KeepsToTheConnectionHeader) {
    const Running r;
    HttpClient closing(r.port());
    const auto last = closing.get("/healthz", "Connection: close\r\n");
    ASSERT_TRUE(last);
    EXPECT_EQ(last->header("connection"), "close");
    EXPECT_TRUE(closing.is_closed());
    HttpClient old(r.port());
    old.send("GET /healthz HTTP/1.0\r\nConnection: keep-alive\r\n\r\n");
    const auto kept = old.reply();
    ASSERT_TRUE(kept);
    EXPECT_EQ(kept->header("connection"), "keep-alive");
    old.send("GET /healthz HTTP/1.0\r\n\r\n");
    ASSERT_TRUE(old.reply());
    EXPECT_TRUE(old.is_closed());
    HttpClient half(r.port());  // says all it has to say, and waits for the answer
    half.send("GET /healthz HTTP/1.1\r\nHost: a\r\n\r\n");
    half.end_sending();
    EXPECT_TRUE(half.reply());
    EXPECT_TRUE(half.is_closed());
}

TEST(HttpServer, OutlivesClientsThatDoNotWait) {
    const Running r;
    {
        std::vector<std::unique_ptr<HttpClient>> clients;
        for (int i = 0; i < 64; ++i) {
            clients.push_back(std::make_unique<HttpClient>(r.port()));
            clients.back()->send("GET " + r.prefix + "/chunks/0/" + std::to_string(i * 7) +
                                 "/0/900.drc HTTP/1.1\r\nHost: a\r\n\r\n");
        }
    }
    while (r.server->sessions() > 0) {
        std::this_thread::yield();
    }
    const auto& counters = r.server->counters();
    EXPECT_LE(count_of(counters.generations), 64U);
    r.expect_serving();
}

TEST(HttpServer, DrainingAnswersWhatIsUnderWay) {
    const Running r;
    HttpClient idle(r.port());
    ASSERT_TRUE(idle.get("/readyz"));
    HttpClient busy(r.port());
    busy.send("GET " + r.prefix + "/chunks/0/77/0/77.drc HTTP/1.1\r\nHost: a\r\n\r\n");
    RawClient native(r.server->endpoint().port);
    ASSERT_TRUE(native.hello());  // so the request before it has been read, most likely
    std::jthread stopping([&] { r.server->stop(); });
    const auto reply = busy.reply();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status, 200U);
    EXPECT_TRUE(busy.is_closed());
    EXPECT_TRUE(idle.is_closed());
}

}  // namespace
}  // namespace terrane
