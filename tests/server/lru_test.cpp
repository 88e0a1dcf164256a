#include "server/chunks/lru.h"

#include <gtest/gtest.h>

#include <string>

namespace terrane {
namespace {

struct Identity {
    std::size_t operator()(int key) const { return static_cast<std::size_t>(key); }
};

constexpr std::size_t kEntryBytes = 100 + kLruEntryOverheadBytes;

using OneShard = ShardedLru<int, std::string, Identity, 1>;

std::shared_ptr<const std::string> value(const char* text) {
    return std::make_shared<const std::string>(text);
}

TEST(Lru, ForgetsWhatWasUsedLongestAgo) {
    OneShard cache(3 * kEntryBytes);
    cache.put(1, value("one"), 100);
    cache.put(2, value("two"), 100);
    cache.put(3, value("three"), 100);
    ASSERT_TRUE(cache.get(1));
    cache.put(4, value("four"), 100);
    EXPECT_FALSE(cache.get(2));
    EXPECT_EQ(*cache.get(1), "one");
    EXPECT_EQ(*cache.get(3), "three");
    EXPECT_EQ(*cache.get(4), "four");
}

TEST(Lru, NeverHoldsMoreThanItsBound) {
    OneShard cache(10 * kEntryBytes);
    for (int i = 0; i < 1000; ++i) {
        cache.put(i, value("x"), static_cast<std::size_t>(i % 700));
        ASSERT_LE(cache.size_bytes(), 10 * kEntryBytes);
    }
    EXPECT_GT(cache.size_bytes(), 5 * kEntryBytes);
}

TEST(Lru, DoesNotKeepWhatIsLargerThanTheBound) {
    OneShard cache(kEntryBytes);
    cache.put(1, value("fits"), 100);
    cache.put(2, value("does not"), 101);
    EXPECT_FALSE(cache.get(2));
    EXPECT_TRUE(cache.get(1));
}

TEST(Lru, ReplacesAValueAndItsSize) {
    OneShard cache(4 * kEntryBytes);
    cache.put(1, value("old"), 300);
    cache.put(1, value("new"), 100);
    EXPECT_EQ(*cache.get(1), "new");
    EXPECT_EQ(cache.size_bytes(), kEntryBytes);
}

TEST(Lru, AValueOutlivesItsEntry) {
    OneShard cache(kEntryBytes);
    cache.put(1, value("held"), 100);
    const auto held = cache.get(1);
    cache.put(2, value("next"), 100);
    EXPECT_FALSE(cache.get(1));
    EXPECT_EQ(*held, "held");
}

TEST(Lru, DividesItsBoundAmongTheShards) {
    ShardedLru<int, std::string, Identity, 4> cache(4 * kEntryBytes);
    for (int i = 0; i < 100; ++i) {
        cache.put(i, value("x"), 100);
    }
    // Small keys share the high bits of their hash: one shard, one entry.
    EXPECT_EQ(cache.size_bytes(), kEntryBytes);
}

}  // namespace
}  // namespace terrane
