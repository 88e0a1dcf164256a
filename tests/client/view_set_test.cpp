#include "client-sample/cpp/view_set.h"

#include "tests/client/scripted_peer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

namespace terrane {
namespace {

ServerHello hello_with_views() {
    ServerHello hello = test_hello();
    hello.levels = 8;
    hello.limits.view_radius_max = 16;
    return hello;
}

/// The rule as it is written, square by square.
class Rule {
  public:
    Rule(const ViewUpdate& view, const ServerHello& world) : view_(view), side_(world.chunk_side) {
        const auto top = static_cast<std::int32_t>(view.radius_chunks.size()) - 1;
        for (std::int32_t z = -200; z <= 200; ++z) {
            for (std::int32_t x = -200; x <= 200; ++x) {
                if (distance({.lod = top, .x = x, .z = z}) <= radius(top) * side_of(top)) {
                    split_or_keep({.lod = top, .x = x, .z = z});
                }
            }
        }
    }

    const std::set<StackPos>& leaves() const { return leaves_; }

  private:
    double radius(std::int32_t lod) const {
        return view_.radius_chunks[static_cast<std::size_t>(lod)];
    }

    double side_of(std::int32_t lod) const { return side_ * std::exp2(lod); }

    double distance(StackPos square) const {
        const double side = side_of(square.lod);
        const auto along = [&](double at, std::int32_t index) {
            return std::max({index * side - at, at - (index + 1.0) * side, 0.0});
        };
        return std::max(along(view_.x, square.x), along(view_.z, square.z));
    }

    void split_or_keep(StackPos square) {
        if (square.lod > 0 && distance(square) < radius(square.lod - 1) * side_of(square.lod - 1)) {
            for (const auto& [x, z] : {std::pair(0, 0), {1, 0}, {0, 1}, {1, 1}}) {
                split_or_keep(
                    {.lod = square.lod - 1, .x = 2 * square.x + x, .z = 2 * square.z + z});
            }
            return;
        }
        leaves_.insert(square);
    }

    const ViewUpdate& view_;
    double side_;
    std::set<StackPos> leaves_;
};

TEST(ViewSet, IsTheRuleOfTheSchema) {
    const ServerHello hello = hello_with_views();
    std::mt19937 random(7);
    for (int round = 0; round < 60; ++round) {
        ViewUpdate view;
        view.x = round % 3 == 0 ? 64.0 * (round - 30)
                                : std::uniform_real_distribution<double>(-900, 900)(random);
        view.z = std::uniform_real_distribution<double>(-900, 900)(random);
        for (int level = 0; level <= round % 5; ++level) {
            view.radius_chunks.push_back(
                std::uniform_int_distribution<std::uint32_t>(0, 6)(random));
        }
        const ViewSet set(view, hello);
        const auto squares = set.squares();
        const Rule rule(view, hello);
        EXPECT_EQ(std::set<StackPos>(squares.begin(), squares.end()), rule.leaves()) << round;
        EXPECT_EQ(set.size(), squares.size());
        EXPECT_EQ(squares.size(), rule.leaves().size());
        for (const StackPos square : rule.leaves()) {
            EXPECT_TRUE(set.contains(square));
        }
    }
}

TEST(ViewSet, HoldsRadiiAndLevelsToTheServers) {
    ServerHello hello = hello_with_views();
    hello.levels = 1;
    hello.limits.view_radius_max = 1;
    ViewUpdate view;
    view.x = 16;
    view.z = 16;
    view.radius_chunks = {9, 9};
    EXPECT_EQ(ViewSet(view, hello).size(), 9U);
    EXPECT_EQ(ViewSet().size(), 0U);
    EXPECT_EQ(ViewSet(ViewUpdate{}, hello).size(), 0U);
}

TEST(ViewSet, ALeafOfLevelZeroIsEveryHeightUpToTheBound) {
    ServerHello hello = hello_with_views();
    hello.height_bound_voxels = 95.5;
    EXPECT_EQ(heights_of(0, hello), 3);
    hello.height_bound_voxels = 96;
    EXPECT_EQ(heights_of(0, hello), 4);
    EXPECT_EQ(heights_of(2, hello), 1);
}

}  // namespace
}  // namespace terrane
