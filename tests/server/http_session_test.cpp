// One HTTP connection without a socket: bytes in, bytes out, time stepped by hand.
#include "server/net/http_session.h"

#include "server/http/ask_service.h"
#include "server/http/problem.h"
#include "tests/server/gated_step.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

namespace terrane {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::StartsWith;

constexpr ChunkKey kKey{.position = {.lod = 0, .x = 1, .y = 2, .z = 3}};

/// A server with two routes: "/now" answers at once, "/chunk" asks a gated service.
struct Fixture {
    Fixture() {
        gate.open = false;
        gate.chunk.status = ChunkStatus::full;
        gate.chunk.payload = http_body("payload");
        service.emplace(ServiceOptions{.cache_bytes_max = std::size_t{1} << 20U}, counters,
                        gate.maker());
        router.add({.path = "/now",
                    .caching = HttpCaching::none,
                    .handler = [](const HttpRequest&, const RouteParams&, const HttpLater&) {
                        return http_ok("text/plain", http_body("now"));
                    }});
        router.add({.path = "/chunk",
                    .caching = HttpCaching::none,
                    .handler = [this](const HttpRequest& request, const RouteParams&,
                                      const HttpLater& later) {
                        return ask_service(
                            *service, kKey, request, later, [](const Result<Answer>& answer) {
                                return answer
                                           ? http_ok("a/b",
                                                     std::get<ServedChunk>(*answer).chunk->payload)
                                           : http_problem(answer.error());
                            });
                    }});
        session = std::make_shared<HttpSession>(
            context, ConnectionOrigin{.id = 1, .address = "test"},
            [this](std::function<void()> step) {
                const MutexLock lock(mutex);
                steps.push_back(std::move(step));
            },
            now);
    }

    void send(std::string_view text) { session->receive(bytes_of(text), now); }

    void pass(std::chrono::milliseconds time) {
        now += time;
        session->tick(now);
    }

    /// What is to be written, written.
    std::string output() {
        std::string out;
        Outbox::Gather parts;
        while (const std::size_t count = session->gather(parts)) {
            std::size_t size = 0;
            for (std::size_t i = 0; i < count; ++i) {
                out += text_of(parts[i]);
                size += parts[i].size();
            }
            session->written(size, now);
        }
        return out;
    }

    /// Runs what workers have posted, once there is something.
    void run_posted() {
        while (true) {
            std::vector<std::function<void()>> taken;
            {
                const MutexLock lock(mutex);
                taken.swap(steps);
            }
            for (const auto& step : taken) {
                step();
            }
            if (!taken.empty()) {
                return;
            }
            std::this_thread::yield();
        }
    }

    Gate gate;
    ServiceCounters counters;
    std::optional<ChunkService> service;
    Router router{Hash128{}};
    HttpCounters http_counters;
    std::atomic<std::uint64_t> next_id = 1;
    HttpContext context{.router = &router,
                        .counters = &http_counters,
                        .next_request_id = &next_id,
                        .new_flow = [this] { return service->new_flow_id(); },
                        .timeouts = {},
                        .websocket = {},
                        .requests_log = nullptr};
    Mutex mutex;
    std::vector<std::function<void()>> steps;
    ByteProtocol::Clock::time_point now{};
    std::shared_ptr<HttpSession> session;
};

constexpr std::string_view kNow = "GET /now HTTP/1.1\r\nHost: a\r\n\r\n";
constexpr std::string_view kChunk = "GET /chunk HTTP/1.1\r\nHost: a\r\n\r\n";

TEST(HttpSession, WhoAsksTooOftenGets429UntilTimeHasPassed) {
    Fixture f;
    std::string asked;
    f.context.rates_of = [&asked](std::string_view token) {
        asked = token;
        return HttpRates{.requests_per_second_max = token.empty() ? 2U : 0U,
                         .bytes_per_second_max = 0};
    };
    f.send(std::string(kNow) + std::string(kNow) + std::string(kNow));
    const std::string out = f.output();
    EXPECT_THAT(out, HasSubstr("429 Too Many Requests"));
    EXPECT_THAT(out, HasSubstr("Retry-After: 1\r\n"));
    EXPECT_THAT(out, HasSubstr("2 requests a second are the most"));
    EXPECT_EQ(f.http_counters.limited, 1U);
    EXPECT_LT(out.find("200 OK"), out.find("429"));
    f.pass(600ms);
    f.send(kNow);
    EXPECT_THAT(f.output(), HasSubstr("200 OK"));
    // A token that may do more.
    for (int i = 0; i < 5; ++i) {
        f.send("GET /now HTTP/1.1\r\nHost: a\r\nAuthorization: Bearer good\r\n\r\n");
        EXPECT_THAT(f.output(), HasSubstr("200 OK"));
    }
    EXPECT_EQ(asked, "good");
}

TEST(HttpSession, WhoTakesTooManyBytesWaitsAndIsNotTimedOut) {
    Fixture f;
    f.context.rates_of = [](std::string_view) {
        return HttpRates{.requests_per_second_max = 0, .bytes_per_second_max = 100};
    };
    f.context.timeouts.header = 500ms;
    f.send(std::string(kNow) + std::string(kNow));
    const std::string first = f.output();
    EXPECT_EQ(first.find("200 OK"), first.rfind("200 OK")) << "one overdraws, the other waits";
    ASSERT_TRUE(f.session->wake_at());
    const auto wait = *f.session->wake_at() - f.now;
    const double owed_bytes = static_cast<double>(first.size()) - 25;  // a quarter second is free
    EXPECT_NEAR(std::chrono::duration<double>(wait).count(), owed_bytes / 100, 0.01);
    f.pass(1000ms);
    EXPECT_EQ(f.output(), "");
    EXPECT_FALSE(f.session->is_closing());
    f.pass(std::chrono::duration_cast<std::chrono::milliseconds>(wait) + 1ms);
    EXPECT_THAT(f.output(), HasSubstr("200 OK"));
}

TEST(HttpSession, AnswersInTheStepThatReadTheRequestHoweverItIsCut) {
    Fixture f;
    for (std::size_t step = 1; step <= kNow.size(); ++step) {
        for (std::size_t at = 0; at < kNow.size(); at += step) {
            f.send(kNow.substr(at, step));
        }
        const std::string out = f.output();
        EXPECT_THAT(out, StartsWith("HTTP/1.1 200 OK\r\n"));
        EXPECT_TRUE(out.ends_with("\r\n\r\nnow")) << out;
    }
    EXPECT_FALSE(f.session->is_closing());
}

TEST(HttpSession, AnswersLaterOnItsOwnThreadAndTheNextOneAfterwards) {
    Fixture f;
    f.send(std::string(kChunk) + std::string(kNow));
    f.gate.begun.acquire();
    EXPECT_EQ(f.output(), "");
    f.gate.passes.release();
    f.run_posted();
    const std::string out = f.output();
    EXPECT_LT(out.find("\r\n\r\npayload"), out.find("\r\n\r\nnow"));
    EXPECT_TRUE(out.ends_with("now"));
}

TEST(HttpSession, WhoLeavesTakesTheQuestionBack) {
    Fixture f;
    f.send(kChunk);
    f.gate.begun.acquire();
    EXPECT_EQ(f.service->in_flight(), 1U);
    f.session->end();
    EXPECT_TRUE(f.session->is_dead());
    EXPECT_EQ(f.service->in_flight(), 0U);
    EXPECT_EQ(count_of(f.counters, &OutcomeCounters::cancelled), 1U);
    f.gate.passes.release();
}

TEST(HttpSession, AnswersHttp10AfterAHalfCloseAndProbesNothing) {
    Fixture f;
    f.send("GET /chunk HTTP/1.0\r\n\r\n");
    f.gate.begun.acquire();
    f.session->input_ended();
    EXPECT_FALSE(f.session->is_closing() || f.session->is_dead());
    EXPECT_EQ(f.output(), "");
    f.gate.passes.release();
    f.run_posted();
    const std::string out = f.output();
    EXPECT_TRUE(out.starts_with("HTTP/1.1 200 OK")) << out;
    EXPECT_TRUE(out.ends_with("payload")) << out;
    EXPECT_TRUE(f.session->is_closing());
}

TEST(HttpSession, AnswersAllThatCameBeforeAHalfClose) {
    Fixture f;
    f.send(std::string(kNow) + std::string(kChunk) + std::string(kNow) + "GET /cut");
    f.gate.begun.acquire();
    f.session->input_ended();
    EXPECT_FALSE(f.session->wants_input());
    EXPECT_FALSE(f.session->is_closing() || f.session->is_dead());
    std::string out = f.output();
    EXPECT_TRUE(out.ends_with("\r\n\r\nnowHTTP/1.1 100 Continue\r\n\r\n")) << out;
    f.gate.passes.release();
    f.run_posted();
    out = f.output();
    EXPECT_LT(out.find("\r\n\r\npayload"), out.find("\r\n\r\nnow"));
    EXPECT_TRUE(out.ends_with("now"));
    EXPECT_TRUE(f.session->is_closing());

    Fixture idle;
    idle.send(kNow);
    idle.session->input_ended();
    EXPECT_TRUE(idle.session->is_closing());
}

TEST(HttpSession, AHalfCloseWaitsForTheByteRateToo) {
    Fixture f;
    f.context.rates_of = [](std::string_view) {
        return HttpRates{.requests_per_second_max = 0, .bytes_per_second_max = 100};
    };
    f.send(std::string(kNow) + std::string(kNow));
    EXPECT_THAT(f.output(), HasSubstr("200 OK"));
    f.session->input_ended();
    EXPECT_FALSE(f.session->is_closing());
    f.pass(1h);
    EXPECT_THAT(f.output(), HasSubstr("200 OK"));
    EXPECT_TRUE(f.session->is_closing());
}

TEST(HttpSession, WhoWaitsForItsAnswerMayBeSilentForLong) {
    Fixture f;
    f.send(kChunk);
    f.gate.begun.acquire();
    f.pass(1h);
    EXPECT_FALSE(f.session->is_closing() || f.session->is_dead());
    f.gate.passes.release();
    f.run_posted();
    EXPECT_THAT(f.output(), HasSubstr("payload"));
    f.pass(59s);
    EXPECT_FALSE(f.session->is_closing());
    f.pass(2s);
    EXPECT_TRUE(f.session->is_closing());
}

TEST(HttpSession, ClosesOnSlowHeadersBodiesAndReaders) {
    Fixture header;
    header.send("GET /now HTTP/1.1\r\n");
    for (int i = 0; i < 11; ++i) {
        header.send("X: y\r\n");  // a line a second keeps nobody
        header.pass(1s);
    }
    EXPECT_THAT(header.output(), StartsWith("HTTP/1.1 408 "));
    EXPECT_TRUE(header.session->is_closing());

    Fixture body;
    body.send("POST /now HTTP/1.1\r\nHost: a\r\nContent-Length: 9\r\n\r\n");
    body.pass(29s);
    EXPECT_FALSE(body.session->is_closing());
    body.pass(2s);
    EXPECT_THAT(body.output(), StartsWith("HTTP/1.1 408 "));

    Fixture reader;
    reader.send(kNow);
    reader.pass(1s);
    reader.pass(29s);
    EXPECT_FALSE(reader.session->is_dead());
    reader.pass(2s);
    EXPECT_TRUE(reader.session->is_dead());
}

TEST(HttpSession, StopsReadingWhenTheClientDoesNotRead) {
    Fixture f;
    std::size_t requests = 0;
    while (f.session->wants_input() && requests < 100'000) {
        f.send(kNow);
        ++requests;
    }
    EXPECT_LT(requests, 2000U);
    EXPECT_NE(f.output(), "");
    EXPECT_TRUE(f.session->wants_input());
}

TEST(HttpSession, DrainingAnswersThenCloses) {
    Fixture f;
    f.send(kChunk);
    f.gate.begun.acquire();
    f.session->drain();
    EXPECT_FALSE(f.session->is_closing());
    f.gate.passes.release();
    f.run_posted();
    EXPECT_THAT(f.output(), HasSubstr("Connection: close\r\n"));
    EXPECT_TRUE(f.session->is_closing());
    Fixture idle;
    idle.session->drain();
    EXPECT_TRUE(idle.session->is_closing());
}

}  // namespace
}  // namespace terrane
