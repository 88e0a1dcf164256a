// The promise: one hash for an area on every machine, compiler, optimisation level and kernel set.
//
// The hashes stand here as constants, and every preset (-O0, -O3, sanitizers, clang) runs this
// test.
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/kernels/kernel_choice.h"
#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <string>

namespace terrane {
namespace {

/// Limits with their compositions, in columns' order, independent of any codec.
Hash128 hash_of(const Stack& stack) {
    Bytes bytes;
    ByteWriter out(bytes);
    for (const Limit& limit : stack.columns.limits) {
        out.fixed(limit.y256);
        out.fixed(limit.flow.x);
        out.fixed(limit.flow.y);
        out.fixed(limit.flow.z);
        for (const Share& share : stack.palette[limit.palette_id].composition.shares()) {
            out.fixed(share.material);
            out.f64(share.concentration);
        }
    }
    return hash128(bytes);
}

struct GoldenArea {
    std::string world;
    std::int32_t lod;
    std::string hash;
};

class SameBytes : public testing::TestWithParam<GoldenArea> {};

TEST_P(SameBytes, OnEveryKernelSetAndInEveryBuild) {
    const GoldenArea& area = GetParam();
    const auto world = load_test_world(area.world);
    for (const KernelSet& set : available_kernel_sets()) {
        StackGenerator generator(*world, *set.kernels);
        Hash128 sum;
        Stack stack;
        for (std::int32_t z = -4; z < 4; ++z) {
            for (std::int32_t x = -4; x < 4; ++x) {
                ASSERT_TRUE(
                    generator.generate(stack, {.lod = area.lod, .x = x * 100003, .z = z * 7919}));
                sum = sum_of(sum, hash_of(stack));
            }
        }
        EXPECT_EQ(to_hex(sum), area.hash) << set.name;
    }
}

INSTANTIATE_TEST_SUITE_P(
    Areas, SameBytes,
    testing::Values(GoldenArea{"dense-seed43", 0, "b55abb12f66f25219ebad2c54c26469a"},
                    GoldenArea{"edge-dense", 0, "2d3ecbf2ce374947d675b925fd9cc51e"},
                    GoldenArea{"edge-pinch", 0, "097c14ef8b3adf48a62816182b44dc08"},
                    GoldenArea{"edge-deep", 4, "b50f3aa1b400e398d673b2f5ee132e2e"}),
    [](const auto& area) { return "Area" + std::to_string(area.index); });

}  // namespace
}  // namespace terrane
