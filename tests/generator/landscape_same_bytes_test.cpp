// A landscape's columns are a function of (world, column): not of the region's size, the order, the
// kernel set, the machine. The hashes stand here as constants, for every build.
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/kernels/kernel_choice.h"
#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

namespace terrane {
namespace {

/// One column with what its limits show, and where it is.
Hash128 hash_of(std::span<const Limit> column, const Palette& palette, std::int64_t x,
                std::int64_t z) {
    Bytes bytes;
    ByteWriter out(bytes);
    out.fixed(static_cast<std::uint64_t>(x));
    out.fixed(static_cast<std::uint64_t>(z));
    for (const Limit& limit : column) {
        out.fixed(limit.y256);
        out.fixed(limit.flow.x);
        out.fixed(limit.flow.y);
        out.fixed(limit.flow.z);
        out.fixed(static_cast<std::uint8_t>(palette[limit.palette_id].kind));
        for (const Share& share : palette[limit.palette_id].composition.shares()) {
            out.fixed(share.material);
            out.f64(share.concentration);
        }
    }
    return hash128(bytes);
}

struct Place {
    std::int64_t x = 0;
    std::int64_t z = 0;
};

constexpr std::int64_t kFar = std::int64_t{1} << 35;
constexpr Place kPlaces[] = {{-96, 192},
                             {kFar + 17, -kFar - 333},
                             {-kFar, kFar},
                             {(std::int64_t{1} << 50) + 12345, -(std::int64_t{1} << 51) + 77}};
constexpr std::int32_t kSide = 96;

/// The sum of the hashes of kSide x kSide columns, made in squares of `patch` columns, from the
/// last to the first if `reversed`.
Hash128 hash_area(StackGenerator& generator, const Place& place, std::int32_t patch,
                  bool reversed) {
    Hash128 sum;
    ColumnSet set;
    const std::int32_t patches = kSide / patch;
    for (std::int32_t n = 0; n < patches * patches; ++n) {
        const std::int32_t number = reversed ? patches * patches - 1 - n : n;
        const std::int64_t x0 = place.x + number % patches * patch;
        const std::int64_t z0 = place.z + number / patches * patch;
        EXPECT_TRUE(generator.generate(set, {.x0 = x0, .z0 = z0, .width = patch, .length = patch}));
        for (std::int32_t z = 0; z < patch; ++z) {
            for (std::int32_t x = 0; x < patch; ++x) {
                sum = sum_of(sum, hash_of(set.columns.column(x, z), set.palette, x0 + x, z0 + z));
            }
        }
    }
    return sum;
}

/// The sum of the hashes of all places, on every machine and in every build.
struct GoldenWorld {
    const char* name;
    const char* hash;
};

class LandscapeSameBytes : public testing::TestWithParam<GoldenWorld> {};

TEST_P(LandscapeSameBytes, ForEveryRegionSizeOrderAndKernelSet) {
    const auto world = load_shipped_world(GetParam().name);
    ASSERT_NE(world, nullptr);
    StackGenerator generator(*world);
    Hash128 all;
    for (const Place& place : kPlaces) {
        const Hash128 area = hash_area(generator, place, 96, false);
        all = sum_of(all, area);
        const std::string once = to_hex(area);
        for (const std::int32_t patch : {48, 32, 24, 16, 8}) {
            EXPECT_EQ(to_hex(hash_area(generator, place, patch, false)), once) << patch;
        }
        EXPECT_EQ(to_hex(hash_area(generator, place, 32, true)), once);
        for (const KernelSet& set : available_kernel_sets()) {
            StackGenerator other(*world, *set.kernels);
            EXPECT_EQ(to_hex(hash_area(other, place, 32, false)), once) << set.name;
        }
    }
    EXPECT_EQ(to_hex(all), GetParam().hash);
}

TEST_P(LandscapeSameBytes, WhereStacksMadeApartShareColumns) {
    const auto world = load_shipped_world(GetParam().name);
    ASSERT_NE(world, nullptr);
    const std::int32_t side = world->definition.grid.side;
    StackGenerator generator(*world);
    for (const std::int32_t lod : {0, 2, 5}) {
        Stack left;
        Stack right;
        ASSERT_TRUE(generator.generate(left, {.lod = lod, .x = 3, .z = -7}));
        ASSERT_TRUE(generator.generate(right, {.lod = lod, .x = 4, .z = -7}));
        for (std::int32_t z = -1; z <= side; ++z) {
            for (std::int32_t x = side - 1; x <= side; ++x) {
                const auto a = left.columns.column(x, z);
                const auto b = right.columns.column(x - side, z);
                ASSERT_EQ(a.size(), b.size()) << lod << ": " << x << "," << z;
                for (std::size_t i = 0; i < a.size(); ++i) {  // an apron's columns have no flow
                    ASSERT_EQ(a[i].y256, b[i].y256);
                    ASSERT_EQ(left.palette[a[i].palette_id], right.palette[b[i].palette_id]);
                }
            }
        }
    }
}

TEST(LandscapeSameBytes, WhereTheWholeStackIsFoldedBelowTheWorld) {
    WorldDefinition definition = load_shipped_world("fold")->definition;
    definition.structure.fold = 900;
    auto world = World::build(definition);
    ASSERT_TRUE(world) << world.error().message;
    StackGenerator generator(*world);
    std::size_t covers = 0;
    for (std::int64_t x = 0; x < 12 * kSide; x += kSide) {
        const Place place{x, -x};
        const std::string once = to_hex(hash_area(generator, place, 96, false));
        EXPECT_EQ(to_hex(hash_area(generator, place, 16, true)), once) << x;
        ColumnSet set;
        ASSERT_TRUE(
            generator.generate(set, {.x0 = place.x, .z0 = place.z, .width = 1, .length = 1}));
        covers += set.palette[set.columns.limits.front().palette_id].kind == PaletteKind::vein;
    }
    EXPECT_GT(covers, 0U);  // soil down to the bottom of the world
}

INSTANTIATE_TEST_SUITE_P(Worlds, LandscapeSameBytes,
                         testing::Values(GoldenWorld{"canyon", "ecc63f7e63c7888576f742a5acc725a6"},
                                         GoldenWorld{"karst", "d701496e7b260a4ffbdd211044133330"},
                                         GoldenWorld{"fold", "509ad0ea66bd5cfba93754184050081c"},
                                         GoldenWorld{"range", "6eff65997c22905313e59bbcb9753004"},
                                         GoldenWorld{"alpine", "d7166e85c4f1cc592cd73af1680cd57f"},
                                         GoldenWorld{"coast", "16e6433e921fca23056ff99626ef1c1d"}),
                         [](const auto& world) { return std::string(world.param.name); });

TEST(Landscape, ThatDoesNothingIsVersion1ToTheLastBit) {
    for (const char* name : {"paper-B3", "fantasy"}) {
        const auto plain = load_shipped_world(name);
        WorldDefinition definition = plain->definition;
        definition.format = 2;
        definition.relief.ground = 50;  // means nothing while the relief is off
        definition.structure.fold_length = 77;
        auto made = World::build(definition);
        ASSERT_TRUE(made);
        EXPECT_NE(made->fingerprint, plain->fingerprint);
        StackGenerator one(*plain);
        StackGenerator other(*made);
        Stack a;
        Stack b;
        for (std::int32_t lod : {0, 3}) {
            ASSERT_TRUE(one.generate(a, {.lod = lod, .x = -5, .z = 9}));
            ASSERT_TRUE(other.generate(b, {.lod = lod, .x = -5, .z = 9}));
            EXPECT_EQ(a, b) << name;
        }
    }
}

}  // namespace
}  // namespace terrane
