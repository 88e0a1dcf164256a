// The service's decisions, with a build step that the test lets through one task at a time.
#include "server/chunks/chunk_service.h"

#include "tests/server/gated_step.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <latch>
#include <new>
#include <thread>

namespace terrane {
namespace {

/// Collects answers; `wait` blocks until that many have come.
class Inbox {
  public:
    AnswerCallback callback() {
        return [this](const Result<Answer>& answer) {
            const MutexLock lock(mutex_);
            answers_.push_back(answer);
            changed_.notify_all();
        };
    }

    std::vector<Result<Answer>> wait(std::size_t count) {
        MutexLock lock(mutex_);
        while (answers_.size() < count) {
            lock.wait(changed_);
        }
        return answers_;
    }

    std::size_t size() {
        const MutexLock lock(mutex_);
        return answers_.size();
    }

  private:
    Mutex mutex_;
    std::condition_variable_any changed_;
    std::vector<Result<Answer>> answers_ TERRANE_GUARDED_BY(mutex_);
};

WorkKey chunk(std::int32_t x, std::int32_t y = 0) {
    return ChunkKey{.position = {.lod = 0, .x = x, .y = y, .z = 0}};
}

struct Fixture {
    explicit Fixture(ServiceOptions options = {}, bool open = true) : options_(options) {
        gate.open = open;
        service.emplace(options_, counters, gate.maker());
    }

    ~Fixture() {
        gate.passes.release(10000);
        service->stop();
    }

    Result<std::optional<Answer>> request(const WorkKey& key, std::int32_t priority = 0,
                                          FlowId flow = 0) {
        last_id = service->new_waiter_id();
        return service->request(key, priority,
                                {.id = last_id, .answer = inbox.callback(), .flow = flow});
    }

    /// The x of the chunks that were answered, in that order.
    std::vector<std::int32_t> answered(std::size_t count) {
        std::vector<std::int32_t> order;
        for (const auto& answer : inbox.wait(count)) {
            order.push_back(answer ? std::get<ServedChunk>(*answer).key.position.x : -1);
        }
        return order;
    }

    const ServiceOptions options_;
    Gate gate;
    ServiceCounters counters;
    Inbox inbox;
    WaiterId last_id = 0;
    std::optional<ChunkService> service;
};

TEST(ChunkService, AnswersByCallbackAndThenFromTheCache) {
    Fixture f;
    const auto first = f.request(chunk(1));
    ASSERT_TRUE(first);
    EXPECT_FALSE(*first);
    const auto answers = f.inbox.wait(1);
    ASSERT_TRUE(answers[0]);
    EXPECT_EQ(std::get<ServedChunk>(*answers[0]).source, ChunkSource::generated);
    const auto second = f.request(chunk(1));
    ASSERT_TRUE(second && *second);
    EXPECT_EQ(std::get<ServedChunk>(**second).source, ChunkSource::cache);
    EXPECT_EQ(count_of(f.counters, &OutcomeCounters::cache), 1U);
    EXPECT_EQ(f.gate.builds, 1);
}

TEST(ChunkService, TwoHundredClientsOfOneColdChunkAreOneBuild) {
    constexpr std::size_t kClients = 200;
    Fixture f({.workers = 4}, false);
    std::latch together(8);
    {
        std::vector<std::jthread> clients;
        for (int i = 0; i < 8; ++i) {
            clients.emplace_back([&] {
                together.arrive_and_wait();
                for (std::size_t k = 0; k < kClients / 8; ++k) {
                    const auto id = f.service->new_waiter_id();
                    const auto answer =
                        f.service->request(chunk(7), 0, {.id = id, .answer = f.inbox.callback()});
                    EXPECT_TRUE(answer);
                }
            });
        }
    }
    f.gate.begun.acquire();
    f.gate.passes.release();
    for (const auto& answer : f.inbox.wait(kClients)) {
        EXPECT_TRUE(answer);
    }
    EXPECT_EQ(f.gate.builds, 1);
    EXPECT_EQ(count_of(f.counters.joins), kClients - 1);
}

TEST(ChunkService, FormatsOfOneChunkAreDifferentAnswers) {
    Fixture f;
    const ChunkPos at{.lod = 0, .x = 1, .y = 2, .z = 3};
    ASSERT_TRUE(f.request(ChunkKey{.position = at, .format = ChunkFormat::draco}));
    ASSERT_TRUE(f.request(ChunkKey{.position = at, .format = ChunkFormat::columns}));
    ASSERT_TRUE(
        f.request(ChunkKey{.position = at, .format = ChunkFormat::columns, .without_flow = true}));
    ASSERT_TRUE(f.request(ChunkKey{.position = at, .format = ChunkFormat::draco_blocky}));
    f.inbox.wait(4);
    EXPECT_EQ(f.gate.builds, 4);
    const auto same =
        f.request(ChunkKey{.position = at, .format = ChunkFormat::draco, .without_flow = true});
    EXPECT_TRUE(same && *same) << "a mesh has no flow, so both are one";
}

TEST(ChunkService, TheLastToCancelStopsTheJob) {
    Fixture f({}, false);
    ASSERT_TRUE(f.request(chunk(1)));
    const WaiterId first = f.last_id;
    ASSERT_TRUE(f.request(chunk(1)));
    f.gate.begun.acquire();
    f.service->cancel(chunk(1), first);
    EXPECT_EQ(count_of(f.counters, &OutcomeCounters::cancelled), 0U);
    f.service->cancel(chunk(1), f.last_id);
    EXPECT_EQ(count_of(f.counters, &OutcomeCounters::cancelled), 1U);
    EXPECT_EQ(f.service->in_flight(), 0U);
    ASSERT_TRUE(f.request(chunk(2)));
    f.gate.passes.release(2);
    const auto answers = f.inbox.wait(1);
    EXPECT_EQ(std::get<ServedChunk>(*answers[0]).key, std::get<ChunkKey>(chunk(2)));
}

TEST(ChunkService, AJobCancelledInTheQueueIsNeverBuilt) {
    Fixture f({}, false);
    ASSERT_TRUE(f.request(chunk(1)));
    f.gate.begun.acquire();
    ASSERT_TRUE(f.request(chunk(2)));
    EXPECT_EQ(f.service->queued_jobs(), 1U);
    f.service->cancel(chunk(2), f.last_id);
    EXPECT_EQ(f.service->queued_jobs(), 0U);
    ASSERT_TRUE(f.request(chunk(3)));
    f.gate.passes.release(2);
    f.inbox.wait(2);
    EXPECT_EQ(f.gate.builds, 2);
}

TEST(ChunkService, ALateResultOfAStoppedJobDoesNotAnswerItsSuccessor) {
    Fixture f({}, false);
    ASSERT_TRUE(f.request(chunk(1)));
    f.gate.begun.acquire();
    f.service->cancel(chunk(1), f.last_id);
    ASSERT_TRUE(f.request(chunk(1)));
    f.gate.passes.release();  // the stopped one ends
    f.gate.begun.acquire();   // its successor has begun
    EXPECT_EQ(f.inbox.size(), 0U);
    f.gate.passes.release();
    EXPECT_TRUE(f.inbox.wait(1)[0]);
    EXPECT_EQ(f.gate.builds, 2);
}

TEST(ChunkService, IsBusyWhenTheQueueIsFull) {
    Fixture f({.queued_jobs_max = 2}, false);
    ASSERT_TRUE(f.request(chunk(1)));
    f.gate.begun.acquire();
    ASSERT_TRUE(f.request(chunk(2)));
    ASSERT_TRUE(f.request(chunk(3)));
    const auto refused = f.request(chunk(4));
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::busy);
    EXPECT_GE(f.service->retry_after_ms(), 20U);
    EXPECT_EQ(count_of(f.counters, &OutcomeCounters::busy), 1U);
    EXPECT_TRUE(f.request(chunk(3))) << "joining needs no room in the queue";
    f.gate.passes.release(3);
    f.inbox.wait(4);
    EXPECT_TRUE(f.request(chunk(4)));
}

TEST(ChunkService, IsBusyAtTheLimitsOfKeysAndWaiters) {
    Fixture keys({.keys_in_flight_max = 2}, false);
    ASSERT_TRUE(keys.request(chunk(1, 0)));
    ASSERT_TRUE(keys.request(chunk(1, 1)));
    EXPECT_EQ(keys.request(chunk(1, 2)).error().code, ErrorCode::busy);
    Fixture waiters({.waiters_max = 2}, false);
    ASSERT_TRUE(waiters.request(chunk(1)));
    ASSERT_TRUE(waiters.request(chunk(1)));
    EXPECT_EQ(waiters.request(chunk(1)).error().code, ErrorCode::busy);
}

TEST(ChunkService, ServesTheMoreUrgentFirst) {
    Fixture f({}, false);
    ASSERT_TRUE(f.request(chunk(1)));
    f.gate.begun.acquire();
    ASSERT_TRUE(f.request(chunk(2), 0));
    ASSERT_TRUE(f.request(chunk(3), 1));
    ASSERT_TRUE(f.request(chunk(4), 0));
    ASSERT_TRUE(f.request(chunk(4), 2));
    f.gate.passes.release(4);
    const auto answers = f.inbox.wait(5);
    std::vector<std::int32_t> order;
    for (const auto& answer : answers) {
        order.push_back(std::get<ServedChunk>(*answer).key.position.x);
    }
    EXPECT_EQ(order, (std::vector<std::int32_t>{1, 4, 4, 3, 2}));
}

TEST(ChunkService, SharesWorkersFairlyBetweenFlowsAndNearBeforeFar) {
    Fixture f({}, false);
    ASSERT_TRUE(f.request(chunk(1)));
    f.gate.begun.acquire();
    for (std::int32_t x = 100; x < 200; ++x) {
        ASSERT_TRUE(f.request(chunk(x), 8, 1));
    }
    ASSERT_TRUE(f.request(chunk(2), -8, 2));
    ASSERT_TRUE(f.request(chunk(3), kNearPriority, 3));
    f.gate.passes.release(103);
    const auto order = f.answered(103);
    EXPECT_EQ(order[1], 3) << "near, so before everybody's far chunks";
    EXPECT_LT(std::ranges::find(order, 2) - order.begin(), 5) << "the other flow waits for 100";
}

TEST(ChunkService, APriorityCanBeChangedWhileItWaits) {
    Fixture f({}, false);
    ASSERT_TRUE(f.request(chunk(1)));
    f.gate.begun.acquire();
    ASSERT_TRUE(f.request(chunk(2), 5));
    const WaiterId second = f.last_id;
    ASSERT_TRUE(f.request(chunk(3), 4));
    ASSERT_TRUE(f.request(chunk(4), 3));
    f.service->change_priority(chunk(4), f.last_id, 7);
    f.service->change_priority(chunk(2), second, 1);
    f.service->change_priority(chunk(2), 12345, 100);  // does not wait
    f.gate.passes.release(4);
    EXPECT_EQ(f.answered(4), (std::vector<std::int32_t>{1, 4, 3, 2}));
}

TEST(ChunkService, AJobIsServedForWhoIsLeftWhenItsMostUrgentLeaves) {
    Fixture f({}, false);
    ASSERT_TRUE(f.request(chunk(1)));
    f.gate.begun.acquire();
    ASSERT_TRUE(f.request(chunk(2), 9, 1));
    const WaiterId urgent = f.last_id;
    ASSERT_TRUE(f.request(chunk(2), 0, 2));
    ASSERT_TRUE(f.request(chunk(3), 5, 2));
    f.service->cancel(chunk(2), urgent);
    EXPECT_EQ(count_of(f.counters, &OutcomeCounters::cancelled), 0U);
    f.gate.passes.release(3);
    EXPECT_EQ(f.answered(3), (std::vector<std::int32_t>{1, 3, 2}));
}

TEST(ChunkService, WantOfMemoryFailsOneTaskOnly) {
    ServiceCounters counters;
    Inbox inbox;
    ChunkService service({}, counters, [] {
        return [](const Task& task) -> Result<Answer> {
            const auto key = std::get<ChunkKey>(task.key);
            if (key.position.x == 1) {
                throw std::bad_alloc();
            }
            return ServedChunk{.key = key,
                               .chunk = std::make_shared<const EncodedChunk>(),
                               .source = ChunkSource::generated,
                               .timings = {}};
        };
    });
    const auto ask = [&](std::int32_t x, AnswerCallback callback) {
        return service.request(chunk(x), 0,
                               {.id = service.new_waiter_id(), .answer = std::move(callback)});
    };
    ASSERT_TRUE(ask(1, inbox.callback()));
    EXPECT_EQ(inbox.wait(1)[0].error().code, ErrorCode::internal);
    ASSERT_TRUE(ask(2, [](const Result<Answer>&) { throw std::bad_alloc(); }));
    ASSERT_TRUE(ask(3, inbox.callback()));
    EXPECT_TRUE(inbox.wait(2)[1]) << "a callback that throws does not end the worker";
}

TEST(ChunkService, AStackWithManyWishesGivesWayToOthers) {
    Fixture f({}, false);
    ASSERT_TRUE(f.request(chunk(1, 0)));
    f.gate.begun.acquire();
    for (std::int32_t y = 1; y < 100; ++y) {
        ASSERT_TRUE(f.request(chunk(1, y)));
    }
    ASSERT_TRUE(f.request(chunk(2)));
    f.gate.passes.release(101);
    const auto answers = f.inbox.wait(101);
    EXPECT_EQ(std::get<ServedChunk>(*answers[kTasksPerTurnMax]).key, std::get<ChunkKey>(chunk(2)));
}

TEST(ChunkService, AnExceptionFailsOneTaskOnly) {
    Fixture f;
    ASSERT_TRUE(f.request(chunk(1, 666)));
    const auto answers = f.inbox.wait(1);
    ASSERT_FALSE(answers[0]);
    EXPECT_EQ(answers[0].error().code, ErrorCode::internal);
    EXPECT_EQ(count_of(f.counters, &OutcomeCounters::failed), 1U);
    ASSERT_TRUE(f.request(chunk(1, 1)));
    EXPECT_TRUE(f.inbox.wait(2)[1]);
}

TEST(ChunkService, RefusesWhatItCanNotMake) {
    Fixture f;
    for (const std::int32_t lod : {-1, kLodMax + 1, std::numeric_limits<std::int32_t>::max()}) {
        const auto answer = f.request(ChunkKey{.position = {.lod = lod, .x = 0, .y = 0, .z = 0}});
        ASSERT_FALSE(answer);
        EXPECT_EQ(answer.error().code, ErrorCode::unsupported);
    }
    const auto high = f.request(ChunkKey{.position = {.lod = 1, .x = 0, .y = 1, .z = 0}});
    ASSERT_FALSE(high);
    EXPECT_EQ(high.error().code, ErrorCode::out_of_range);
    const auto unknown = f.request(ChunkKey{.position = {}, .format = static_cast<ChunkFormat>(4)});
    ASSERT_FALSE(unknown);
    EXPECT_EQ(unknown.error().code, ErrorCode::unsupported);
    const auto far_blocks = f.request(ChunkKey{.position = {.lod = 1, .x = 0, .y = 0, .z = 0},
                                               .format = ChunkFormat::draco_blocky});
    ASSERT_FALSE(far_blocks);
    EXPECT_EQ(far_blocks.error().code, ErrorCode::unsupported);
    EXPECT_NE(far_blocks.error().message.find("blocky"), std::string::npos);
    constexpr std::int64_t kEnd = (std::int64_t{1} << 31) * 32;
    for (const std::int64_t at :
         {kEnd, -kEnd - 1, kColumnCoordinateLimit, std::numeric_limits<std::int64_t>::min(),
          std::numeric_limits<std::int64_t>::max()}) {
        EXPECT_EQ(f.request(ColumnPos{.x = at, .z = 0}).error().code, ErrorCode::out_of_range);
        EXPECT_EQ(f.request(ColumnPos{.x = 0, .z = at}).error().code, ErrorCode::out_of_range);
    }
    EXPECT_TRUE(f.request(ColumnPos{.x = kEnd - 1, .z = -kEnd}));
    f.inbox.wait(1);
}

TEST(ChunkService, DrainingRefusesTheNewAndFinishesTheOld) {
    Fixture f({}, false);
    ASSERT_TRUE(f.request(chunk(1)));
    f.gate.begun.acquire();
    f.service->drain();
    EXPECT_EQ(f.request(chunk(2)).error().code, ErrorCode::draining);
    f.gate.passes.release();
    EXPECT_TRUE(f.inbox.wait(1)[0]);
}

TEST(ChunkService, StoppingAnswersWhoStillWaits) {
    Fixture f({}, false);
    ASSERT_TRUE(f.request(chunk(1)));
    f.gate.begun.acquire();
    ASSERT_TRUE(f.request(chunk(2)));
    f.gate.passes.release();
    f.service->stop();
    const auto answers = f.inbox.wait(2);
    for (const auto& answer : answers) {
        if (!answer) {
            EXPECT_EQ(answer.error().code, ErrorCode::draining);
        }
    }
    EXPECT_FALSE(answers[1]);
}

}  // namespace
}  // namespace terrane
