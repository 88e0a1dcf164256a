// An area's hash and its records: the same for any number of workers and any order.
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/load_world.h"
#include "generator/volume/chunk.h"
#include "generator/volume/chunk_codec.h"
#include "server/chunks/store_identity.h"
#include "server/cli/preseed.h"
#include "server/cli/verify.h"
#include "storage/memory_store.h"

#include <gtest/gtest.h>

#include <filesystem>

namespace terrane {
namespace {

constexpr StackRectangle kArea = {.x_first = -5, .z_first = -4, .x_end = 6, .z_end = 5};

std::shared_ptr<const World> sample_world(const std::string& name = "paper-B1.toml") {
    auto loaded = load_world(std::filesystem::path(TERRANE_SOURCE_DIR) / "generator/worlds" / name);
    for (const WorldFileFault& fault : loaded.faults) {
        ADD_FAILURE() << fault.text();
    }
    return loaded.world;
}

Result<AreaHash> hash_of(const World& world, const StackRectangle& area, std::size_t workers,
                         std::optional<std::uint64_t> seed = std::nullopt) {
    return hash_area(world, *StackBatches::cut(area, seed), workers);
}

TEST(AreaHash, IsOneForAnyWorkersAndAnyOrder) {
    const auto world = sample_world();
    ASSERT_TRUE(world);
    const auto hash = hash_of(*world, kArea, 1);
    ASSERT_TRUE(hash) << hash.error().message;
    EXPECT_TRUE(hash->whole);
    EXPECT_EQ(hash->chunks, 11U * 9U * static_cast<std::uint64_t>(chunks_in_stack(*world)));
    for (const std::size_t workers : {2U, 4U}) {
        EXPECT_EQ(hash_of(*world, kArea, workers), hash);
    }
    for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U}) {
        EXPECT_EQ(hash_of(*world, kArea, 2, seed), hash) << "seed " << seed;
    }
}

TEST(AreaHash, IsTheSumOverPartsAndOfWhatIsDocumented) {
    const auto world = sample_world();
    ASSERT_TRUE(world);
    StackGenerator generator(*world);
    Stack stack;
    Hash128 expected;
    for (std::int32_t x = -1; x < 1; ++x) {
        ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = x, .z = 3}));
        for (std::int32_t y = 0; y < chunks_in_stack(*world); ++y) {
            Chunk chunk;
            cut_chunk(chunk, stack, y, world->definition.grid.height);
            Bytes encoded;
            encode_chunk(encoded, chunk);
            Bytes bytes;
            ByteWriter writer(bytes);
            for (const std::int32_t value : {0, x, y, 3}) {
                writer.fixed(value);
            }
            writer.raw(encoded);
            expected = sum_of(expected, hash128(bytes));
        }
    }
    const auto west = hash_of(*world, {.x_first = -1, .z_first = 3, .x_end = 0, .z_end = 4}, 1);
    const auto east = hash_of(*world, {.x_first = 0, .z_first = 3, .x_end = 1, .z_end = 4}, 1);
    ASSERT_TRUE(west && east);
    EXPECT_EQ(sum_of(west->hash, east->hash), expected);
    EXPECT_NE(west->hash, east->hash);
}

TEST(AreaHash, ReachesTheChunkOfTheHeightBound) {
    const auto world = sample_world();
    ASSERT_TRUE(world);
    const double bound = world->stack.height_bound;
    const double height = world->definition.grid.height;
    EXPECT_LE((chunks_in_stack(*world) - 1) * height, bound);
    EXPECT_GT(chunks_in_stack(*world) * height, bound);
}

TEST(AreaHash, DiffersBetweenWorldsAndAreas) {
    const auto world = sample_world();
    const auto other = sample_world("basin.toml");
    ASSERT_TRUE(world && other);
    const StackRectangle area = {.x_first = 0, .z_first = 0, .x_end = 1, .z_end = 1};
    const StackRectangle beside = {.x_first = 1, .z_first = 0, .x_end = 2, .z_end = 1};
    EXPECT_NE(hash_of(*world, area, 1)->hash, hash_of(*other, area, 1)->hash);
    EXPECT_NE(hash_of(*world, area, 1)->hash, hash_of(*world, beside, 1)->hash);
}

TEST(AreaHash, SaysThatItWasStopped) {
    const auto world = sample_world();
    ASSERT_TRUE(world);
    const auto batches =
        StackBatches::cut({.x_first = 0, .z_first = 0, .x_end = 512, .z_end = 512});
    const auto hash = hash_area(*world, *batches, 2, [](std::uint64_t) { return false; });
    ASSERT_TRUE(hash);
    EXPECT_FALSE(hash->whole);
}

TEST(Preseed, StoresWhatTheGeneratorMakes) {
    const auto world = sample_world();
    ASSERT_TRUE(world);
    MemoryStore store(store_identity_of(*world));
    const auto batches = StackBatches::cut(kArea);
    const auto outcome = preseed_area(*world, store, *batches, 2);
    ASSERT_TRUE(outcome) << outcome.error().message;
    EXPECT_TRUE(outcome->whole);
    EXPECT_EQ(outcome->stacks_generated, 99U);
    EXPECT_EQ(outcome->stacks_present, 0U);
    StackGenerator generator(*world);
    Stack stack;
    Bytes bytes;
    for (std::int32_t x = -5; x < 6; ++x) {
        const StackPos position{.lod = 0, .x = x, .z = 4};
        ASSERT_TRUE(generator.generate(stack, position));
        encode_stack(bytes, stack);
        const auto stored = store.get(stack_record_key(position));
        ASSERT_TRUE(stored && *stored) << x;
        EXPECT_EQ(**stored, bytes) << x;
    }
}

TEST(Preseed, MakesOnlyWhatIsMissing) {
    const auto world = sample_world();
    ASSERT_TRUE(world);
    MemoryStore store(store_identity_of(*world));
    const auto west = StackBatches::cut({.x_first = -5, .z_first = -4, .x_end = 0, .z_end = 5});
    ASSERT_TRUE(preseed_area(*world, store, *west, 2));
    const auto whole = StackBatches::cut(kArea);
    const auto resumed = preseed_area(*world, store, *whole, 2);
    ASSERT_TRUE(resumed);
    EXPECT_EQ(resumed->stacks_present, 45U);
    EXPECT_EQ(resumed->stacks_generated, 54U);
    const auto again = preseed_area(*world, store, *whole, 1);
    ASSERT_TRUE(again);
    EXPECT_EQ(again->stacks_present, 99U);
    EXPECT_EQ(again->stacks_generated, 0U);
    EXPECT_TRUE(again->whole);
}

TEST(Preseed, GoesOnWhereItWasStopped) {
    const auto world = sample_world();
    ASSERT_TRUE(world);
    MemoryStore store(store_identity_of(*world));
    const auto batches = StackBatches::cut({.x_first = 0, .z_first = 0, .x_end = 40, .z_end = 40});
    const auto stopped =
        preseed_area(*world, store, *batches, 2, [](std::uint64_t done) { return done == 0; });
    ASSERT_TRUE(stopped);
    EXPECT_EQ(stopped->stacks_generated, store.stats().puts);
    const auto resumed = preseed_area(*world, store, *batches, 2);
    ASSERT_TRUE(resumed);
    EXPECT_TRUE(resumed->whole);
    EXPECT_EQ(resumed->stacks_present, stopped->stacks_generated);
    EXPECT_EQ(resumed->stacks_present + resumed->stacks_generated, 1600U);
}

TEST(Preseed, EndsWhenTheStoreRefuses) {
    class FullStore final : public ChunkStore {
      public:
        Result<std::optional<Bytes>> get(const RecordKey&) override { return std::nullopt; }

        Result<std::vector<std::optional<Bytes>>> get_many(
            std::span<const RecordKey> keys) override {
            return std::vector<std::optional<Bytes>>(keys.size());
        }

        Result<void> put(std::span<const RecordToPut>) override {
            return fail(ErrorCode::io_error, "no space left");
        }

        Result<void> erase(const RecordKey&) override { return {}; }

        Result<void> flush() override { return {}; }

        StoreStats stats() const override { return {}; }
    };

    const auto world = sample_world();
    ASSERT_TRUE(world);
    FullStore store;
    const auto outcome = preseed_area(*world, store, *StackBatches::cut(kArea), 2);
    ASSERT_FALSE(outcome);
    EXPECT_EQ(outcome.error().message, "no space left");
}

}  // namespace
}  // namespace terrane
