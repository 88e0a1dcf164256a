#include "protocol/base/hash.h"

#include "protocol/base/bytes.h"

#include <gtest/gtest.h>

namespace terrane {
namespace {

TEST(Hash, IsXxh3With128Bits) {
    // The reference value of XXH3-128 over nothing, from xxHash's own documentation of XXH128.
    EXPECT_EQ(to_hex(hash128({})), "99aa06d3014798d86001c324468d497f");
}

TEST(Hash, HexComesBackAndBadHexIsRefused) {
    const Hash128 hash = hash128(bytes_of("terrane"));
    EXPECT_EQ(hash_from_hex(to_hex(hash)), hash);
    EXPECT_FALSE(hash_from_hex("12"));
    EXPECT_FALSE(hash_from_hex(std::string(31, '0') + "g"));
}

TEST(Hash, SumsCarryAndDoNotDependOnOrder) {
    const Hash128 ones{.high = 0, .low = ~std::uint64_t{0}};
    const Hash128 one{.high = 0, .low = 1};
    EXPECT_EQ(sum_of(ones, one), (Hash128{.high = 1, .low = 0}));
    EXPECT_EQ(sum_of(one, ones), sum_of(ones, one));
}

}  // namespace
}  // namespace terrane
