#include "generator/world/world_definition.h"
#include "protocol/base/result.h"
#include "server/report/chart.h"
#include "server/report/metrics.h"
#include "server/report/numbers.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/shipped_world.h"
#include "server/report/survey.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace terrane {
namespace {

/// One parameter, the values it is given, and what is expected to follow it.
struct ControlSweep {
    std::string parameter;
    std::string effect;
    std::function<void(TerrainParameters&, double)> set;
    std::vector<double> values;
    std::function<double(const Survey&)> measure;
};

double surface_spread(const Survey& survey) {
    return summarize(survey.surface).deviation;
}

/// Mean absolute difference of neighbouring columns' heights.
double mean_slope(const Survey& survey) {
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t i = 1; i < survey.surface.size(); ++i) {
        if (i % kSurveySide != 0) {
            sum += std::abs(survey.surface[i] - survey.surface[i - 1]);
            ++count;
        }
    }
    return sum / static_cast<double>(count);
}

/// Mean absolute second difference: what bends from column to column.
double mean_bend(const Survey& survey) {
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t i = 1; i + 1 < survey.surface.size(); ++i) {
        if (i % kSurveySide != 0 && (i + 1) % kSurveySide != 0) {
            sum += std::abs(survey.surface[i - 1] - 2 * survey.surface[i] + survey.surface[i + 1]);
            ++count;
        }
    }
    return sum / static_cast<double>(count);
}

double layer_likeness(const Survey& survey) {
    double sum = 0;
    double pairs = 0;
    for (std::size_t k = 1; k < survey.layer_tops.size(); ++k) {
        sum += correlation(survey.layer_tops[k - 1], survey.layer_tops[k]);
        pairs += 1;
    }
    return pairs > 0 ? sum / pairs : 0;
}

std::vector<ControlSweep> layer_sweeps() {
    return {{.parameter = "depth",
             .effect = "mean height of the ground",
             .set = [](TerrainParameters& t, double v) { t.depth = v; },
             .values = {20, 40, 60, 80, 100},
             .measure = [](const Survey& s) { return summarize(s.surface).mean; }},
            {.parameter = "scale",
             .effect = "mean slope, voxels a column",
             .set = [](TerrainParameters& t, double v) { t.scale = v; },
             .values = {10, 20, 40, 80, 160},
             .measure = mean_slope},
            {.parameter = "octaves",
             .effect = "mean bend, voxels",
             .set = [](TerrainParameters& t, double v) { t.octaves = static_cast<int>(v); },
             .values = {1, 2, 3, 4, 5},
             .measure = mean_bend},
            {.parameter = "layer_thickness",
             .effect = "layers",
             .set = [](TerrainParameters& t, double v) { t.layer_thickness = v; },
             .values = {5, 10, 20, 40, 80},
             .measure = [](const Survey& s) { return s.layer_count; }},
            {.parameter = "layer_similarity",
             .effect = "correlation of a layer with the next",
             .set = [](TerrainParameters& t, double v) { t.layer_similarity = v; },
             .values = {0, 0.5, 1, 1.5, 2},
             .measure = layer_likeness},
            {.parameter = "roughness",
             .effect = "standard deviation of the ground",
             .set = [](TerrainParameters& t, double v) { t.roughness = v; },
             .values = {2, 10, 20, 30, 40},
             .measure = surface_spread}};
}

std::vector<ControlSweep> element_sweeps() {
    return {{.parameter = "vein_area",
             .effect = "share of columns with a vein",
             .set = [](TerrainParameters& t, double v) { t.vein_area = v; },
             .values = {8, 16, 24, 36, 48},
             .measure = [](const Survey& s) { return s.vein_share; }},
            {.parameter = "cave_area",
             .effect = "share of columns with a cave",
             .set = [](TerrainParameters& t, double v) { t.cave_area = v; },
             .values = {8, 16, 24, 36, 48},
             .measure = [](const Survey& s) { return s.cave_share; }},
            {.parameter = "vein_thickness",
             .effect = "mean thickness of veins, voxels",
             .set = [](TerrainParameters& t, double v) { t.vein_thickness = v; },
             .values = {2, 5, 10, 15, 20},
             .measure = [](const Survey& s) { return s.vein_thickness; }},
            {.parameter = "cave_thickness",
             .effect = "mean height of caves, voxels",
             .set = [](TerrainParameters& t, double v) { t.cave_thickness = v; },
             .values = {2, 5, 10, 15, 20},
             .measure = [](const Survey& s) { return s.cave_thickness; }},
            {.parameter = "vein_density",
             .effect = "veins a plot",
             .set = [](TerrainParameters& t, double v) { t.vein_density = v; },
             .values = {0, 0.5, 1, 2, 4},
             .measure = [](const Survey& s) { return s.vein_count; }},
            {.parameter = "cave_density",
             .effect = "caves a plot",
             .set = [](TerrainParameters& t, double v) { t.cave_density = v; },
             .values = {0, 0.5, 1, 2, 4},
             .measure = [](const Survey& s) { return s.cave_count; }}};
}

Result<double> mean_effect(const ControlSweep& sweep, double value, std::int32_t seeds) {
    WorldDefinition definition = shipped_definition("paper-B3");
    definition.terrain.vein_density = 2;  // enough of both for a mean to mean something
    definition.terrain.cave_density = 1;
    sweep.set(definition.terrain, value);
    std::vector<double> effects;
    for (std::int32_t seed = 1; seed <= seeds; ++seed) {
        const auto world = build_with_seed(definition, static_cast<std::uint64_t>(seed));
        if (!world) {
            return tl::unexpected(world.error());
        }
        const auto surveyed = survey(*world);
        if (!surveyed) {
            return tl::unexpected(surveyed.error());
        }
        effects.push_back(sweep.measure(*surveyed));
    }
    return summarize(effects).mean;
}

}  // namespace

Result<void> write_control(Page& page, const ReportOptions& options) {
    page.begin_row();
    std::vector<ControlSweep> all = layer_sweeps();
    for (ControlSweep& sweep : element_sweeps()) {
        all.push_back(std::move(sweep));
    }
    for (const ControlSweep& sweep : all) {
        LineChart chart{.title = sweep.parameter,
                        .x_label = sweep.parameter,
                        .y_label = sweep.effect,
                        .series = {{}},
                        .width = 300,
                        .height = 220};
        for (const double value : sweep.values) {
            const auto effect = mean_effect(sweep, value, options.seeds);
            if (!effect) {
                return tl::unexpected(effect.error());
            }
            chart.series[0].points.push_back({value, *effect});
        }
        page.chart("control-" + sweep.parameter, chart);
    }
    page.end_row();
    return {};
}

}  // namespace terrane
