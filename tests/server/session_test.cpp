// One session without a socket: bytes in, frames out, time stepped by hand.
#include "server/net/session.h"

#include "tests/server/session_fixture.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace terrane {
namespace {

using namespace std::chrono_literals;
using Fixture = SessionFixture;

TEST(Session, AnswersHelloWithTheWorld) {
    Fixture f;
    f.send(client_hello());
    const auto messages = f.read();
    ASSERT_EQ(messages.size(), 1U);
    EXPECT_EQ(std::get<ServerHello>(messages[0]).world_name, "drawn");
    EXPECT_EQ(f.session->client_name(), "test");
}

TEST(Session, ClosesOnAnotherVersionOrOrder) {
    Fixture version;
    version.send(client_hello(kProtocolVersion + 1));
    EXPECT_EQ(failure_code(version.read()[0]), ErrorCode::version_mismatch);
    EXPECT_TRUE(version.session->is_closing());
    Fixture order;
    order.send(Ping{.nonce = 1});
    EXPECT_EQ(failure_code(order.read()[0]), ErrorCode::malformed);
    EXPECT_TRUE(order.session->is_closing());
    Fixture twice;
    twice.hello();
    twice.send(client_hello());
    EXPECT_EQ(failure_code(twice.read()[0]), ErrorCode::malformed);
    EXPECT_TRUE(twice.session->is_closing());
    Fixture reversed;
    reversed.hello();
    reversed.send(WorldAnswer{.request_id = 1, .toml = {}, .fingerprint = {}});
    EXPECT_EQ(failure_code(reversed.read()[0]), ErrorCode::malformed);
    EXPECT_TRUE(reversed.session->is_closing());
}

TEST(Session, AnswersEveryKeyOnceAndFromTheCacheAtOnce) {
    Fixture f(1000, false);  // or the first could be in the cache before the third is asked for
    f.hello();
    f.request(7, {at(1), at(2), at(1)});
    f.gate.passes.release(2);
    f.mailbox.run(3);
    auto messages = f.read();
    ASSERT_EQ(messages.size(), 3U);
    for (const AnyMessage& message : messages) {
        const auto& chunk = std::get<ChunkAnswer>(message);
        EXPECT_EQ(chunk.request_id, 7U);
        EXPECT_EQ(chunk.payload_bytes, 1000U);
        EXPECT_EQ(chunk.etag, kEtag);
    }
    f.request(8, {at(2)});
    messages = f.read();
    ASSERT_EQ(messages.size(), 1U);
    EXPECT_EQ(std::get<ChunkAnswer>(messages[0]).source, ChunkSource::cache);
    EXPECT_EQ(f.gate.builds, 2);
}

TEST(Session, SaysNotModifiedWhenTheEtagIsKnown) {
    Fixture f;
    f.hello();
    f.request(7, {at(1), at(2)}, {kEtag, Hash128{.high = 9, .low = 9}});
    f.mailbox.run(2);
    for (const AnyMessage& message : f.read()) {
        const auto& chunk = std::get<ChunkAnswer>(message);
        EXPECT_EQ(chunk.status == ChunkStatus::not_modified, chunk.key == at(1));
        EXPECT_EQ(chunk.payload_bytes, chunk.key == at(1) ? 0U : 1000U);
    }
}

TEST(Session, FailsTheKeyThatCanNotBeMadeAndGoesOn) {
    Fixture f;
    f.hello();
    f.request(7, {{.lod = kLodMax + 1, .x = 1, .y = 0, .z = 0}, at(1, 666), at(1)});
    f.mailbox.run(2);
    int failures = 0;
    for (const AnyMessage& message : f.read()) {
        if (const auto* failure = std::get_if<Failure>(&message)) {
            ++failures;
            EXPECT_EQ(failure->request_id, 7U);
            EXPECT_TRUE(failure->key);
        }
    }
    EXPECT_EQ(failures, 2);
    EXPECT_TRUE(f.session->wants_input());
}

TEST(Session, AnswersColumnsWorldsAndPings) {
    Fixture f;
    f.hello();
    f.send(ColumnQuery{.request_id = 1, .column = {.x = -5, .z = 9}});
    f.mailbox.run(1);
    f.send(WorldQuery{.request_id = 2});
    f.send(Ping{.nonce = 3});
    f.send(ColumnQuery{.request_id = 4, .column = {.x = kColumnCoordinateLimit - 1, .z = 0}});
    const auto messages = f.read();
    ASSERT_EQ(messages.size(), 4U);
    EXPECT_EQ(std::get<ColumnAnswer>(messages[0]).limits.size(), 3U);
    EXPECT_EQ(std::get<WorldAnswer>(messages[1]).toml, "format = 1\n");
    EXPECT_EQ(std::get<Pong>(messages[2]).nonce, 3U);
    EXPECT_EQ(failure_code(messages[3]), ErrorCode::out_of_range);
    EXPECT_EQ(std::get<Failure>(messages[3]).request_id, 4U);
}

TEST(Session, AnswersCancelledKeysAndStopsTheirWork) {
    Fixture f(1000, false);
    f.hello();
    f.request(7, {at(1), at(2)});
    f.request(8, {at(3)});
    f.gate.begun.acquire();
    f.send(ChunkCancel{.request_ids = {7, 99}});
    const auto messages = f.read();
    ASSERT_EQ(messages.size(), 2U);
    for (const AnyMessage& message : messages) {
        EXPECT_EQ(failure_code(message), ErrorCode::cancelled);
        EXPECT_EQ(std::get<Failure>(message).request_id, 7U);
    }
    EXPECT_EQ(count_of(f.counters, &OutcomeCounters::cancelled), 2U);
    f.gate.passes.release(2);
    f.mailbox.run(1);
    const auto rest = f.read();
    ASSERT_EQ(rest.size(), 1U);
    EXPECT_EQ(std::get<ChunkAnswer>(rest[0]).request_id, 8U);
}

TEST(Session, IsBusyAboveItsKeysInFlight) {
    Fixture f(1000, false);
    f.hello();
    std::uint32_t id = 0;
    for (std::size_t sent = 0; sent < kKeysInFlightPerSessionMax; sent += kKeysPerRequestMax) {
        std::vector<ChunkPos> keys;
        for (std::size_t i = 0; i < kKeysPerRequestMax; ++i) {
            keys.push_back(at(static_cast<std::int32_t>(sent + i)));
        }
        f.request(++id, keys);
    }
    EXPECT_TRUE(f.read().empty());
    EXPECT_LE(f.service->in_flight(), kWishesUnderWayMax);
    f.request(++id, {at(-1)});
    const auto messages = f.read();
    ASSERT_EQ(messages.size(), 1U);
    EXPECT_EQ(failure_code(messages[0]), ErrorCode::busy);
    EXPECT_GT(std::get<Failure>(messages[0]).retry_after_ms, 0U);
}

TEST(Session, ASlowReaderMakesNoWorkAndHoldsLittle) {
    constexpr std::size_t kPayloadBytes = 20'000;
    Fixture f(kPayloadBytes);
    f.hello();
    std::size_t keys_sent = 0;
    for (std::uint32_t id = 1; id <= 8; ++id) {
        std::vector<ChunkPos> keys;
        for (std::size_t i = 0; i < kKeysPerRequestMax; ++i) {
            keys.push_back(at(static_cast<std::int32_t>(keys_sent++)));
        }
        f.request(id, keys);
    }
    // The client reads nothing: what is under way comes in, and then it stands still.
    std::size_t answered = 0;
    while (f.service->in_flight() > 0 || answered < static_cast<std::size_t>(f.gate.builds)) {
        f.mailbox.run(1);
        ++answered;
    }
    EXPECT_LE(f.session->outbox().bytes(), kOutboxBytesMax + kPayloadBytes + 1000);
    EXPECT_LT(answered, 70U);  // the first window is guessed at 4 KiB an answer
    EXPECT_FALSE(f.session->wants_input());
    // It reads again: everything comes.
    std::size_t received = f.read().size();
    while (received < keys_sent) {
        if (f.service->in_flight() > 0 || answered < static_cast<std::size_t>(f.gate.builds)) {
            f.mailbox.run(1);
            ++answered;
        }
        received += f.read().size();
    }
    EXPECT_EQ(received, keys_sent);
    EXPECT_TRUE(f.session->wants_input());
}

TEST(Session, SendsTheUrgentFirst) {
    Fixture f(1000, false);
    f.hello();
    std::vector<ChunkPos> many;
    std::vector<ChunkPos> more;
    for (std::int32_t i = 0; i < 64; ++i) {
        many.push_back(at(i));
        more.push_back(at(100 + i));
    }
    f.request(1, many);
    f.request(2, more);
    f.request(3, {at(1000)}, {}, 5);
    f.gate.passes.release(10000);
    std::vector<std::uint32_t> order;
    while (order.size() < 129) {
        f.mailbox.run(1);
        for (const AnyMessage& message : f.read()) {
            order.push_back(std::get<ChunkAnswer>(message).request_id);
        }
    }
    const auto urgent = std::ranges::find(order, 3U) - order.begin();
    EXPECT_LT(urgent, 70) << "it came in when the first window was under way";
}

TEST(Session, GivesAnswersThatComeAfterItsEndToNobody) {
    Fixture f(1000, false);
    f.hello();
    f.request(7, {at(1)});
    f.gate.begun.acquire();
    f.session->end();
    EXPECT_EQ(f.service->in_flight(), 0U);
    EXPECT_TRUE(f.session->is_dead());
}

TEST(Session, WaitsForAHelloOnlySoLong) {
    Fixture f;
    f.now += f.context.timeouts.hello;
    f.session->tick(f.now);
    EXPECT_FALSE(f.session->is_closing());
    f.session->tick(f.now + 1ms);
    EXPECT_EQ(failure_code(f.read()[0]), ErrorCode::malformed);
    EXPECT_TRUE(f.session->is_closing());
}

TEST(Session, WaitsForTheRestOfAFrameOnlySoLong) {
    Fixture f;
    f.hello();
    const Bytes ping = encode_message(Ping{.nonce = 1});
    for (std::size_t i = 0; i + 1 < ping.size(); ++i) {  // a byte a second keeps nobody alive
        f.session->receive(std::span(ping).subspan(i, 1), f.now);
        f.now += 1s;
        f.session->tick(f.now);
    }
    EXPECT_TRUE(f.session->is_closing());
}

TEST(Session, AsksTheSilentAndThenLeavesThem) {
    Fixture f;
    f.hello();
    f.session->tick(f.now + 31s);
    f.session->tick(f.now + 32s);
    auto messages = f.read();
    ASSERT_EQ(messages.size(), 1U);
    EXPECT_TRUE(std::holds_alternative<Ping>(messages[0]));
    f.now += 40s;
    f.send(Pong{.nonce = 0});
    f.session->tick(f.now + 25s);
    EXPECT_FALSE(f.session->is_closing());
    f.session->tick(f.now + 61s);
    EXPECT_FALSE(f.session->is_closing()) << "it was not asked";
    messages = f.read();
    ASSERT_FALSE(messages.empty());
    EXPECT_TRUE(std::holds_alternative<Ping>(messages.back()));
    f.session->tick(f.now + 92s);
    messages = f.read();
    ASSERT_FALSE(messages.empty());
    EXPECT_TRUE(std::holds_alternative<Goodbye>(messages.back()));
    EXPECT_TRUE(f.session->is_closing());
}

// Its answers fill the outbox, so that it is not even listened to: every byte it takes counts.
TEST(Session, KeepsAClientThatReadsSlowly) {
    Fixture f(std::size_t{1} << 20U);
    f.hello();
    f.request(1, {at(0)});
    f.mailbox.run(1);
    f.read();
    for (std::uint32_t id = 2; id < 14; ++id) {
        f.request(id, {at(0)});  // out of the cache
    }
    ASSERT_GT(f.session->outbox().bytes(), std::size_t{1} << 20U);
    for (int second = 0; second < 61; ++second) {
        f.now += 1s;
        f.session->tick(f.now);
        f.session->written(1000, f.now);
        ASSERT_FALSE(f.session->is_closing()) << second;
    }
    while (!f.session->outbox().empty()) {
        f.session->written(f.session->outbox().bytes(), f.now);
    }
    f.session->tick(f.now);
    EXPECT_FALSE(f.session->is_closing());
    EXPECT_TRUE(f.session->wants_input());
}

TEST(Session, LeavesAClientThatDoesNotRead) {
    Fixture f;
    f.hello();
    f.send(Ping{.nonce = 1});
    f.session->tick(f.now);
    f.session->tick(f.now + 30s);
    EXPECT_FALSE(f.session->is_dead());
    f.session->tick(f.now + 31s);
    EXPECT_TRUE(f.session->is_dead());
}

TEST(Session, DrainsByAnsweringWhatIsUnderWay) {
    Fixture f(1000, false);
    f.hello();
    f.request(7, {at(1), at(2)});
    f.session->drain();
    EXPECT_FALSE(f.session->wants_input());
    auto messages = f.read();
    ASSERT_EQ(messages.size(), 1U);
    EXPECT_EQ(std::get<Goodbye>(messages[0]).code, ErrorCode::draining);
    EXPECT_FALSE(f.session->is_closing());
    f.gate.passes.release(2);
    f.mailbox.run(2);
    EXPECT_EQ(f.read().size(), 2U);
    EXPECT_TRUE(f.session->is_closing());
}

TEST(Session, EveryTruncatedRequestOnlyWaitsForMore) {
    const Bytes request = encode_message(chunk_request(1, {at(1)}));
    for (std::size_t size = 0; size < request.size(); ++size) {
        Fixture f;
        f.hello();
        f.session->receive(std::span(request).first(size), f.now);
        EXPECT_TRUE(f.read().empty()) << size;
        f.session->receive(std::span(request).subspan(size), f.now);
        f.mailbox.run(1);
        EXPECT_EQ(f.read().size(), 1U) << size;
    }
}

TEST(Session, EveryFlippedByteIsAnsweredOrEndsTheSession) {
    const Bytes request = encode_message(chunk_request(1, {at(1)}));
    for (std::size_t i = 0; i < request.size(); ++i) {
        Fixture f;
        f.hello();
        Bytes flipped = request;
        flipped[i] ^= std::byte{0x81};
        f.session->receive(flipped, f.now);
        f.session->tick(f.now + 31s);  // what now seems longer than it is, is not waited for
        if (f.session->is_closing()) {
            EXPECT_EQ(failure_code(f.read().at(0)) == static_cast<ErrorCode>(0), false) << i;
        } else {
            f.session->tick(f.now + 62s);
            EXPECT_TRUE(f.session->is_closing() || f.service->in_flight() > 0 ||
                        !f.session->outbox().empty() || f.gate.builds > 0)
                << i;
        }
    }
}

}  // namespace
}  // namespace terrane
