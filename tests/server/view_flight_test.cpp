// A short dose of tests/bench/view: a viewer that flies through a real world, stepped by hand.
// Counts only, no times.
#include "server/chunks/build_chunk.h"
#include "server/chunks/store_identity.h"
#include "storage/memory_store.h"
#include "tests/server/session_fixture.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <set>

namespace terrane {
namespace {

/// A session whose service makes a real world, and what its workers did.
struct Flight : SessionFixture {
    explicit Flight(std::size_t workers) : world(load_shipped_world("basin")) {
        store.emplace(store_identity_of(*world));
        service.emplace(
            ServiceOptions{.workers = workers, .side_columns = world->definition.grid.side},
            counters, [this] {
                auto builder = std::make_shared<ChunkBuilder>(BuildContext{.world = world.get(),
                                                                           .store = &*store,
                                                                           .stacks = &stacks,
                                                                           .counters = &counters,
                                                                           .on_notice = {}});
                return [this, builder = std::move(builder)](const Task& task) {
                    const int now_at = place;
                    auto answer = builder->build(task);
                    if (const auto* chunk = std::get_if<ChunkKey>(&task.key)) {
                        const MutexLock lock(mutex);
                        begun.emplace_back(now_at, chunk->position);
                        if (answer) {
                            ++made[chunk->position];
                        }
                    }
                    return answer;
                };
            });
        context.service = &*service;
        context.hello.levels = levels_supported();
        context.hello.height_bound_voxels = world->stack.height_bound;
        begin();
        hello();
    }

    ~Flight() {
        session->end();
        service->stop();
    }

    ViewUpdate look(double x) {
        ViewUpdate update;
        update.x = x;
        update.y = 150;
        update.z = 16;
        update.direction = {.x = 1, .y = 0, .z = 0};
        update.field_of_view = 1.2F;
        update.velocity = {.x = 50, .y = 0, .z = 0};
        update.radius_chunks = {2, 2, 2};
        send(update);
        view.update(update);
        return update;
    }

    /// Reads all, gives the credit back, and follows what it is told.
    void take() {
        std::size_t payload = 0;
        for (const AnyMessage& message : read()) {
            if (const auto* chunk = std::get_if<ChunkAnswer>(&message)) {
                payload += chunk->payload_bytes;
                out_of_view += view.contains(chunk->key) ? 0U : 1U;
                EXPECT_TRUE(held.insert(chunk->key).second) << "sent twice";
            } else if (const auto* forget = std::get_if<ChunkForget>(&message)) {
                for (const ChunkPos key : forget->keys) {
                    held.erase(key);
                }
            } else {
                ADD_FAILURE() << name_of(message);
            }
        }
        payload_bytes += payload;
        send(Credit{.bytes = payload});
    }

    /// Until all of the view is there.
    void fill() {
        std::size_t before = 0;
        do {
            before = held.size();
            settle();
            take();
        } while (held.size() != before || service->in_flight() > 0);
    }

    std::set<ChunkPos> wanted() const {
        View all({.side = 32,
                  .chunk_height = 32,
                  .height_bound_voxels = world->stack.height_bound,
                  .levels = levels_supported()},
                 {});
        ViewUpdate update;
        update.x = last_x;
        update.z = 16;
        update.radius_chunks = {2, 2, 2};
        all.update(update);
        std::set<ChunkPos> keys;
        while (all.has_wish()) {
            keys.insert(all.take());
        }
        return keys;
    }

    std::shared_ptr<const World> world;
    std::optional<MemoryStore> store;
    StackCache stacks{std::size_t{64} << 20U};
    Mutex mutex;
    std::vector<std::pair<int, ChunkPos>> begun TERRANE_GUARDED_BY(mutex);
    std::map<ChunkPos, int> made TERRANE_GUARDED_BY(mutex);
    std::atomic<int> place = 0;
    View view{{.side = 32, .chunk_height = 32, .height_bound_voxels = 366, .levels = 18}, {}};
    std::set<ChunkPos> held;
    std::size_t out_of_view = 0;
    std::size_t payload_bytes = 0;
    double last_x = 16;
};

TEST(ViewFlight, EveryChunkIsMadeOnceAndComesWhileItIsInView) {
    Flight f(1);
    f.look(f.last_x);
    f.fill();
    EXPECT_EQ(f.held, f.wanted());
    for (int update = 0; update < 60; ++update) {
        f.last_x += 10;
        f.look(f.last_x);
        if (update % 3 == 0) {
            f.settle();
        }
        f.take();
    }
    f.fill();
    EXPECT_EQ(f.held, f.wanted());
    EXPECT_EQ(f.out_of_view, 0U);
    EXPECT_GT(f.payload_bytes, 100'000U);
    const MutexLock lock(f.mutex);
    std::set<StackPos> places;
    for (const auto& [key, times] : f.made) {
        EXPECT_EQ(times, 1);
        places.insert(stack_of(key));
    }
    EXPECT_LE(count_of(f.counters.generations), places.size() + 1) << "one is settle's own";
}

TEST(ViewFlight, ATeleportEndsTheWorkOfTheOldPlaceWithinOneJobAWorker) {
    constexpr std::size_t kWorkers = 2;
    Flight f(kWorkers);
    for (int leap = 0; leap < 20; ++leap) {
        f.last_x = 16 + 1e5 * leap;
        f.look(f.last_x);
        f.place = leap;  // what begins from here on should be of the new place
        while (f.held.empty()) {
            f.mailbox.run(1);
            f.take();
        }
        f.held.clear();
    }
    f.session->end();
    f.service->stop();
    const MutexLock lock(f.mutex);
    std::map<int, std::size_t> late;
    for (const auto& [at_place, key] : f.begun) {
        const double x = static_cast<double>(key.x) * 32 * static_cast<double>(1 << key.lod);
        const int of_place = static_cast<int>((x + 5e4) / 1e5);
        if (of_place < at_place) {
            ++late[at_place];
        }
    }
    for (const auto& [at_place, count] : late) {
        EXPECT_LE(count, kWorkers) << at_place;
    }
    EXPECT_GT(count_of(f.counters, &OutcomeCounters::cancelled), 0U);
}

}  // namespace
}  // namespace terrane
