#include "generator/baseline/row_perlin.h"
#include "server/cli/program.h"
#include "server/report/chart.h"
#include "server/report/complexity.h"
#include "server/report/figures.h"
#include "server/report/metrics.h"
#include "server/report/numbers.h"
#include "server/report/page.h"
#include "server/report/shipped_world.h"
#include "server/report/speed.h"
#include "server/report/write_report.h"
#include "tests/support/test_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

namespace terrane {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string read_file(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

std::size_t count_of(const std::string& text, const std::string& part) {
    std::size_t count = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
        ++count;
    }
    return count;
}

/// Small enough for a debug build.
ReportOptions tiny() {
    return {.terrains = 2,
            .repeats = 2,
            .seeds = 2,
            .region_columns = 64,
            .picture_width = 16,
            .picture_height = 9,
            .threads = 2};
}

TEST(ShippedWorld, TextsAreThoseOfTheFiles) {
    EXPECT_GE(shipped_worlds().size(), 11U);
    for (const ShippedWorld& world : shipped_worlds()) {
        EXPECT_EQ(world.text, read_file(std::filesystem::path(TERRANE_SOURCE_DIR) /
                                        "generator/worlds" / (std::string(world.name) + ".toml")));
        EXPECT_TRUE(World::build(shipped_definition(world.name))) << world.name;
    }
}

TEST(Numbers, SummariesAndCorrelationsAreTheTextbooks) {
    const Summary summary = summarize({4, 1, 2, 5});
    EXPECT_DOUBLE_EQ(summary.mean, 3);
    EXPECT_DOUBLE_EQ(summary.median, 3);
    EXPECT_NEAR(summary.deviation, std::sqrt(10.0 / 3), 1e-12);
    const std::vector<double> a = {1, 2, 3, 4};
    const std::vector<double> down = {8, 6, 4, 2};
    EXPECT_NEAR(correlation(a, down), -1, 1e-12);
    EXPECT_EQ(correlation(a, std::vector<double>(4, 7.0)), 0);
    const std::vector<double> squares = {3, 12, 27, 48};
    EXPECT_NEAR(growth_exponent(a, squares), 2, 1e-9);
    EXPECT_EQ(three_digits(0.012345), "0.0123");
    EXPECT_EQ(three_digits(84376.42), "84376");
}

TEST(RowPerlin, IsZeroOnItsLatticeContinuousAndTheSameInAnyBox) {
    RowPerlin noise(3, 8);
    const VoxelBox box{.x0 = -20, .y0 = 0, .z0 = 5, .width = 40, .height = 24, .length = 16};
    std::vector<float> values(40 * 24 * 16);
    noise.fill(values.data(), box);
    double square = 0;
    for (std::int32_t z = 0; z < box.length; ++z) {
        for (std::int32_t y = 0; y < box.height; ++y) {
            for (std::int32_t x = 0; x < box.width; ++x) {
                const auto i = static_cast<std::size_t>((z * box.height + y) * box.width + x);
                square += static_cast<double>(values[i] * values[i]);
                ASSERT_LE(std::abs(values[i]), 1.01F);
                if ((x - 20) % 8 == 0 && y % 8 == 0 && (z + 5) % 8 == 0) {
                    ASSERT_NEAR(values[i], 0, 1e-6) << x << ' ' << y << ' ' << z;
                }
                if (x > 0) {
                    ASSERT_LT(std::abs(values[i] - values[i - 1]), 0.5F);
                }
            }
        }
    }
    EXPECT_GT(square / static_cast<double>(values.size()), 0.02);
    float one = 0;
    noise.fill(&one, {.x0 = -3, .y0 = 7, .z0 = 9, .width = 1, .height = 1, .length = 1});
    EXPECT_NEAR(one, values[(4 * 24 + 7) * 40 + 17], 1e-6);
}

TEST(Chart, EveryPointIsInsideAndNothingIsNotANumber) {
    const std::string svg = draw_chart(
        LineChart{.title = "a < b",
                  .x_label = "x",
                  .y_label = "y",
                  .series = {{.name = "one", .points = {{1, 0.01}, {10, 5}, {100, 2000}}},
                             {.name = "two", .points = {{1, 3}, {50, 0}}}},
                  .log_x = true,
                  .log_y = true});
    EXPECT_THAT(svg, HasSubstr("a &lt; b"));
    // A logarithmic axis has no place for 0.
    EXPECT_EQ(count_of(svg, "<circle"), 4U);
    EXPECT_THAT(svg, Not(HasSubstr("nan")));
    EXPECT_THAT(svg, Not(HasSubstr("inf")));
    const std::regex center("cx=\"([-0-9.]+)\" cy=\"([-0-9.]+)\"");
    for (std::sregex_iterator at(svg.begin(), svg.end(), center), end; at != end; ++at) {
        EXPECT_GT(std::stod((*at)[1]), 0);
        EXPECT_LT(std::stod((*at)[1]), kChartWidth);
        EXPECT_GT(std::stod((*at)[2]), 0);
        EXPECT_LT(std::stod((*at)[2]), kChartHeight);
    }
}

TEST(Chart, BarsOfEqualOrNoHeightAreDrawn) {
    const BarChart flat{.title = "t",
                        .y_label = "y",
                        .groups = {"a", "b"},
                        .series = {{.name = "", .values = {0, 0}, .deviations = {}}}};
    EXPECT_THAT(draw_chart(flat), Not(HasSubstr("nan")));
    EXPECT_EQ(count_of(draw_chart(flat), "<rect"), 2U);
}

TEST(Page, CsvQuotesWhatNeedsIt) {
    Page page;
    page.table({.name = "t", .title = "T", .head = {"", "a, b"}, .rows = {{"say \"x\"", "1"}}});
    EXPECT_EQ(page.csv(), "table,row,column,value\nt,\"say \"\"x\"\"\",\"a, b\",1\n");
}

TEST(Report, SpeedTableHasWhatThePaperCounts) {
    const SpeedTable table = measure_speed(tiny()).value();
    ASSERT_EQ(table.configurations.size(), 8U);
    EXPECT_GT(table.perlin.median, table.tuned_perlin.median);
    for (const ConfigurationSpeed& here : table.configurations) {
        EXPECT_GT(here.online.median, 0) << here.name;
        EXPECT_GE(here.layers.mean, 1) << here.name;
        EXPECT_GT(here.limits_chunked.mean, here.limits_whole.mean) << here.name;
        EXPECT_LT(here.limits_chunked.mean, kPaperVoxels) << here.name;
        EXPECT_GT(here.bytes_whole.mean, here.bytes_no_flow.mean) << here.name;
        EXPECT_EQ(here.elements.mean == 0, here.name.ends_with('0')) << here.name;
    }
}

TEST(Report, IsOneWholePageWithChartsTablesAndPictures) {
    const Page page = make_report(tiny(), [](const std::string&) {}).value();
    const std::string html = page.html();
    EXPECT_EQ(page.pictures().size(), 13U);
    EXPECT_EQ(count_of(html, "data:image/png;base64,"), 13U);
    EXPECT_GE(count_of(html, "<svg"), 28U);
    EXPECT_EQ(count_of(html, "<svg"), count_of(html, "</svg>"));
    // Nothing from outside. A colon cannot come from the pictures' base64.
    EXPECT_EQ(count_of(html, "http:") + count_of(html, "https:") + count_of(html, "url("), 0U);
    // Each chart shows something.
    for (std::size_t at = html.find("<svg"); at != std::string::npos;
         at = html.find("<svg", at + 1)) {
        const std::string svg = html.substr(at, html.find("</svg>", at) - at);
        EXPECT_GT(count_of(svg, "<circle") + count_of(svg, "<rect"), 2U) << svg.substr(0, 400);
        EXPECT_EQ(count_of(svg, "nan") + count_of(svg, "inf"), 0U) << svg.substr(0, 400);
    }
    EXPECT_THAT(html, HasSubstr("Beyond the paper"));
    EXPECT_THAT(page.csv(), HasSubstr("landscape-water,canyon,of them uphill,0"));
    // Four fields a line, and the paper's own numbers among them.
    EXPECT_THAT(page.csv(), HasSubstr("table-3,A0,\"offline, paper\",319.1 (41.9)"));
    std::istringstream lines(page.csv());
    std::size_t count = 0;
    for (std::string line; std::getline(lines, line); ++count) {
        const std::string plain = std::regex_replace(line, std::regex("\"[^\"]*\""), "q");
        EXPECT_EQ(count_of(plain, ","), 3U) << line;
    }
    EXPECT_GT(count, 400U);
}

TEST(Report, WithoutAFolderItIsWrongUse) {
    std::vector<std::string> arguments = {"terrane", "report"};
    std::vector<char*> pointers = {arguments[0].data(), arguments[1].data(), nullptr};
    EXPECT_EQ(run_program(2, pointers.data()), kExitWrongUse);
}

}  // namespace
}  // namespace terrane
