// Clients that mean no good, against a `terrane serve` of its own. Under each flood the server
// stays up, its memory stays within a bound that is named here, a well-behaved client gets all its
// chunks, and who is refused is told why.
#include "server/net/session_caps.h"
#include "server/server.h"
#include "tests/server/http_client.h"
#include "tests/server/raw_client.h"
#include "tests/server/serve_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace terrane {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using testing::HasSubstr;

constexpr std::size_t kMib = std::size_t{1} << 20U;
/// What both caches may hold by the flags below, and what malloc keeps for itself beside.
constexpr std::size_t kCachesBytes = 8 * kMib;
constexpr std::size_t kHeapSlackBytes = 8 * kMib;
/// Rows of chunks that the bystander asks for again and again, and every so often a new one.
constexpr std::uint32_t kRows = 16;
constexpr std::uint32_t kNewRowEvery = 20;
/// A record of the memory store with its place in the table, over its own bytes.
constexpr double kStoreOverhead = 1.25;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
/// Freed memory that a sanitizer holds back, and its shadows.
constexpr std::size_t kToolBytes = 600 * kMib;
#else
constexpr std::size_t kToolBytes = 0;
#endif

ViewUpdate view_at(double x, std::vector<std::uint32_t> radii) {
    ViewUpdate view;
    view.x = x;
    view.y = 60;
    view.radius_chunks = std::move(radii);
    return view;
}

/// The bystander is no flood itself.
constexpr std::chrono::milliseconds kBetweenRows{5};

class Flood : public testing::Test {
  protected:
    void start(std::vector<std::string> flags) {
        flags.insert(flags.begin(),
                     {"--world", world_path(), "--store", "memory", "--log-level", "off",
                      "--workers", "2", "--cache-mib", "4", "--stack-cache-mib", "4"});
        serve_ = std::make_unique<ServeProcess>(std::move(flags));
        bystander_ = std::make_unique<RawClient>(serve_->port());
        ASSERT_TRUE(bystander_->hello());
        for (std::uint32_t row = 1; row <= kRows; ++row) {
            expect_row(row);
        }
        before_store_bytes_ = metric("terrane_store_memtable_bytes");
        before_bytes_ = serve_->memory_bytes("VmRSS");
    }

    /// All 64 chunks of a row come to the bystander.
    void expect_row(std::uint32_t row) {
        bystander_->send(row_of(row));
        for (int i = 0; i < 64; ++i) {
            const auto chunk = bystander_->next_as<ChunkAnswer>();
            ASSERT_TRUE(chunk) << "row " << row << ", " << i << " chunks of it came";
            EXPECT_EQ(chunk->request_id, row);
        }
    }

    /// A row that it has had, or one that nobody has had yet.
    void expect_chunks() {
        ++asked_;
        expect_row(asked_ % kNewRowEvery == 0 ? kRows + asked_ / kNewRowEvery : 1 + asked_ % kRows);
    }

    /// Floods from a thread, while the bystander asks for chunks, for a time.
    void flood_for(std::chrono::milliseconds time, const std::function<void()>& once) {
        std::atomic<bool> is_over = false;
        {
            const std::jthread flood([&] {
                while (!is_over) {
                    once();
                }
            });
            const auto end = Clock::now() + time;
            while (Clock::now() < end && !HasFatalFailure()) {
                expect_chunks();
                std::this_thread::sleep_for(kBetweenRows);
            }
            is_over = true;
        }
    }

    /// Nothing but the bound for its name has been taken, and the server stops as it should.
    void expect_well(std::size_t allowed_bytes) {
        const std::size_t most_bytes = serve_->memory_bytes("VmHWM");
        const std::size_t grown_bytes = most_bytes - std::min(most_bytes, before_bytes_);
        // What the server was made to generate is kept, within the store's own bound.
        const double store_bytes = metric("terrane_store_memtable_bytes") - before_store_bytes_;
        const auto kept_bytes =
            static_cast<std::size_t>(std::max(store_bytes, 0.0) * kStoreOverhead);
        RecordProperty("kept_kib", static_cast<int>(kept_bytes >> 10U));
        RecordProperty("grown_kib", static_cast<int>(grown_bytes >> 10U));
        EXPECT_LE(grown_bytes,
                  allowed_bytes + kept_bytes + kCachesBytes + kHeapSlackBytes + kToolBytes);
        expect_chunks();
        EXPECT_TRUE(serve_->is_running());
        bystander_.reset();
        serve_->signal(SIGTERM);
        const int status = serve_->wait();
        ASSERT_TRUE(WIFEXITED(status));
        EXPECT_EQ(WEXITSTATUS(status), kExitDone);
    }

    /// A line of /metrics.
    double metric(const std::string& name) const {
        HttpClient client(serve_->http_port());
        const auto reply = client.get("/metrics");
        const std::size_t at = reply ? reply->body.find("\n" + name + " ") : std::string::npos;
        EXPECT_NE(at, std::string::npos) << name;
        return at == std::string::npos ? 0 : std::stod(reply->body.substr(at + name.size() + 2));
    }

    std::unique_ptr<ServeProcess> serve_;
    std::unique_ptr<RawClient> bystander_;
    std::uint32_t asked_ = 0;
    std::size_t before_bytes_ = 0;
    double before_store_bytes_ = 0;
};

/// What one session may hold by the server's own reckoning.
std::size_t session_bound_bytes() {
    ServerOptions options;
    options.listen.sessions_max = 1;
    constexpr std::size_t kAnswerBytes = std::size_t{64} << 10U;  // 64 a column, 32 x 32 of them
    return memory_bound_of(options).sessions + kAnswerBytes;
}

TEST_F(Flood, ConnectionsAboveTheCapAreToldAndTheOthersServed) {
    start({"--sessions-max", "40", "--sessions-per-address-max", "40"});
    std::vector<std::unique_ptr<RawClient>> inside;
    while (inside.size() < 39) {
        inside.push_back(std::make_unique<RawClient>(serve_->port()));
        ASSERT_TRUE(inside.back()->hello());
    }
    std::size_t refusals = 0;
    flood_for(1500ms, [&] {
        RawClient native(serve_->port());
        const auto failure = native.next_as<Failure>();
        ASSERT_TRUE(failure);
        EXPECT_EQ(failure->error.code, ErrorCode::busy);
        EXPECT_THAT(failure->error.message, HasSubstr("too many sessions"));
        EXPECT_GT(failure->retry_after_ms, 0U);
        EXPECT_TRUE(native.is_closed());
        HttpClient http(serve_->http_port());
        const auto reply = http.reply();
        ASSERT_TRUE(reply);
        EXPECT_EQ(reply->status, 429U);
        EXPECT_EQ(reply->header("content-type"), "application/problem+json");
        EXPECT_FALSE(reply->header("retry-after").empty());
        refusals += 2;
    });
    EXPECT_GT(refusals, 50U);
    inside.clear();
    // The places are free again as soon as the server has seen the ends.
    bool is_in = false;
    for (int attempt = 0; attempt < 1000 && !is_in; ++attempt) {
        RawClient again(serve_->port());
        again.send(
            ClientHello{.protocol_version = kProtocolVersion, .client_name = "again", .token = {}});
        const auto answer = again.next();
        is_in = answer && std::holds_alternative<ServerHello>(answer->message);
    }
    EXPECT_TRUE(is_in);
    expect_well(40 * session_bound_bytes());
}

TEST_F(Flood, WhoNeverReadsHoldsItsBoundAndIsClosed) {
    constexpr std::size_t kClients = 16;
    start({"--stall-timeout-s", "1"});
    Bytes requests;
    for (std::uint32_t row = 1; row <= kRows; ++row) {
        ByteWriter(requests).raw(encode_message(row_of(row)));
    }
    std::vector<std::unique_ptr<RawClient>> deaf;
    std::vector<std::span<const std::byte>> left(kClients);
    std::atomic<std::size_t> open = kClients;
    for (std::size_t i = 0; i < kClients; ++i) {
        deaf.push_back(std::make_unique<RawClient>(serve_->port(), 4096));
        ASSERT_TRUE(deaf.back()->hello());
        deaf.back()->send(view_at(0, {16, 16, 16}));
    }
    // They ask for more as long as the server takes it: first the kernel's buffers are full, then
    // the server's, and a second later the connection is closed.
    for (const auto deadline = Clock::now() + 60s; open > 0 && Clock::now() < deadline;) {
        flood_for(100ms, [&] {
            for (std::size_t i = 0; i < kClients; ++i) {
                left[i] = left[i].empty() ? std::span<const std::byte>(requests) : left[i];
                if (deaf[i] && !deaf[i]->send_some(left[i])) {
                    deaf[i].reset();
                    --open;
                }
            }
            std::this_thread::sleep_for(1ms);
        });
    }
    EXPECT_EQ(open, 0U) << "closed after a second of not reading";
    expect_well(kClients * session_bound_bytes());
}

TEST_F(Flood, ViewUpdatesAsFastAsTheyGoStarveNobody) {
    start({});
    auto mad = std::make_unique<RawClient>(serve_->port());
    ASSERT_TRUE(mad->hello());
    std::uint64_t updates = 0;
    Bytes waiting;
    flood_for(2000ms, [&] {  // a leap of 100,000 voxels each time: everything is another
        const double x = static_cast<double>(++updates % 1000) * 1e5;
        waiting = encode_message(view_at(x, {16, 16}));
        const auto patience = std::chrono::steady_clock::now() + 20s;
        for (std::span<const std::byte> left = waiting; !left.empty();) {
            ASSERT_LT(std::chrono::steady_clock::now(), patience) << "the server reads no more";
            ASSERT_TRUE(mad->send_some(left));
            mad->drop_received();
        }
    });
    EXPECT_GT(updates, 10U);
    mad.reset();
    ServerOptions options;
    options.workers = 2;  // which make levels now that nobody has asked for before
    expect_well(session_bound_bytes() + memory_bound_of(options).workers);
}

TEST_F(Flood, ARateThatIsKeptToIsTold) {
    start({"--requests-per-second-max", "200"});
    auto mad = std::make_unique<RawClient>(serve_->port());
    ASSERT_TRUE(mad->hello());
    for (int i = 0; i < 5000; ++i) {
        mad->send(view_at(0, {0}));
    }
    mad->send(Ping{.nonce = 99});
    std::size_t refused = 0;
    while (const auto received = mad->next()) {
        if (const auto* failure = std::get_if<Failure>(&received->message)) {
            EXPECT_EQ(failure->error.code, ErrorCode::busy);
            EXPECT_THAT(failure->error.message, HasSubstr("200 requests a second"));
            EXPECT_GT(failure->retry_after_ms, 0U);
            ++refused;
        } else if (std::holds_alternative<Pong>(received->message)) {
            break;
        }
    }
    EXPECT_GT(refused, 1000U);
    mad.reset();
    expect_well(session_bound_bytes());
}

TEST_F(Flood, HugeHeadersAndBodiesAreRefusedBeforeTheyAreKept) {
    start({});
    const std::string huge = "GET / HTTP/1.1\r\nHost: a\r\nX: " + std::string(64 << 10U, 'x');
    const std::string many = [] {
        std::string text = "GET / HTTP/1.1\r\nHost: a\r\n";
        for (int i = 0; i < 4000; ++i) {
            text += "H" + std::to_string(i) + ": v\r\n";
        }
        return text + "\r\n";
    }();
    const std::string body =
        "POST /v1/world HTTP/1.1\r\nHost: a\r\nContent-Length: 4000000000\r\n\r\n";
    std::size_t refusals = 0;
    flood_for(1500ms, [&] {
        for (const auto& [text, status] :
             {std::pair(&huge, 431U), std::pair(&many, 431U), std::pair(&body, 413U)}) {
            HttpClient client(serve_->http_port());
            client.send(*text);
            const auto reply = client.reply();
            ASSERT_TRUE(reply) << status;
            EXPECT_EQ(reply->status, status);
            EXPECT_EQ(reply->header("content-type"), "application/problem+json");
            EXPECT_EQ(reply->header("connection"), "close");
            ++refusals;
        }
    });
    EXPECT_GT(refusals, 30U);
    expect_well(16 * session_bound_bytes());  // some linger while others come
}

TEST_F(Flood, SlowHeadersRunOutOfTimeHoweverTheyDrip) {
    constexpr std::size_t kClients = 200;
    start({"--header-timeout-s", "1"});
    std::vector<std::unique_ptr<HttpClient>> slow;
    for (std::size_t i = 0; i < kClients; ++i) {
        slow.push_back(std::make_unique<HttpClient>(serve_->http_port()));
        slow.back()->send("GET / HTTP/1.1\r\nHost: a\r\n");
    }
    flood_for(2200ms, [&] {  // a byte each, about every 50 ms
        for (const auto& client : slow) {
            client->send("x");
        }
        std::this_thread::sleep_for(50ms);
    });
    for (const auto& client : slow) {
        const auto reply = client->reply();
        ASSERT_TRUE(reply);
        EXPECT_EQ(reply->status, 408U);
        EXPECT_EQ(reply->header("connection"), "close");
    }
    slow.clear();
    // An idle connection holds no more than 16 KiB.
    constexpr std::size_t kIdleConnectionBytes = std::size_t{16} << 10U;
    expect_well(kClients * kIdleConnectionBytes);
}

TEST_F(Flood, WebSocketPingsMakeNoMoreThanAFewPongsWait) {
    start({"--stall-timeout-s", "1"});
    const auto upgraded = [&] {
        auto client = std::make_unique<RawClient>(serve_->http_port(), 4096);
        client->send(bytes_of(
            "GET /ws HTTP/1.1\r\nHost: a\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
            "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"));
        return client;
    };
    std::string pings;
    for (int i = 0; i < 300; ++i) {  // the longest that there are, masked by zeros
        pings += std::string("\x89\xfd\0\0\0\0", 6) + std::string(125, 'p');
    }
    constexpr std::size_t kClients = 8;
    std::vector<std::unique_ptr<RawClient>> mad;
    std::vector<std::span<const std::byte>> left;
    for (std::size_t i = 0; i < kClients; ++i) {
        mad.push_back(upgraded());
        left.emplace_back();
    }
    std::uint64_t sent_bytes = 0;
    flood_for(2000ms, [&] {
        for (std::size_t i = 0; i < mad.size(); ++i) {
            left[i] = left[i].empty() ? bytes_of(pings) : left[i];
            const std::size_t before = left[i].size();
            if (!mad[i]->send_some(left[i])) {  // closed, as it should be: another comes
                mad[i] = upgraded();
                left[i] = {};
            } else {
                sent_bytes += before - left[i].size();
            }
            if (i % 2 == 0) {  // every other one reads its pongs
                mad[i]->drop_received();
            }
        }
    });
    EXPECT_GT(sent_bytes, kMib);
    mad.clear();
    expect_well(kClients * session_bound_bytes());
}

}  // namespace
}  // namespace terrane
