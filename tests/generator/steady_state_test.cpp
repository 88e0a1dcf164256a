// What a worker does over and over costs no memory: nothing is allocated from noise to bytes once
// its buffers have grown, and a long stream of stacks leaves the process as large as it was.
#include "generator/terrain/generate_stack.h"
#include "generator/volume/chunk_codec.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <new>
#include <string>

namespace {

thread_local std::size_t allocations = 0;

void* allocate(std::size_t size) {
    ++allocations;
    if (void* const memory = std::malloc(size == 0 ? 1 : size)) {
        return memory;
    }
    throw std::bad_alloc();
}

}  // namespace

// The whole program's, so that no allocation goes unseen.
void* operator new(std::size_t size) {
    return allocate(size);
}

void* operator new[](std::size_t size) {
    return allocate(size);
}

// std::stable_sort asks with this one and gives back with the plain delete: they must be a pair.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
    ++allocations;
    return std::malloc(size == 0 ? 1 : size);
}

void operator delete(void* memory) noexcept {
    std::free(memory);
}

void operator delete(void* memory, const std::nothrow_t&) noexcept {
    std::free(memory);
}

void operator delete[](void* memory) noexcept {
    std::free(memory);
}

void operator delete(void* memory, std::size_t) noexcept {
    std::free(memory);
}

void operator delete[](void* memory, std::size_t) noexcept {
    std::free(memory);
}

namespace terrane {
namespace {

class SteadyState : public testing::TestWithParam<std::string> {};

TEST_P(SteadyState, NoiseToBytesAllocatesNothing) {
    const auto world = load_test_world(GetParam());
    StackGenerator generator(*world);
    ChunkEncoder encoder;
    Stack stack;
    Bytes bytes;
    const auto make_all = [&] {
        std::size_t size = 0;
        for (std::int32_t i = 0; i < 16; ++i) {
            EXPECT_TRUE(generator.generate(stack, {.lod = 0, .x = i % 4, .z = i / 4}));
            encoder.encode(bytes, stack);
            size += bytes.size();
        }
        return size;
    };
    const std::size_t size = make_all();
    const std::size_t before = allocations;
    EXPECT_EQ(make_all(), size);
    EXPECT_EQ(allocations, before);
}

INSTANTIATE_TEST_SUITE_P(Worlds, SteadyState,
                         testing::Values("paper-B3-seed42", "dense-seed43", "edge-deep"),
                         [](const auto& world) {
                             std::string name(world.param);
                             std::erase(name, '-');
                             return name;
                         });

std::int64_t resident_bytes() {
    std::ifstream statm("/proc/self/statm");
    std::int64_t pages = 0;
    std::int64_t resident = 0;
    statm >> pages >> resident;
    return resident * sysconf(_SC_PAGESIZE);
}

TEST(Stream, AMillionColumnsLeaveMemoryAsItWas) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers keep what was freed";
#endif
    constexpr std::int64_t kColumns = 1'000'000;
    constexpr std::int64_t kGrowthMax = std::int64_t{64} << 20U;
    const auto world = load_test_world("dense-seed43");
    const std::int64_t start = resident_bytes();
    ASSERT_GT(start, 0);
    StackGenerator generator(*world);
    ChunkEncoder encoder;
    Stack stack;
    Bytes bytes;
    std::int64_t columns = 0;
    std::int64_t most = 0;
    for (std::int32_t i = 0; columns < kColumns; ++i) {
        // Rows of a thousand stacks: new plots again and again.
        ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = i % 1000, .z = i / 1000}));
        encoder.encode(bytes, stack);
        columns += std::int64_t{stack.side} * stack.side;
        if (i % 64 == 0) {
            most = std::max(most, resident_bytes() - start);
        }
    }
    EXPECT_LT(std::max(most, resident_bytes() - start), kGrowthMax);
    RecordProperty("growth_kib", static_cast<int>(most / 1024));
}

}  // namespace
}  // namespace terrane
