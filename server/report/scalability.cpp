#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "generator/volume/stack.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/report/chart.h"
#include "server/report/metrics.h"
#include "server/report/numbers.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/shipped_world.h"
#include "server/report/stopwatch.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

namespace terrane {
namespace {

/// The greatest difference, in 1/256 voxel, between the tops of a level's columns and those of
/// level 0 at the same places. Needs a world without elements, which coarse levels leave out.
Result<std::int32_t> worst_difference(const World& world, std::int32_t lod) {
    constexpr std::int32_t kColumns = 24;
    StackGenerator generator(world);
    ColumnSet coarse;
    ColumnSet one;
    const std::int64_t step = std::int64_t{1} << lod;
    if (auto made = generator.generate(
            coarse,
            {.x0 = -7 * step, .z0 = 5 * step, .width = kColumns, .length = kColumns, .lod = lod});
        !made) {
        return tl::unexpected(made.error());
    }
    std::int32_t worst = 0;
    for (std::int32_t i = 0; i < kColumns; ++i) {
        const std::int32_t j = i * 7 % kColumns;
        if (auto made = generator.generate(
                one, {.x0 = (i - 7) * step, .z0 = (j + 5) * step, .width = 1, .length = 1});
            !made) {
            return tl::unexpected(made.error());
        }
        worst = std::max(worst, std::abs(coarse.columns.column(i, j).back().y256 -
                                         one.columns.column(0, 0).back().y256));
    }
    return worst;
}

}  // namespace

Result<void> write_scalability(Page& page, const ReportOptions& options) {
    const auto world = World::build(shipped_definition("basin"));
    WorldDefinition bare_definition = shipped_definition("basin");
    bare_definition.terrain.vein_density = 0;
    bare_definition.terrain.cave_density = 0;
    const auto bare = World::build(std::move(bare_definition));
    if (!world || !bare) {
        return tl::unexpected(world ? bare.error() : world.error());
    }
    std::vector<std::vector<double>> times(kLodMax + 1);
    StackGenerator generator(*world);
    Stack stack;
    for (std::int32_t i = 0; i < 4 * options.repeats; ++i) {
        for (std::int32_t lod = 0; lod <= kLodMax; ++lod) {
            const Stopwatch watch;
            if (auto made = generator.generate(stack, {.lod = lod, .x = i, .z = 3}); !made) {
                return made;
            }
            times[static_cast<std::size_t>(lod)].push_back(watch.milliseconds());
        }
    }
    BarChart chart{.title = "One stack of 32 × 32 columns of the world basin, level by level",
                   .y_label = "milliseconds (median)",
                   .groups = {},
                   .series = {{}},
                   .log_y = false,
                   .width = 720};
    std::int32_t worst = 0;
    for (std::int32_t lod = 0; lod <= kLodMax; ++lod) {
        const auto differs = worst_difference(*bare, lod);
        if (!differs) {
            return tl::unexpected(differs.error());
        }
        worst = std::max(worst, *differs);
        chart.groups.push_back(std::to_string(lod));
        chart.series[0].values.push_back(summarize(times[static_cast<std::size_t>(lod)]).median);
    }
    page.chart("scalability", chart);
    const double side_km = 32.0 * static_cast<double>(std::int64_t{1} << kLodMax) / 1000;
    const auto& medians = chart.series[0].values;
    page.paragraph(
        "A stack of level l covers 2<sup>l</sup> times the side of level 0; at level 17 "
        "that is " +
        fixed(side_km, 0) + " km a side with voxels of a metre, for " +
        fixed(medians.back() / medians.front(), 1) +
        " times the time of level 0, as noise no longer shares its lattice between "
        "neighbouring columns. Elements are left out from level 4 on. Greatest difference between "
        "a level's "
        "heights and those of level 0 at the columns they share, over all 18 levels, "
        "elements off: " +
        std::to_string(worst) +
        "/256 voxel. Besides levels, <code>scale</code> is one parameter of the world "
        "(the paper's reason for its 1), and <code>voxel_size_m</code> another.");
    return {};
}

}  // namespace terrane
