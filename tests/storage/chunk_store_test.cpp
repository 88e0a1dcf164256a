// What every store must do, tried on both.
#include "storage/chunk_store.h"

#include "storage/memory_store.h"
#include "storage/rocksdb_store.h"
#include "tests/storage/temporary_folder.h"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace terrane {
namespace {

StoreIdentity identity() {
    return {.fingerprint = {.high = 1, .low = 2},
            .content_id = {.high = 3, .low = 4},
            .generator_version = 1,
            .world_name = "contract"};
}

RecordKey stack_at(std::int32_t x, std::int32_t z) {
    return {.family = Family::stacks, .position = {.lod = 0, .x = x, .y = 0, .z = z}};
}

RecordKey mesh_at(std::int32_t x, std::int32_t y, std::int32_t z, std::uint8_t format = 1) {
    return {
        .family = Family::meshes, .format = format, .position = {.lod = 0, .x = x, .y = y, .z = z}};
}

std::string text(const Result<std::optional<Bytes>>& got) {
    if (!got) {
        return "error: " + got.error().message;
    }
    return *got ? std::string(text_of(**got)) : "nothing";
}

class AnyStore : public testing::TestWithParam<std::string> {
  protected:
    void SetUp() override {
        if (GetParam() == "memory") {
            store_ = std::make_unique<MemoryStore>(identity());
        } else {
            auto opened = open_rocksdb_store(folder_.path(), identity());
            ASSERT_TRUE(opened) << opened.error().message;
            store_ = std::move(*opened);
        }
    }

    void put(const RecordKey& key, std::string_view value) {
        const RecordToPut record{.key = key, .value = bytes_of(value)};
        ASSERT_TRUE(store_->put(std::span(&record, 1)));
    }

    TemporaryFolder folder_;
    std::unique_ptr<ChunkStore> store_;
};

TEST_P(AnyStore, GivesBackWhatWasPut) {
    put(stack_at(3, -4), "a stack");
    EXPECT_EQ(text(store_->get(stack_at(3, -4))), "a stack");
    EXPECT_EQ(text(store_->get(stack_at(-4, 3))), "nothing");
    EXPECT_EQ(text(store_->get(mesh_at(3, 0, -4))), "nothing");
}

TEST_P(AnyStore, KeepsAnEmptyValueApartFromNothing) {
    put(mesh_at(0, 0, 0), "");
    EXPECT_EQ(text(store_->get(mesh_at(0, 0, 0))), "");
}

TEST_P(AnyStore, TellsMeshesApartByHeightAndFormat) {
    put(mesh_at(1, 2, 3, 1), "a");
    put(mesh_at(1, 3, 3, 1), "b");
    put(mesh_at(1, 2, 3, 2), "c");
    EXPECT_EQ(text(store_->get(mesh_at(1, 2, 3, 1))), "a");
    EXPECT_EQ(text(store_->get(mesh_at(1, 3, 3, 1))), "b");
    EXPECT_EQ(text(store_->get(mesh_at(1, 2, 3, 2))), "c");
}

TEST_P(AnyStore, OverwritesAndErases) {
    put(stack_at(0, 0), "first");
    put(stack_at(0, 0), "second");
    EXPECT_EQ(text(store_->get(stack_at(0, 0))), "second");
    ASSERT_TRUE(store_->erase(stack_at(0, 0)));
    EXPECT_EQ(text(store_->get(stack_at(0, 0))), "nothing");
    EXPECT_TRUE(store_->erase(stack_at(0, 0))) << "erasing nothing is no failure";
}

TEST_P(AnyStore, AnswersManyInTheOrderAsked) {
    const std::vector<RecordToPut> records = {
        {.key = stack_at(1, 1), .value = bytes_of("one")},
        {.key = mesh_at(2, 2, 2), .value = bytes_of("two")},
    };
    ASSERT_TRUE(store_->put(records));
    const std::vector<RecordKey> keys = {mesh_at(2, 2, 2), stack_at(9, 9), stack_at(1, 1),
                                         mesh_at(2, 2, 2)};
    const auto got = store_->get_many(keys);
    ASSERT_TRUE(got);
    ASSERT_EQ(got->size(), 4U);
    EXPECT_EQ(text((*got)[0]), "two");
    EXPECT_EQ(text((*got)[1]), "nothing");
    EXPECT_EQ(text((*got)[2]), "one");
    EXPECT_EQ(text((*got)[3]), "two");
}

TEST_P(AnyStore, AcceptsNoKeysAndNoRecords) {
    EXPECT_TRUE(store_->put({}));
    const auto got = store_->get_many({});
    ASSERT_TRUE(got);
    EXPECT_TRUE(got->empty());
}

TEST_P(AnyStore, CountsWhatItDid) {
    put(stack_at(0, 0), "value");
    EXPECT_EQ(text(store_->get(stack_at(0, 0))), "value");
    EXPECT_EQ(text(store_->get(stack_at(1, 0))), "nothing");
    ASSERT_TRUE(store_->flush());
    const StoreStats stats = store_->stats();
    EXPECT_EQ(stats.gets, 2U);
    EXPECT_EQ(stats.hits, 1U);
    EXPECT_EQ(stats.puts, 1U);
    EXPECT_EQ(stats.corrupt, 0U);
    EXPECT_EQ(stats.failures, 0U);
}

TEST_P(AnyStore, ServesManyThreadsAtOnce) {
    constexpr std::int32_t kThreads = 4;
    constexpr std::int32_t kRecords = 200;
    std::atomic<int> wrong = 0;
    {
        std::vector<std::jthread> threads;
        for (std::int32_t thread = 0; thread < kThreads; ++thread) {
            threads.emplace_back([&, thread] {
                for (std::int32_t i = 0; i < kRecords; ++i) {
                    const std::string value = std::to_string(thread) + ":" + std::to_string(i);
                    const RecordToPut record{.key = stack_at(thread, i), .value = bytes_of(value)};
                    const RecordToPut shared{.key = stack_at(-1, i), .value = bytes_of("same")};
                    wrong += store_->put(std::span(&record, 1)) ? 0 : 1;
                    wrong += store_->put(std::span(&shared, 1)) ? 0 : 1;
                    wrong += text(store_->get(stack_at(thread, i))) == value ? 0 : 1;
                    wrong += text(store_->get(stack_at(-1, i))) == "same" ? 0 : 1;
                }
            });
        }
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(store_->stats().hits, 2U * kThreads * kRecords);
}

INSTANTIATE_TEST_SUITE_P(Stores, AnyStore, testing::Values("memory", "rocksdb"),
                         [](const auto& store) { return store.param; });

TEST(MemoryStore, StaysBelowItsLimitAndDropsTheOldest) {
    constexpr std::size_t kBytesMax = 1000;
    MemoryStore store(identity(), kBytesMax);
    const std::string value(100, 'v');
    for (std::int32_t x = 0; x < 50; ++x) {
        const RecordToPut record{.key = stack_at(x, 0), .value = bytes_of(value)};
        ASSERT_TRUE(store.put(std::span(&record, 1)));
        EXPECT_LE(store.bytes(), kBytesMax);
    }
    EXPECT_EQ(text(store.get(stack_at(0, 0))), "nothing");
    EXPECT_EQ(text(store.get(stack_at(49, 0))), value);
    EXPECT_GT(store.bytes(), kBytesMax / 2);
}

TEST(MemoryStore, KeepsNothingLargerThanItself) {
    MemoryStore store(identity(), 100);
    const std::string small = "small";
    const std::string large(200, 'v');
    for (const std::string_view value : {std::string_view(small), std::string_view(large)}) {
        const RecordToPut record{.key = stack_at(0, 0), .value = bytes_of(value)};
        ASSERT_TRUE(store.put(std::span(&record, 1)));
    }
    EXPECT_EQ(text(store.get(stack_at(0, 0))), "nothing") << "not the value that was overwritten";
    EXPECT_EQ(store.bytes(), 0U);
}

}  // namespace
}  // namespace terrane
