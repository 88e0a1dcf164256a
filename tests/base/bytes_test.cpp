#include "protocol/base/bytes.h"

#include <gtest/gtest.h>

#include <limits>

namespace terrane {
namespace {

TEST(Bytes, VarintsComeBack) {
    for (const std::uint64_t value : {std::uint64_t{0}, std::uint64_t{127}, std::uint64_t{128},
                                      std::uint64_t{1} << 32U, ~std::uint64_t{0}}) {
        Bytes bytes;
        ByteWriter(bytes).varint(value);
        ByteReader reader(bytes);
        EXPECT_EQ(reader.varint(), value);
        EXPECT_EQ(reader.remaining(), 0U);
        for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
            ByteReader cut_short(std::span<const std::byte>(bytes).first(cut));
            EXPECT_EQ(cut_short.varint(), std::nullopt) << value << " cut at " << cut;
        }
    }
}

TEST(Bytes, VarintsAbove64BitsAreRefused) {
    const Bytes eleven(11, std::byte{0xff});
    EXPECT_EQ(ByteReader(eleven).varint(), std::nullopt);
    Bytes ten(9, std::byte{0x80});
    ten.push_back(std::byte{2});
    EXPECT_EQ(ByteReader(ten).varint(), std::nullopt);
}

TEST(Bytes, ZigzagCoversTheExtremes) {
    for (const std::int64_t value :
         {std::int64_t{0}, std::int64_t{-1}, std::int64_t{1},
          std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max()}) {
        EXPECT_EQ(unzigzag(zigzag(value)), value);
    }
    EXPECT_EQ(zigzag(-1), 1U);
    EXPECT_EQ(zigzag(1), 2U);
}

TEST(Bytes, NothingIsTakenPastTheEnd) {
    const Bytes bytes(3);
    ByteReader reader(bytes);
    EXPECT_FALSE(reader.take(4));
    EXPECT_EQ(reader.remaining(), 0U);
}

}  // namespace
}  // namespace terrane
