#include "server/cli/arguments.h"

#include <gtest/gtest.h>

#include <array>
#include <string>

namespace terrane {
namespace {

TEST(Arguments, ColumnsMayBeNegative) {
    EXPECT_EQ(parse_column("-5,3").value(), (ColumnPos{.x = -5, .z = 3}));
    EXPECT_EQ(parse_column("+7,-0").value(), (ColumnPos{.x = 7, .z = 0}));
}

TEST(Arguments, ColumnsEndJustInsideTheLimit) {
    const std::string most = std::to_string(kColumnCoordinateLimit - 1);
    const std::string limit = std::to_string(kColumnCoordinateLimit);
    EXPECT_EQ(parse_column(most + ",-" + most)->z, -(kColumnCoordinateLimit - 1));
    for (const std::string& bad :
         {limit + ",0", "0," + limit, "-" + limit + ",0", std::string("99999999999999999999,0")}) {
        EXPECT_EQ(parse_column(bad).error().code, ErrorCode::out_of_range) << bad;
    }
}

TEST(Arguments, AnythingElseIsRefusedWithTheText) {
    for (const char* bad : {"", ",", "1", "1,", ",1", "1,2,3", "1;2", "a,b", "1, 2", "1.5,2",
                            "+-1,2", "0x10,2", "1,2 ", "--1,2"}) {
        const auto column = parse_column(bad);
        ASSERT_FALSE(column) << bad;
        EXPECT_EQ(column.error().code, ErrorCode::invalid_argument) << bad;
    }
    EXPECT_NE(parse_column("1;2").error().message.find("\"1;2\""), std::string::npos);
}

TEST(Arguments, AsManyIntegersAsAskedFor) {
    std::array<std::int64_t, 3> three{};
    ASSERT_TRUE(parse_integers(three, "1,-2,3", kChunkBounds));
    EXPECT_EQ(three, (std::array<std::int64_t, 3>{1, -2, 3}));
    EXPECT_FALSE(parse_integers(three, "1,2", kChunkBounds));
    EXPECT_FALSE(parse_integers(three, "1,2,3,4", kChunkBounds));
    EXPECT_FALSE(parse_integers(three, "1,2,2147483648", kChunkBounds));
}

TEST(Arguments, NumbersWithTheirBounds) {
    std::array<double, 3> three{};
    ASSERT_TRUE(parse_numbers(three, "1.5,-2,+3e1", -30, 30));
    EXPECT_EQ(three, (std::array<double, 3>{1.5, -2, 30}));
    for (const char* bad : {"1,2", "1,2,3,4", "1,2,31", "1,,3", "1,2,nan", "1,2,3x", ""}) {
        EXPECT_FALSE(parse_numbers(three, bad, -30, 30)) << bad;
    }
}

TEST(Arguments, RectanglesExcludeTheirEnd) {
    EXPECT_EQ(
        parse_stack_rectangle("-2147483648,0,2147483648,1").value(),
        (StackRectangle{.x_first = -2147483648, .z_first = 0, .x_end = 2147483648, .z_end = 1}));
    EXPECT_FALSE(parse_stack_rectangle("0,0,0,1"));
    EXPECT_FALSE(parse_stack_rectangle("0,5,1,4"));
    EXPECT_FALSE(parse_stack_rectangle("0,0,1,2147483649"));
}

}  // namespace
}  // namespace terrane
