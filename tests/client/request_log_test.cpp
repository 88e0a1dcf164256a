// The debug log names every request of every way in by a number of one count, and every Failure.
#include "client-sample/cpp/client.h"
#include "client-sample/cpp/program/carrier.h"
#include "server/server.h"
#include "tests/server/http_client.h"
#include "tests/support/test_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <sstream>

namespace terrane {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;

/// "native request=3 kind=view" by its words.
using Line = std::map<std::string, std::string>;

/// The lines of one kind in what was logged.
std::vector<Line> lines_of(const std::string& log, const std::string& kind) {
    std::vector<Line> lines;
    std::istringstream in(log);
    for (std::string text; std::getline(in, text);) {
        const std::size_t at = text.find(" debug: " + kind + " request=");
        if (at == std::string::npos) {
            continue;
        }
        std::istringstream words(text.substr(at + 8));
        Line line;
        for (std::string word; words >> word;) {
            if (const std::size_t equals = word.find('='); equals != std::string::npos) {
                line[word.substr(0, equals)] = word.substr(equals + 1);
            }
        }
        lines.push_back(std::move(line));
    }
    return lines;
}

class RequestLogTest : public testing::Test {
  protected:
    void SetUp() override {
        testing::internal::CaptureStderr();
        ServerOptions options;
        options.world = load_shipped_world("paper-B2");
        options.listen.endpoint = {.address = "127.0.0.1", .port = 0};
        options.http = Endpoint{.address = "127.0.0.1", .port = 0};
        options.store = StoreKind::memory;
        options.log_requests = true;
        auto server = Server::start(options, log_);
        ASSERT_TRUE(server) << server.error().message;
        server_ = *std::move(server);
    }

    void TearDown() override {
        if (!has_taken_) {  // a failed test must not leave the capturer to the next
            testing::internal::GetCapturedStderr();
        }
    }

    /// Ends the server, so that nothing more is logged.
    std::string logged() {
        server_->stop(50ms);
        has_taken_ = true;
        return testing::internal::GetCapturedStderr();
    }

    const Log log_{LogFormat::text, LogLevel::debug};
    std::unique_ptr<Server> server_;

  private:
    bool has_taken_ = false;
};

TEST_F(RequestLogTest, NativeRequestsAndFailuresHaveNumbers) {
    {
        auto client = Client::connect({.host = "127.0.0.1", .port = server_->endpoint().port});
        ASSERT_TRUE(client) << client.error().message;
        const std::vector<ChunkPos> keys = {{.lod = 0, .x = 0, .y = 0, .z = 0},
                                            {.lod = 99, .x = 0, .y = 0, .z = 0}};
        ASSERT_TRUE(client->request(keys, ChunkFormat::columns));
        ASSERT_TRUE(client->query_column({.x = 1, .z = 2}));
        ASSERT_TRUE(client->query_world());
        while (client->unanswered() > 0) {
            const auto event = client->next(steady_clock::now() + 60s);
            ASSERT_TRUE(event && *event);
        }
        ViewUpdate view;
        view.radius_chunks = {0};
        view.format = ChunkFormat::columns;
        ASSERT_TRUE(client->view(view));
        const auto event = client->next(steady_clock::now() + 60s);
        ASSERT_TRUE(event && *event);
    }
    HttpClient http(server_->http_endpoint()->port);
    const auto reply = http.get("/healthz");
    ASSERT_TRUE(reply);
    while (server_->sessions() > 1) {  // until the first has ended, and with it its view
        std::this_thread::yield();
    }
    const std::string log = logged();
    const auto native = lines_of(log, "native");
    ASSERT_EQ(native.size(), 4U) << log;
    std::map<std::string, Line> by_kind;
    std::set<std::string> numbers = {reply->header("terrane-request")};
    for (const Line& line : native) {
        by_kind[line.at("kind")] = line;
        numbers.insert(line.at("request"));
        EXPECT_EQ(line.at("session"), native[0].at("session"));
    }
    EXPECT_EQ(numbers.size(), 5U) << "a number names one request";
    EXPECT_EQ(by_kind["chunks"]["answers"], "2");
    EXPECT_EQ(by_kind["chunks"]["failed"], "1");
    EXPECT_GT(std::stoi(by_kind["chunks"]["bytes"]), 0);
    EXPECT_EQ(by_kind["column"]["answers"], "1");
    EXPECT_EQ(by_kind["world"]["failed"], "0");
    EXPECT_GE(std::stoi(by_kind["view"]["answers"]), 1);
    const auto failures = lines_of(log, "failure");
    ASSERT_EQ(failures.size(), 1U) << log;
    EXPECT_EQ(failures[0].at("request"), by_kind["chunks"]["request"]);
    EXPECT_EQ(failures[0].at("client_request"), by_kind["chunks"]["client_request"]);
    EXPECT_EQ(failures[0].at("code"), "unsupported");
    EXPECT_EQ(failures[0].at("key"), "99/0/0/0");
    const auto answers = lines_of(log, "http");
    ASSERT_EQ(answers.size(), 1U);
    EXPECT_EQ(answers[0].at("request"), reply->header("terrane-request"));
}

TEST_F(RequestLogTest, WebSocketRequestsHaveThemToo) {
    const std::uint16_t port = server_->http_endpoint()->port;
    HttpClient socket(port);
    const auto carrier =
        make_carrier(CarrierKind::web_socket, {.host = "127.0.0.1", .port = port, .seed = 1});
    socket.send(text_of(carrier->opening()));
    socket.send(text_of(carrier->wrap(
        ClientHello{.protocol_version = kProtocolVersion, .client_name = "ws", .token = {}})));
    socket.send(text_of(carrier->wrap(ColumnQuery{.request_id = 7, .column = {.x = 0, .z = 0}})));
    bool is_answered = false;
    while (!is_answered) {
        const std::string bytes = socket.take(1);
        ASSERT_FALSE(bytes.empty());
        ASSERT_TRUE(carrier->feed(bytes_of(bytes)));
        const auto message = carrier->next();
        ASSERT_TRUE(message);
        is_answered = *message && std::holds_alternative<ColumnAnswer>((*message)->message);
    }
    const std::string log = logged();
    const auto upgrades = lines_of(log, "http");
    const auto native = lines_of(log, "native");
    ASSERT_EQ(upgrades.size(), 1U) << log;
    ASSERT_EQ(native.size(), 1U) << log;
    EXPECT_EQ(upgrades[0].at("status"), "101");
    EXPECT_EQ(native[0].at("session"), upgrades[0].at("session"));
    EXPECT_NE(native[0].at("request"), upgrades[0].at("request"));
    EXPECT_EQ(native[0].at("client_request"), "7");
}

}  // namespace
}  // namespace terrane
