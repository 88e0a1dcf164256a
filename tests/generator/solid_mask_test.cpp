#include "generator/mesh/solid_mask.h"

#include "tests/support/ascii_cut.h"

#include <gtest/gtest.h>

#include <random>

namespace terrane {
namespace {

std::vector<SolidEnd> ends_of(const SolidColumns& columns, std::size_t x) {
    std::vector<SolidEnd> ends;
    for (std::size_t i = 0; i < columns.plane_count; ++i) {
        const SolidEnd end = columns.end(columns.width + x, i);
        if (end.y256 != kEndlessly256) {
            ends.push_back(end);
        }
    }
    EXPECT_EQ(columns.top256[columns.width + x], ends.back().y256);
    EXPECT_EQ(columns.top_id[columns.width + x], ends.back().palette_id);
    return ends;
}

TEST(SolidMask, MergesMaterialsAndParts) {
    const Letters letters("abV.o");
    const Stack stack = stack_of_cut(letters, {
                                                  "......",
                                                  "bbbb..",
                                                  "boVb..",
                                                  "booba.",
                                                  "aoaaaV",
                                                  "aaaaaa",
                                              });
    SolidColumns columns;
    find_solid_columns(columns, stack);
    const auto a = letters.id('a');
    const auto b = letters.id('b');
    const auto vein = letters.id('V');
    using Ends = std::vector<SolidEnd>;
    EXPECT_EQ(ends_of(columns, 0), (Ends{{5 * 256, b}}));
    EXPECT_EQ(ends_of(columns, 1), (Ends{{256, a}, {4 * 256, b}, {5 * 256, b}}));
    EXPECT_EQ(ends_of(columns, 2), (Ends{{2 * 256, a}, {3 * 256, vein}, {5 * 256, b}}));
    EXPECT_EQ(ends_of(columns, 5), (Ends{{2 * 256, vein}}));
    EXPECT_EQ(columns.lowest256, 256);
    EXPECT_EQ(columns.highest256, 5 * 256);
}

TEST(SolidMask, TakesTheTopButNotTheBottomOfAnInterval) {
    const Letters letters("a.o");
    const Stack stack = stack_of_cut(letters, {"aaaaaa", "oooooo", "aaaaaa"});
    SolidColumns columns;
    find_solid_columns(columns, stack);
    SolidMask mask;
    mask.word_y = {-2};
    fill_solid_mask(mask, columns);
    // Solid: all up to 1, and 3; the points at 1 and 3 are tops, the one at 2 is a bottom.
    EXPECT_EQ(mask.row(2, 0)[3], 0b101111U);
}

TEST(SolidMask, AgreesWithTheLimitsAtEveryPointOfTallColumns) {
    const Letters letters("ab.o");
    std::mt19937 random(5);
    for (int round = 0; round < 20; ++round) {
        const Stack stack = stack_of_columns({}, 4, letters.palette(), [&](ColumnPos) {
            std::vector<Limit> column;
            std::int32_t y256 = 0;
            std::uint16_t id = letters.id('a');
            for (int i = 0; i < 12; ++i) {
                column.push_back({.y256 = y256, .palette_id = id, .flow = {}});
                y256 += static_cast<std::int32_t>(random() % 6000);
                column.push_back({.y256 = y256, .palette_id = id, .flow = {}});
                id = letters.id("abo"[random() % 3]);
            }
            column.push_back({.y256 = y256, .palette_id = letters.id('.'), .flow = {}});
            return column;
        });
        SolidColumns columns;
        find_solid_columns(columns, stack);
        SolidMask mask;
        const auto first_y = static_cast<std::int32_t>(random() % 40) - 20;
        mask.word_y = {first_y, first_y + 64, first_y + 192};  // the third of four is left out
        fill_solid_mask(mask, columns);
        EXPECT_TRUE(mask.goes_on(0));
        EXPECT_FALSE(mask.goes_on(1));
        EXPECT_FALSE(mask.goes_on(2));
        for (std::size_t bit = 0; bit < 3 * 64; ++bit) {
            const std::int32_t y = mask.word_y[bit / 64] + static_cast<std::int32_t>(bit % 64);
            const auto limits = stack.columns.column(2, 3);
            bool expected = y * 256 <= limits.front().y256;
            for (std::size_t i = 0; i + 1 < limits.size(); ++i) {
                if (limits[i].y256 < y * 256 && y * 256 <= limits[i + 1].y256) {
                    expected = stack.palette[limits[i].palette_id].is_solid();
                }
            }
            const bool is_solid = (mask.row(4, bit / 64)[3] >> (bit % 64) & 1U) != 0;
            EXPECT_EQ(is_solid, expected) << "y " << y << ", round " << round;
        }
    }
}

}  // namespace
}  // namespace terrane
