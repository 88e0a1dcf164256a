#include "generator/terrain/layer_stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/result.h"
#include "server/report/chart.h"
#include "server/report/metrics.h"
#include "server/report/numbers.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/shipped_world.h"
#include "server/report/survey.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr std::int32_t kHeight = 50;

/// Share of voxels whose main material differs, of those that are solid in at least one.
double distance(const std::vector<std::uint16_t>& a, const std::vector<std::uint16_t>& b) {
    double different = 0;
    double considered = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        if (a[i] != 0 || b[i] != 0) {
            considered += 1;
            different += a[i] != b[i] ? 1 : 0;
        }
    }
    return considered > 0 ? different / considered : 0;
}

std::vector<double> distances(const std::vector<std::vector<std::uint16_t>>& terrains) {
    std::vector<double> out;
    for (std::size_t i = 0; i < terrains.size(); ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            out.push_back(distance(terrains[i], terrains[j]));
        }
    }
    return out;
}

BarSeries histogram(const std::string& name, const std::vector<double>& values, std::size_t bins) {
    BarSeries series{.name = name, .values = std::vector<double>(bins), .deviations = {}};
    for (const double value : values) {
        const auto bin = static_cast<std::size_t>(value * static_cast<double>(bins));
        series.values[std::min(bin, bins - 1)] += 100.0 / static_cast<double>(values.size());
    }
    return series;
}

}  // namespace

Result<void> write_innovation(Page& page, const ReportOptions& options) {
    const WorldDefinition definition = shipped_definition("paper-B3");
    std::vector<std::vector<std::uint16_t>> of_seeds;
    std::vector<std::vector<std::uint16_t>> of_plots;
    std::set<std::string> stacks;
    const std::int32_t count = std::max(12, options.seeds);
    for (std::int32_t i = 0; i < count; ++i) {
        const auto world = build_with_seed(definition, static_cast<std::uint64_t>(i) + 1);
        const auto first = build_with_seed(definition, 1);
        if (!world || !first) {
            return tl::unexpected(world ? first.error() : world.error());
        }
        std::string stack;
        for (const Layer& layer : world->stack.layers) {
            for (const Share& share : layer.composition.shares()) {
                stack += std::to_string(share.material) + ' ';
            }
            stack += '/';
        }
        stacks.insert(stack);
        auto seed = main_materials(*world, {.x0 = 0, .z0 = 0, .width = 50, .length = 50}, kHeight);
        auto plot = main_materials(
            *first, {.x0 = 50 * std::int64_t{i}, .z0 = 0, .width = 50, .length = 50}, kHeight);
        if (!seed || !plot) {
            return tl::unexpected(seed ? plot.error() : seed.error());
        }
        of_seeds.push_back(std::move(*seed));
        of_plots.push_back(std::move(*plot));
    }
    const std::vector<double> seeds = distances(of_seeds);
    const std::vector<double> plots = distances(of_plots);
    const BarChart chart{.title = "How different two terrains are (B3, all pairs)",
                         .y_label = "% of pairs",
                         .groups = {"0-10 %", "10-20", "20-30", "30-40", "40-50", "50-60", "60-70",
                                    "70-80", "80-90", "90-100"},
                         .series = {histogram("two seeds", seeds, 10),
                                    histogram("two plots of one world", plots, 10)},
                         .log_y = false,
                         .width = 720};
    page.chart("innovation", chart);
    page.paragraph(
        "Distance: share of voxels, solid in at least one of the two, whose main material differs. "
        "Of " +
        std::to_string(seeds.size()) + " pairs of seeds the closest are " +
        fixed(100 * *std::ranges::min_element(seeds), 1) + " % apart (median " +
        fixed(100 * summarize(seeds).median, 1) +
        " %); plots of one world, which share their "
        "layers, " +
        fixed(100 * summarize(plots).median, 1) + " % in the median. " +
        std::to_string(stacks.size()) + " of " + std::to_string(count) +
        " layer stacks are different; seeds that share one differ in folds, veins and caves. The "
        "same seed gives the same bytes always. What a "
        "number can't show: whether a player is surprised.");
    return {};
}

}  // namespace terrane
