// A session's view: what is sent, in which order, how far ahead of the client, and what is dropped.
#include "server/net/session.h"
#include "tests/server/session_fixture.h"
#include "tests/support/random_seed.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

namespace terrane {
namespace {

using namespace std::chrono_literals;

struct Fixture : SessionFixture {
    explicit Fixture(std::size_t chunk_bytes = 1000, bool open = true, SessionCaps caps = {})
        : SessionFixture(chunk_bytes, open) {
        context.hello.levels = 3;
        context.hello.height_bound_voxels = 40;  // two chunks a stack
        context.caps = caps;
        begin();
        hello();
    }

    void look(double x, std::vector<std::uint32_t> radii, std::uint64_t bytes_per_second = 0) {
        ViewUpdate update;
        update.x = x;
        update.z = 16;
        update.radius_chunks = std::move(radii);
        update.bytes_per_second_max = bytes_per_second;
        send(update);
    }

    /// What the view of `look` consists of.
    std::set<ChunkPos> view_of(double x, std::vector<std::uint32_t> radii) const {
        View view({.side = 32, .chunk_height = 32, .height_bound_voxels = 40, .levels = 3}, {});
        ViewUpdate update;
        update.x = x;
        update.z = 16;
        update.radius_chunks = std::move(radii);
        view.update(update);
        std::set<ChunkPos> keys;
        while (view.has_wish()) {
            keys.insert(view.take());
        }
        return keys;
    }

    /// Reads as a client does: what it holds of the view.
    std::vector<ChunkPos> take() {
        std::vector<ChunkPos> came;
        for (const AnyMessage& message : read()) {
            if (const auto* chunk = std::get_if<ChunkAnswer>(&message)) {
                EXPECT_EQ(chunk->request_id, 0U);
                EXPECT_TRUE(held.insert(chunk->key).second) << "sent twice";
                came.push_back(chunk->key);
                payload_bytes += chunk->payload_bytes;
            } else if (const auto* forget = std::get_if<ChunkForget>(&message)) {
                for (const ChunkPos key : forget->keys) {
                    held.erase(key);
                    ++forgotten;
                }
            } else {
                others.push_back(message);
            }
        }
        return came;
    }

    std::set<ChunkPos> held;
    std::size_t forgotten = 0;
    std::size_t payload_bytes = 0;
    std::vector<AnyMessage> others;
};

TEST(SessionView, SendsTheViewWholeAndTheGroundFirst) {
    Fixture f;
    f.look(16, {2, 2, 1});
    std::vector<ChunkPos> order;
    for (int i = 0; i < 100 && f.held.size() < f.view_of(16, {2, 2, 1}).size(); ++i) {
        f.settle();
        const auto came = f.take();
        order.insert(order.end(), came.begin(), came.end());
        f.send(Credit{.bytes = 1'000'000});
    }
    EXPECT_EQ(f.held, f.view_of(16, {2, 2, 1}));
    EXPECT_EQ(order[0], (ChunkPos{.lod = 0, .x = 0, .y = 0, .z = 0}));
    EXPECT_EQ(order[1], (ChunkPos{.lod = 0, .x = 0, .y = 1, .z = 0}));
    EXPECT_TRUE(f.others.empty());
    EXPECT_EQ(f.session->uncredited_bytes(), 0U);
}

TEST(SessionView, AMovedViewSendsWhatIsNewAndForgetsWhatIsOld) {
    Fixture f;
    f.look(16, {3});
    f.settle();
    f.take();
    EXPECT_EQ(f.held, f.view_of(16, {3}));
    const int builds = f.gate.builds - f.settle_builds;
    f.look(16 + 32, {3});
    f.settle();
    const auto came = f.take();
    EXPECT_EQ(came.size(), 7U * 2);
    EXPECT_EQ(f.forgotten, 7U * 2);
    EXPECT_EQ(f.held, f.view_of(16 + 32, {3}));
    EXPECT_EQ(f.gate.builds - f.settle_builds - builds, 7 * 2) << "only the new ones are made";
    f.look(16 + 32, {3});
    f.settle();
    EXPECT_TRUE(f.take().empty());
    f.look(0, {});
    f.settle();
    f.take();
    EXPECT_TRUE(f.held.empty());
}

TEST(SessionView, SendsNoMoreThanTheCreditWindow) {
    Fixture f(1000, true, {.credit_window_bytes = 10'000});
    f.look(16, {4});
    f.settle();
    f.take();
    EXPECT_EQ(count_of(f.counters.credit_stalls), 1U);
    EXPECT_LE(f.held.size(), 10U);
    EXPECT_GE(f.held.size(), 6U) << "the first answers are expected to be larger";
    EXPECT_EQ(f.session->uncredited_bytes(), f.payload_bytes);
    const std::size_t before = f.held.size();
    f.send(Credit{.bytes = 3'000});
    f.settle();
    f.take();
    EXPECT_GE(f.held.size(), before + 3);
    EXPECT_EQ(f.session->uncredited_bytes(), f.payload_bytes - 3'000);
    EXPECT_LE(f.session->uncredited_bytes(), 10'000U);
    f.send(Credit{.bytes = std::uint64_t{1} << 63U});  // more than was sent
    EXPECT_LE(f.session->uncredited_bytes(), 10'000U);
    f.settle();
    f.take();
    EXPECT_GE(f.held.size(), before + 10);
}

TEST(SessionView, AChunkLargerThanTheWindowComesAlone) {
    Fixture f(50'000, true, {.credit_window_bytes = 10'000});
    f.look(16, {2});
    f.settle();
    f.take();
    EXPECT_EQ(f.held.size(), 1U);
    f.send(Credit{.bytes = 49'999});
    f.settle();
    f.take();
    EXPECT_EQ(f.held.size(), 1U);
    f.send(Credit{.bytes = 1});
    f.settle();
    f.take();
    EXPECT_EQ(f.held.size(), 2U);
}

TEST(SessionView, RequestsNeedNoCredit) {
    Fixture f(1000, true, {.credit_window_bytes = 4096});
    f.look(16, {4});
    f.settle();
    f.take();
    EXPECT_LE(f.held.size(), 4U);
    f.request(7, {at(100), at(101), at(102), at(103), at(104)});
    f.settle();
    EXPECT_EQ(std::ranges::count_if(f.read(),
                                    [](const AnyMessage& message) {
                                        return std::get<ChunkAnswer>(message).request_id == 7;
                                    }),
              5);
}

TEST(SessionView, ATeleportStopsTheWorkOfTheOldPlace) {
    Fixture f(1000, false);
    f.look(16, {6});
    f.gate.begun.acquire();  // the worker is in the first
    const std::size_t old_work = f.service->in_flight();
    EXPECT_GT(old_work, 40U);
    f.look(1e6, {1});
    EXPECT_EQ(count_of(f.counters, &OutcomeCounters::cancelled), old_work);
    EXPECT_EQ(f.service->in_flight(), f.view_of(1e6, {1}).size());
    f.gate.passes.release(1);  // the one that had begun
    f.gate.passes.release(1000);
    f.settle();
    f.take();
    EXPECT_EQ(f.held, f.view_of(1e6, {1}));
    const auto new_work = static_cast<int>(f.view_of(1e6, {1}).size());
    EXPECT_EQ(f.gate.builds - f.settle_builds, 1 + new_work) << "one of the old place, the new";
}

TEST(SessionView, WorkUnderWayIsRankedAnewWhenTheViewerMoves) {
    Fixture f(1000, false);
    f.look(16, {6});
    f.gate.begun.acquire();
    f.look(16 + 32 * 6, {6});
    std::vector<ChunkPos> order;
    f.gate.passes.release(10'000);
    f.settle();
    order = f.take();
    ASSERT_GT(order.size(), 2U);
    // What had begun may come first; then the ground under the viewer.
    EXPECT_TRUE(order[0].x == 6 || order[1].x == 6 || order[2].x == 6);
}

TEST(SessionView, WhatLeftTheViewIsTakenOutOfTheOutbox) {
    Fixture f(20'000);
    f.look(16, {3});
    f.settle();  // the client has read nothing
    const std::size_t before = f.session->outbox().bytes();
    EXPECT_GT(before, 150'000U);
    EXPECT_LE(before, kOutboxBytesMax);
    f.look(1e6, {1});
    f.settle();
    const auto here = f.view_of(1e6, {1});
    while (f.held != here) {
        for (const ChunkPos key : f.take()) {
            EXPECT_TRUE(here.contains(key)) << "of the old place";
        }
        f.send(Credit{.bytes = f.payload_bytes});
        f.payload_bytes = 0;
        f.settle();
    }
}

TEST(SessionView, WhatIsBeingWrittenStays) {
    Fixture f(20'000);
    f.look(16, {3});
    f.settle();
    Outbox::Gather parts;
    const std::size_t count = f.session->outbox().gather(parts);
    ASSERT_GT(count, 4U);
    const Bytes first(parts[1].begin(), parts[1].end());
    f.look(1e6, {1});
    EXPECT_TRUE(std::ranges::equal(parts[1], first));
    EXPECT_GE(f.session->outbox().bytes(), parts[0].size() + parts[1].size());
}

TEST(SessionView, ASlowReaderHoldsLessThanTheOutbox) {
    Fixture f(20'000);
    f.look(16, {8, 8});
    std::size_t worst = 0;
    for (int step = 0; step < 60; ++step) {  // 8,000 bytes a step are read
        f.settle();
        worst = std::max(worst, f.session->outbox().bytes());
        f.session->written(std::min<std::size_t>(8000, f.session->outbox().bytes()), f.now);
        f.look(16 + 50.0 * step, {8, 8});
    }
    EXPECT_LE(worst, kOutboxBytesMax);
    EXPECT_FALSE(f.session->is_dead());
}

TEST(SessionView, KeepsToTheSmallerRateOfClientAndServer) {
    for (const bool is_servers : {true, false}) {
        Fixture f(1000, true, {.bytes_per_second_max = is_servers ? 8000U : 1'000'000U});
        f.now += 10s;
        f.session->tick(f.now);
        f.look(16, {8}, is_servers ? 0 : 8000);
        std::size_t sent = 0;
        for (int step = 0; step < 100; ++step) {
            f.settle();
            f.take();
            sent = f.payload_bytes;
            f.send(Credit{.bytes = 1'000'000});
            if (const auto wake = f.session->wake_at()) {
                EXPECT_GT(*wake, f.now);
                EXPECT_LE(*wake, f.now + 1s);
            }
            f.now += 100ms;
            f.session->tick(f.now);
        }
        EXPECT_LE(sent, 80'000U + 5000);
        EXPECT_GE(sent, 60'000U) << "heads count too";
    }
}

TEST(SessionView, RefusesMoreRequestsASecondThanTheCap) {
    Fixture f(1000, true, {.requests_per_second_max = 3});
    for (int i = 0; i < 3; ++i) {
        f.look(16 + i, {1});
    }
    EXPECT_TRUE(f.others.empty());
    f.request(5, {at(100)});
    f.settle();
    f.take();
    ASSERT_EQ(f.others.size(), 1U);
    EXPECT_EQ(failure_code(f.others[0]), ErrorCode::busy);
    EXPECT_EQ(std::get<Failure>(f.others[0]).request_id, 5U);
    EXPECT_EQ(f.counters.limited, 1U);
    const std::uint32_t wait_ms = std::get<Failure>(f.others[0]).retry_after_ms;
    EXPECT_GT(wait_ms, 0U);
    f.now += std::chrono::milliseconds(wait_ms);
    f.session->tick(f.now);
    f.request(6, {at(100)});
    f.settle();
    const auto messages = f.read();
    ASSERT_EQ(messages.size(), 1U);
    EXPECT_TRUE(std::holds_alternative<ChunkAnswer>(messages[0]));
}

TEST(SessionView, TellsItsCapsAndClampsThem) {
    SessionFixture f;
    f.context.caps = {.keys_in_flight_max = 0,
                      .view_radius_max = 1'000'000,
                      .credit_window_bytes = 1,
                      .requests_per_second_max = 77,
                      .bytes_per_second_max = 88};
    f.begin();
    f.send(client_hello());
    const auto hello = std::get<ServerHello>(f.read().at(0));
    EXPECT_EQ(hello.limits.keys_in_flight_max, 1U);
    EXPECT_EQ(hello.limits.view_radius_max, kViewRadiusMax);
    EXPECT_EQ(hello.limits.credit_window_bytes, kCreditWindowBytesMin);
    EXPECT_EQ(hello.limits.requests_per_second_max, 77U);
    EXPECT_EQ(hello.limits.bytes_per_second_max, 88U);
}

TEST(SessionView, ATokenMayBringOtherCapsOrNone) {
    SessionFixture f;
    f.context.admit = [](const ClientHello& hello) -> Result<SessionCaps> {
        if (hello.token != "key") {
            return fail(ErrorCode::unauthorized, "no such token");
        }
        return SessionCaps{.view_radius_max = 5};
    };
    f.send(client_hello());
    EXPECT_EQ(failure_code(f.read().at(0)), ErrorCode::unauthorized);
    EXPECT_TRUE(f.session->is_closing());
    f.begin();
    auto hello = client_hello();
    hello.token = "key";
    f.send(hello);
    EXPECT_EQ(std::get<ServerHello>(f.read().at(0)).limits.view_radius_max, 5U);
}

TEST(SessionView, RefusesViewsThatItCanNotGive) {
    Fixture none(1000, true, {.view_radius_max = 0});
    none.look(16, {1});
    none.take();
    EXPECT_EQ(failure_code(none.others.at(0)), ErrorCode::unsupported);
    Fixture blocky;
    ViewUpdate update;
    update.x = 16;
    update.z = 16;
    update.format = ChunkFormat::draco_blocky;
    update.radius_chunks = {1, 1};
    blocky.send(update);
    blocky.take();
    EXPECT_EQ(failure_code(blocky.others.at(0)), ErrorCode::unsupported);
    EXPECT_EQ(std::get<Failure>(blocky.others[0]).request_id, 0U);
    update.radius_chunks = {1};
    blocky.send(update);
    blocky.settle();
    EXPECT_EQ(blocky.take().size(), 18U);
}

TEST(SessionView, AChunkThatFailsIsToldOnceAndTheRestGoesOn) {
    Fixture f;
    f.context.hello.chunk_height = 1;
    f.context.hello.height_bound_voxels = 700;  // the fixture throws at y 666
    f.begin();
    f.hello();
    f.look(16, {0});
    f.look(16, {1});
    std::size_t came = 0;
    for (int i = 0; i < 1000 && came + f.others.size() < 9 * 701; ++i) {
        f.settle();
        came += f.take().size();
        f.send(Credit{.bytes = 1'000'000});
    }
    EXPECT_EQ(came, 9U * 700);
    ASSERT_EQ(f.others.size(), 9U);
    for (const AnyMessage& message : f.others) {
        EXPECT_EQ(failure_code(message), ErrorCode::internal);
        EXPECT_EQ(std::get<Failure>(message).key->y, 666);
    }
    f.look(20, {1});
    f.settle();
    EXPECT_TRUE(f.take().empty());
    EXPECT_EQ(f.others.size(), 9U);
}

TEST(SessionView, ABusyServiceIsAskedAgain) {
    Fixture f(1000, false);
    f.service.emplace(ServiceOptions{.queued_jobs_max = 2}, f.counters, f.gate.maker());
    f.context.service = &*f.service;
    f.begin();
    f.hello();
    f.look(16, {2});
    f.gate.passes.release(10'000);
    for (int i = 0; i < 100 && f.held.size() < 50; ++i) {
        f.settle();
        f.take();
        f.now += 5s;
        f.session->tick(f.now);
    }
    EXPECT_EQ(f.held, f.view_of(16, {2}));
    EXPECT_TRUE(f.others.empty());
}

TEST(SessionView, AnotherFormatIsSentAllAgain) {
    Fixture f;
    f.look(16, {1});
    f.settle();
    EXPECT_EQ(f.take().size(), 18U);
    f.held.clear();
    ViewUpdate update;
    update.x = 16;
    update.z = 16;
    update.radius_chunks = {1};
    update.format = ChunkFormat::columns;
    f.send(update);
    f.settle();
    EXPECT_EQ(f.take().size(), 18U);
    EXPECT_EQ(f.forgotten, 0U);
}

TEST(SessionView, DrainingEndsTheViewAndAnswersRequests) {
    Fixture f(1000, false);
    f.look(16, {4});
    f.request(7, {at(100)});
    f.gate.begun.acquire();
    f.session->drain();
    f.gate.passes.release(10'000);
    f.settle();
    f.read();
    EXPECT_TRUE(f.session->is_closing());
    EXPECT_EQ(f.service->in_flight(), 0U);
}

// A client that follows what it is told ends up with its view, wherever it goes.
TEST(SessionView, ARandomWalkEndsInTheView) {
    std::mt19937 random(test_seed());
    Fixture f(3000, true, {.credit_window_bytes = 60'000});
    double x = 16;
    for (int step = 0; step < 200; ++step) {
        x += random() % 40 == 0 ? 5000 : static_cast<double>(random() % 30) - 10;
        f.look(x, {2, 1, 2});
        if (random() % 3 == 0) {
            f.settle();
        }
        if (random() % 3 == 0) {
            f.take();
            f.send(Credit{.bytes = f.payload_bytes});
            f.payload_bytes = 0;
        }
    }
    const auto view = f.view_of(x, {2, 1, 2});
    for (int i = 0; i < 100 && f.held != view; ++i) {
        f.settle();
        f.take();
        f.send(Credit{.bytes = f.payload_bytes});
        f.payload_bytes = 0;
    }
    EXPECT_EQ(f.held, view);
    EXPECT_TRUE(f.others.empty());
}

}  // namespace
}  // namespace terrane
