#include "server/report/complexity.h"

#include "generator/baseline/row_perlin.h"
#include "generator/terrain/generate_stack.h"
#include "generator/world/world_definition.h"
#include "protocol/base/result.h"
#include "server/report/baselines.h"
#include "server/report/chart.h"
#include "server/report/numbers.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/shipped_world.h"
#include "server/report/stopwatch.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace terrane {
namespace {

/// One size of terrain to measure.
struct Point {
    double x = 0;  ///< where on the chart
    std::int32_t side = 50;
    std::int32_t height = 50;  ///< voxels the voxel methods have to fill
    double depth = 40;
    double layer_thickness = 17.5;
};

struct Curve {
    std::vector<double> x;
    std::vector<double> terrain_ms;
    std::vector<double> tuned_ms;
    std::vector<double> perlin_ms;
    std::vector<double> layers;
};

/// Without veins and caves, whose number is drawn; a seed whose stack has about the mean number of
/// layers would be a choice, so each repetition has its own.
Result<void> measure(Curve& curve, const Point& point, std::int32_t repeats) {
    WorldDefinition definition = shipped_definition("paper-B0");
    definition.terrain.depth = point.depth;
    definition.terrain.layer_thickness = point.layer_thickness;
    VoxelBaseline voxels;
    RowBaseline rows;
    std::vector<double> terrain_ms;
    std::vector<double> tuned_ms;
    std::vector<double> perlin_ms;
    std::vector<double> layers;
    ColumnSet set;
    for (std::int32_t i = 0; i < repeats; ++i) {
        const auto world = build_with_seed(definition, static_cast<std::uint64_t>(i) + 1);
        if (!world) {
            return tl::unexpected(world.error());
        }
        layers.push_back(static_cast<double>(world->stack.layers.size()));
        StackGenerator generator(*world);
        // The first makes room, the second is measured.
        for (std::int64_t plot = 0; plot < 2; ++plot) {
            const Stopwatch terrain;
            if (auto made = generator.generate(set, {.x0 = (plot + 1) * point.side,
                                                     .z0 = 0,
                                                     .width = point.side,
                                                     .length = point.side});
                !made) {
                return made;
            }
            if (plot == 1) {
                terrain_ms.push_back(terrain.milliseconds());
            }
        }
        const VoxelBox box{.x0 = i,
                           .y0 = 0,
                           .z0 = 0,
                           .width = point.side,
                           .height = point.height,
                           .length = point.side};
        if (i == 0) {
            rows.generate(box);
        }
        const Stopwatch tuned;
        rows.generate(box);
        tuned_ms.push_back(tuned.milliseconds());
        if (i < 3) {
            const Stopwatch perlin;
            voxels.generate(box);
            perlin_ms.push_back(perlin.milliseconds());
        }
    }
    curve.x.push_back(point.x);
    curve.terrain_ms.push_back(summarize(terrain_ms).median);
    curve.tuned_ms.push_back(summarize(tuned_ms).median);
    curve.perlin_ms.push_back(summarize(perlin_ms).median);
    curve.layers.push_back(summarize(layers).mean);
    return {};
}

LineSeries series(const std::string& name, const std::vector<double>& x,
                  const std::vector<double>& y) {
    LineSeries out{.name = name, .points = {}};
    for (std::size_t i = 0; i < x.size(); ++i) {
        out.points.push_back({x[i], y[i]});
    }
    return out;
}

struct Sweep {
    std::string name;
    std::string title;
    std::string x_label;
    std::vector<Point> points;
    bool by_layers = false;  ///< the chart's x is the number of layers that came out
};

std::vector<Sweep> sweeps() {
    Sweep cube{.name = "time-by-cube",
               .title = "Terrains of n × n × n voxels",
               .x_label = "n, voxels",
               .points = {}};
    Sweep side{.name = "time-by-side",
               .title = "Side alone: depth 40, height 50",
               .x_label = "side n, columns",
               .points = {}};
    Sweep depth{.name = "time-by-depth",
                .title = "Depth alone: 50 × 50 columns, as many layers",
                .x_label = "height, voxels",
                .points = {}};
    Sweep layers{.name = "time-by-layers",
                 .title = "Layers alone: 50 × 50 columns, depth 80",
                 .x_label = "layers m (mean)",
                 .points = {},
                 .by_layers = true};
    for (const std::int32_t n : {16, 24, 36, 54, 80, 120}) {
        cube.points.push_back({.x = static_cast<double>(n),
                               .side = n,
                               .height = n,
                               .depth = 0.8 * n,
                               .layer_thickness = 17.5});
        side.points.push_back({.x = static_cast<double>(n), .side = n});
    }
    for (const std::int32_t height : {25, 50, 100, 200}) {
        depth.points.push_back({.x = static_cast<double>(height),
                                .side = 50,
                                .height = height,
                                .depth = 0.8 * height,
                                .layer_thickness = 0.35 * height});
    }
    for (const double thickness : {70.0, 35.0, 17.5, 9.0, 5.0}) {
        layers.points.push_back(
            {.x = 0, .side = 50, .height = 100, .depth = 80, .layer_thickness = thickness});
    }
    return {cube, side, depth, layers};
}

}  // namespace

Result<void> write_complexity(Page& page, const ReportOptions& options) {
    page.heading("Complexity: n² · m");
    page.paragraph(
        "The paper gives n² · m for a terrain of n × n × n voxels with m layers, veins and caves, "
        "and n³ in the end, as m grows with the height. That is for the method; what matters is "
        "that nothing is done per voxel. Worlds like B0, medians, all axes logarithmic: on such "
        "axes a power is a straight line and its exponent the slope, which the table gives.");
    ReportTable table{.name = "growth",
                      .title = "Measured exponents (time grows as x to this power)",
                      .head = {"", "terrain", "PN, tuned", "PN"},
                      .rows = {}};
    page.begin_row();
    for (const Sweep& sweep : sweeps()) {
        Curve curve;
        for (const Point& point : sweep.points) {
            if (auto done = measure(curve, point, options.repeats); !done) {
                return done;
            }
        }
        const std::vector<double>& x = sweep.by_layers ? curve.layers : curve.x;
        page.chart(sweep.name, LineChart{.title = sweep.title,
                                         .x_label = sweep.x_label,
                                         .y_label = "milliseconds",
                                         .series = {series("terrain", x, curve.terrain_ms),
                                                    series("PN, tuned", x, curve.tuned_ms),
                                                    series("PN", x, curve.perlin_ms)},
                                         .log_x = true,
                                         .log_y = true});
        table.rows.push_back({sweep.title, fixed(growth_exponent(x, curve.terrain_ms), 2),
                              fixed(growth_exponent(x, curve.tuned_ms), 2),
                              fixed(growth_exponent(x, curve.perlin_ms), 2)});
    }
    page.end_row();
    page.table(table);
    page.paragraph(
        "Exponents below the ideal come from a fixed cost per terrain (noise lattices, the apron "
        "of one column around it), which weighs on small ones.");
    return {};
}

}  // namespace terrane
