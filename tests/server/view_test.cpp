// The want-set against the rule of terrane.fbs, followed word by word.
#include "server/net/view.h"

#include "server/chunks/work_queue.h"
#include "tests/support/random_seed.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>

namespace terrane {
namespace {

/// Three heights of 32 voxels.
constexpr ViewWorld kWorld{
    .side = 32, .chunk_height = 32, .height_bound_voxels = 70.5, .levels = 18};

ViewUpdate view_at(double x, double z, std::vector<std::uint32_t> radii) {
    ViewUpdate update;
    update.x = x;
    update.y = 40;
    update.z = z;
    update.radius_chunks = std::move(radii);
    return update;
}

/// The quadtree as terrane.fbs tells it.
class Model {
  public:
    explicit Model(const ViewUpdate& update) : update_(update) {
        const auto top = static_cast<std::int32_t>(update.radius_chunks.size()) - 1;
        if (top < 0) {
            return;
        }
        const double side = 32.0 * std::exp2(top);
        const double radius = update.radius_chunks[static_cast<std::size_t>(top)] * side;
        const auto x0 = static_cast<std::int32_t>(std::floor((update.x - radius) / side)) - 2;
        const auto x1 = static_cast<std::int32_t>(std::floor((update.x + radius) / side)) + 2;
        const auto z0 = static_cast<std::int32_t>(std::floor((update.z - radius) / side)) - 2;
        const auto z1 = static_cast<std::int32_t>(std::floor((update.z + radius) / side)) + 2;
        for (std::int32_t x = x0; x <= x1; ++x) {
            for (std::int32_t z = z0; z <= z1; ++z) {
                const StackPos root{.lod = top, .x = x, .z = z};
                if (distance(root) <= radius) {
                    descend(root);
                }
            }
        }
    }

    std::set<ChunkPos> chunks;
    std::set<StackPos> leaves;

  private:
    double distance(StackPos square) const {
        const double side = 32.0 * std::exp2(square.lod);
        const auto along = [&](double at, double low) {
            return std::max({low - at, at - low - side, 0.0});
        };
        return std::max(along(update_.x, square.x * side), along(update_.z, square.z * side));
    }

    void descend(StackPos square) {
        if (square.lod > 0) {
            const auto below = static_cast<std::size_t>(square.lod) - 1;
            const double side = 32.0 * std::exp2(square.lod - 1);
            if (distance(square) < update_.radius_chunks[below] * side) {
                for (const std::int32_t dx : {0, 1}) {
                    for (const std::int32_t dz : {0, 1}) {
                        descend({.lod = square.lod - 1,
                                 .x = 2 * square.x + dx,
                                 .z = 2 * square.z + dz});
                    }
                }
                return;
            }
        }
        leaves.insert(square);
        for (std::int32_t y = 0; y < (square.lod == 0 ? 3 : 1); ++y) {
            chunks.insert({.lod = square.lod, .x = square.x, .y = y, .z = square.z});
        }
    }

    const ViewUpdate update_;
};

std::vector<ChunkPos> take_all(View& view, std::size_t count_max = 1 << 20) {
    std::vector<ChunkPos> keys;
    while (view.has_wish() && keys.size() < count_max) {
        keys.push_back(view.take());
    }
    return keys;
}

std::set<ChunkPos> forgotten(View& view) {
    std::set<ChunkPos> keys;
    while (view.has_forgotten()) {
        const auto some = view.take_forgotten(7);
        EXPECT_FALSE(some.empty());
        for (const ChunkPos key : some) {
            EXPECT_TRUE(keys.insert(key).second) << "told twice";
        }
    }
    return keys;
}

TEST(View, IsTheQuadtreeOfTheSchema) {
    std::mt19937 random(test_seed());
    std::uniform_real_distribution<double> place(-5000, 5000);
    for (int round = 0; round < 60; ++round) {
        std::vector<std::uint32_t> radii;
        for (std::size_t levels = random() % 6; radii.size() < levels;) {
            radii.push_back(static_cast<std::uint32_t>(random() % 9));
        }
        const bool on_the_grid = round % 4 == 0;
        const double x = on_the_grid ? 32.0 * static_cast<int>(random() % 9) : place(random);
        const ViewUpdate update = view_at(x, place(random), radii);
        const Model model(update);
        View view(kWorld, {});
        view.update(update);
        EXPECT_EQ(view.squares(), model.leaves.size());
        const auto keys = take_all(view);
        EXPECT_EQ(std::set(keys.begin(), keys.end()), model.chunks) << round;
        EXPECT_EQ(keys.size(), model.chunks.size()) << "nothing twice";
        for (const ChunkPos key : keys) {
            EXPECT_TRUE(view.contains(key));
        }
    }
}

// A client that follows what it is told has exactly the view, whatever has been sent of it.
TEST(View, ReplacesTheSetAndForgetsWhatLeft) {
    std::mt19937 random(test_seed());
    View view(kWorld, {});
    std::set<ChunkPos> held;
    std::set<ChunkPos> given_back;  // of which a client may be told too
    double x = -300;
    for (int step = 0; step < 300; ++step) {
        x += step % 50 == 49 ? 20'000 : static_cast<double>(random() % 40);
        auto update = view_at(x, 17, {3, 2, 3});
        if (step % 97 == 0) {
            update.radius_chunks.clear();
        }
        const Model model(update);
        view.update(update);
        for (const ChunkPos key : forgotten(view)) {
            EXPECT_FALSE(model.chunks.contains(key));
            EXPECT_EQ(held.erase(key) + given_back.erase(key), 1U) << "it was never handed out";
        }
        for (const ChunkPos key : held) {
            ASSERT_TRUE(model.chunks.contains(key)) << "it left and nobody was told";
        }
        const std::size_t count = step % 3 == 0 ? 1000 : random() % 30;
        for (const ChunkPos key : take_all(view, count)) {
            EXPECT_TRUE(model.chunks.contains(key));
            given_back.erase(key);
            if (random() % 8 == 0) {
                view.give_back(key);
                given_back.insert(key);
                continue;
            }
            EXPECT_TRUE(held.insert(key).second) << "handed out twice";
        }
        if (count == 1000) {
            for (const ChunkPos key : take_all(view)) {
                given_back.erase(key);
                held.insert(key);
            }
            EXPECT_EQ(held, model.chunks);
        }
    }
}

TEST(View, AnotherFormatIsWantedAllAgain) {
    View view(kWorld, {});
    auto update = view_at(10, 10, {2, 2});
    view.update(update);
    const auto first = take_all(view);
    view.update(update);
    EXPECT_FALSE(view.has_wish());
    update.format = ChunkFormat::columns;
    view.update(update);
    EXPECT_FALSE(view.has_forgotten());
    EXPECT_EQ(take_all(view).size(), first.size());
    update.without_flow = true;
    view.update(update);
    EXPECT_EQ(take_all(view).size(), first.size());
}

TEST(View, TheGroundUnderfootComesFirstAndItsRingNext) {
    View view(kWorld, {});
    auto update = view_at(40, -50, {8, 8, 8});  // in square (1, -2), chunk height 1
    update.direction = {.x = 1, .y = 0, .z = 0};
    update.field_of_view = 1;
    update.velocity = {.x = 400, .y = 0, .z = 0};
    view.update(update);
    EXPECT_GE(view.next_priority(), kNearPriority);
    const auto keys = take_all(view);
    EXPECT_EQ(keys[0], (ChunkPos{.lod = 0, .x = 1, .y = 1, .z = -2}));
    EXPECT_EQ(keys[1], (ChunkPos{.lod = 0, .x = 1, .y = 0, .z = -2}));
    EXPECT_EQ(keys[2], (ChunkPos{.lod = 0, .x = 1, .y = 2, .z = -2}));
    for (std::size_t i = 3; i < 27; ++i) {
        EXPECT_EQ(keys[i].lod, 0);
        EXPECT_LE(std::abs(keys[i].x - 1), 1) << i;
        EXPECT_LE(std::abs(keys[i].z + 2), 1) << i;
        EXPECT_GE(view.priority_of(stack_of(keys[i])), kNearPriority);
    }
    EXPECT_LT(view.priority_of(stack_of(keys[27])), kNearPriority);
}

TEST(View, WhatIsLookedAtAndFlownToComesEarlier) {
    const StackPos east{.lod = 0, .x = 6, .z = 0};
    const StackPos west{.lod = 0, .x = -6, .z = 0};
    const StackPos far_east{.lod = 0, .x = 12, .z = 0};
    View view(kWorld, {});
    auto update = view_at(16, 16, {16});
    view.update(update);
    EXPECT_EQ(view.priority_of(east), view.priority_of(west));
    EXPECT_GT(view.priority_of(east), view.priority_of(far_east));
    update.direction = {.x = 3, .y = -4, .z = 0};
    view.update(update);
    EXPECT_EQ(view.priority_of(east), view.priority_of(west)) << "no angle: all around";
    update.field_of_view = 1.2F;
    view.update(update);
    EXPECT_GT(view.priority_of(east), view.priority_of(west));
    update.field_of_view = 0;
    update.velocity = {.x = -96, .y = 0, .z = 0};  // in 2 s at (-5.5, 0.5)
    view.update(update);
    EXPECT_GT(view.priority_of(west), view.priority_of(east));
}

TEST(View, PrioritiesAreFoundAnewForWhatStillWaits) {
    View view(kWorld, {});
    view.update(view_at(16, 16, {16}));
    take_all(view, 3);
    view.update(view_at(16 + 32 * 10, 16, {16}));
    const ChunkPos first = view.take();
    EXPECT_EQ(first.x, 10);
    EXPECT_EQ(first.z, 0);
}

TEST(View, RadiusAndSquaresAreClampedOutermostFirst) {
    View small(kWorld, {.radius_max = 4, .squares_max = 100'000});
    small.update(view_at(16, 16, {4'000'000'000U, 0}));
    EXPECT_EQ(small.squares(), Model(view_at(16, 16, {4, 0})).leaves.size());
    View bounded(kWorld, {.radius_max = 64, .squares_max = 500});
    bounded.update(view_at(16, 16, std::vector<std::uint32_t>(18, 64)));
    EXPECT_LE(bounded.squares(), 500U);
    EXPECT_GT(bounded.squares(), 350U);
    for (const std::int32_t x : {-8, 8}) {
        EXPECT_TRUE(bounded.contains({.lod = 0, .x = x, .y = 0, .z = 0}));
    }
    View one_level({.side = 32, .chunk_height = 32, .height_bound_voxels = 70, .levels = 1}, {});
    one_level.update(view_at(16, 16, {2, 2, 2}));
    EXPECT_EQ(one_level.squares(), 25U);
}

TEST(View, EndsWhereCoordinatesDo) {
    View view(kWorld, {});
    const double edge = 2147483648.0 * 32;
    view.update(view_at(edge - 16, 16, {2}));
    EXPECT_EQ(view.squares(), 15U);
    view.update(view_at(9e15, -9e15, {16, 16, 16}));
    EXPECT_EQ(view.squares(), 0U);
    view.update(view_at(9e15, -9e15, std::vector<std::uint32_t>(18, 2)));
    for (const ChunkPos key : take_all(view)) {
        EXPECT_GT(key.lod, 0);
    }
}

TEST(View, ManyHeightsComeFromTheViewersOutwards) {
    View view({.side = 32, .chunk_height = 1, .height_bound_voxels = 16384, .levels = 1}, {});
    EXPECT_EQ(view.heights(), 16385);
    auto update = view_at(16, 16, {0});
    update.y = 9000.5;
    update.radius_chunks = {1};
    view.update(update);
    const auto keys = take_all(view, 16385);
    EXPECT_EQ(keys[0].y, 9000);
    EXPECT_EQ(keys[1].y, 8999);
    EXPECT_EQ(keys[2].y, 9001);
    EXPECT_EQ(keys.back().y, 0);
    EXPECT_EQ(std::set(keys.begin(), keys.end()).size(), 16385U);
    update.y = -1e15;
    update.x = 1e6;
    view.update(update);
    EXPECT_EQ(view.take().y, 0);
    std::size_t told = 0;
    while (view.has_forgotten()) {
        told += view.take_forgotten(4096).size();
    }
    EXPECT_EQ(told, 16385U);
}

// What a viewer needs for a horizon of 512 chunk sides: few squares, however far it sees.
TEST(View, AHorizonOf512SidesIsAffordable) {
    View view(kWorld, {});
    view.update(view_at(12345, -54321, {16, 16, 16, 16, 16, 16}));
    const auto keys = take_all(view);
    EXPECT_LT(view.squares(), 6500U);
    std::int64_t farthest = 0;
    for (const ChunkPos key : keys) {
        const std::int64_t x = (std::int64_t{key.x} << key.lod) * 32 - 12345;
        farthest = std::max(farthest, std::abs(x));
    }
    EXPECT_GE(farthest, 512 * 32);
    view.update(view_at(12345 + 50 / 30.0, -54321, {16, 16, 16, 16, 16, 16}));
    EXPECT_LT(view.waiting_squares(), 200U);
}

}  // namespace
}  // namespace terrane
