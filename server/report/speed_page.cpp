#include "server/report/chart.h"
#include "server/report/numbers.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/speed.h"

#include <array>
#include <cstddef>
#include <string>

namespace terrane {
namespace {

/// A row of the paper's Table 3, in milliseconds.
struct PaperRow {
    const char* name;
    double offline;
    double offline_deviation;
    double online;
    double online_deviation;
    double layers;
    double elements;
};

constexpr std::array<PaperRow, 8> kPaper = {{{"A0", 319.14, 41.94, 310.59, 32.20, 4.65, 0.00},
                                             {"A1", 347.01, 61.66, 329.70, 55.76, 4.72, 1.74},
                                             {"A2", 334.85, 53.49, 312.20, 44.75, 4.81, 1.55},
                                             {"A3", 348.46, 75.01, 342.84, 60.35, 4.68, 1.73},
                                             {"B0", 324.36, 46.85, 309.24, 32.29, 4.75, 0.00},
                                             {"B1", 354.25, 70.23, 315.28, 47.86, 4.88, 1.71},
                                             {"B2", 354.30, 62.27, 316.40, 46.28, 4.79, 1.90},
                                             {"B3", 346.67, 55.55, 314.86, 47.18, 4.73, 1.78}}};
constexpr double kPaperPerlin = 61.25;
constexpr double kPaperPerlinDeviation = 14.46;
constexpr double kPaperLimits = 84376.42;

void write_table_2(Page& page) {
    page.table({.name = "table-2",
                .title = "Table 2. The eight configurations; densities in brackets",
                .head = {"Configuration", "regular", "veins", "caves"},
                .rows = {{"A0", "3", "0", "0"},
                         {"A1", "3", "1 (0.5)", "0"},
                         {"A2", "3", "0", "1 (0.5)"},
                         {"A3", "3", "1 (0.25)", "1 (0.25)"},
                         {"B0", "6", "0", "0"},
                         {"B1", "6", "2 (0.5)", "0"},
                         {"B2", "6", "0", "1 (0.5)"},
                         {"B3", "6", "2 (0.25)", "1 (0.25)"}}});
}

void write_table_3(Page& page, const SpeedTable& table) {
    ReportTable out{.name = "table-3",
                    .title = "Table 3. Times in milliseconds: average (standard deviation)",
                    .head = {"", "offline, paper", "offline, here", "median", "online, paper",
                             "online, here", "median", "online as 125 chunks, here", "median"},
                    .rows = {}};
    ReportTable counts{
        .name = "table-3-counts",
        .title = "Table 3, its last columns: average layers and elements a terrain",
        .head = {"", "layers, paper", "layers, here", "elements, paper", "elements, here"},
        .rows = {}};
    const auto pair = [](double mean, double deviation, int digits) {
        return fixed(mean, digits) + " (" + fixed(deviation, digits) + ")";
    };
    const auto both = [&](const Summary& summary) {
        return pair(summary.mean, summary.deviation, 3);
    };
    for (std::size_t i = 0; i < kPaper.size(); ++i) {
        const PaperRow& paper = kPaper[i];
        const ConfigurationSpeed& here = table.configurations[i];
        out.rows.push_back({paper.name, pair(paper.offline, paper.offline_deviation, 1),
                            both(here.offline), fixed(here.offline.median, 3),
                            pair(paper.online, paper.online_deviation, 1), both(here.online),
                            fixed(here.online.median, 3), both(here.chunked),
                            fixed(here.chunked.median, 3)});
        counts.rows.push_back({paper.name, fixed(paper.layers, 2), fixed(here.layers.mean, 2),
                               fixed(paper.elements, 2), fixed(here.elements.mean, 2)});
    }
    const std::string paper_perlin = pair(kPaperPerlin, kPaperPerlinDeviation, 1);
    const auto baseline = [&](const char* name, const std::string& paper, const Summary& here) {
        out.rows.push_back({name, paper, both(here), fixed(here.median, 3), paper, both(here),
                            fixed(here.median, 3), "", ""});
    };
    baseline("PN", paper_perlin, table.perlin);
    baseline("PN, tuned", "", table.tuned_perlin);
    page.table(out);
    page.table(counts);
}

void write_ratios(Page& page, const SpeedTable& table) {
    ReportTable out{.name = "ratios",
                    .title =
                        "Time against per-voxel Perlin noise (PN) of the same run; below 1 is "
                        "faster. Here of medians, in the paper of averages",
                    .head = {"", "offline, paper", "offline, here", "online, paper", "online, here",
                             "online against tuned PN, here", "as 125 chunks against PN, here",
                             "as chunks against tuned PN, here"},
                    .rows = {}};
    for (std::size_t i = 0; i < kPaper.size(); ++i) {
        const PaperRow& paper = kPaper[i];
        const ConfigurationSpeed& here = table.configurations[i];
        out.rows.push_back({paper.name, fixed(paper.offline / kPaperPerlin, 2),
                            fixed(here.offline.median / table.perlin.median, 4),
                            fixed(paper.online / kPaperPerlin, 2),
                            fixed(here.online.median / table.perlin.median, 4),
                            fixed(here.online.median / table.tuned_perlin.median, 2),
                            fixed(here.chunked.median / table.perlin.median, 4),
                            fixed(here.chunked.median / table.tuned_perlin.median, 2)});
    }
    page.table(out);
}

/// Figures 4 and 5: the paper's bars and ours, each on its own scale.
void write_figure(Page& page, const SpeedTable& table, bool online) {
    const std::string number = online ? "5" : "4";
    const std::string setup = online ? "online" : "offline";
    BarChart paper{.title = "Figure " + number + ", paper: " + setup,
                   .y_label = "milliseconds, i7-950 (2013)",
                   .groups = {},
                   .series = {{}}};
    BarChart here{.title = "Figure " + number + ", here: " + setup,
                  .y_label = "milliseconds, this machine",
                  .groups = {},
                  .series = {{}}};
    for (std::size_t i = 0; i < kPaper.size(); ++i) {
        const ConfigurationSpeed& speed = table.configurations[i];
        const Summary& time = online ? speed.online : speed.offline;
        paper.groups.emplace_back(kPaper[i].name);
        paper.series[0].values.push_back(online ? kPaper[i].online : kPaper[i].offline);
        paper.series[0].deviations.push_back(online ? kPaper[i].online_deviation
                                                    : kPaper[i].offline_deviation);
        here.groups.push_back(speed.name);
        here.series[0].values.push_back(time.median);
    }
    paper.groups.emplace_back("PN");
    paper.series[0].values.push_back(kPaperPerlin);
    paper.series[0].deviations.push_back(kPaperPerlinDeviation);
    here.groups.emplace_back("tuned");
    here.series[0].values.push_back(table.tuned_perlin.median);
    page.begin_row();
    page.chart("figure-" + number + "-paper", paper);
    page.chart("figure-" + number + "-here", here);
    page.end_row();
}

void write_ratio_chart(Page& page, const SpeedTable& table) {
    BarChart chart{.title = "Online time against per-voxel Perlin noise = 1",
                   .y_label = "times PN (logarithmic)",
                   .groups = {},
                   .series = {{.name = "paper", .values = {}, .deviations = {}},
                              {.name = "here", .values = {}, .deviations = {}},
                              {.name = "here, cut into chunks", .values = {}, .deviations = {}}},
                   .log_y = true,
                   .width = 720,
                   .height = 320};
    for (std::size_t i = 0; i < kPaper.size(); ++i) {
        const ConfigurationSpeed& here = table.configurations[i];
        chart.groups.emplace_back(kPaper[i].name);
        chart.series[0].values.push_back(kPaper[i].online / kPaperPerlin);
        chart.series[1].values.push_back(here.online.median / table.perlin.median);
        chart.series[2].values.push_back(here.chunked.median / table.perlin.median);
    }
    page.chart("figure-ratios", chart);
}

}  // namespace

void write_speed(Page& page, const SpeedTable& table, const ReportOptions& options) {
    page.heading("Speed: tables 2 and 3, figures 4 and 5");
    page.paragraph(
        std::to_string(options.terrains) +
        " terrains of each configuration (the paper: 100), each of 5 × 5 × 5 chunks of 10³ voxels, "
        "seeds 1, 2, 3…, in one run that takes turns: one terrain of each configuration, then one "
        "of each baseline, and again. <em>Offline</em> builds the world from its definition and "
        "makes the origin plot; <em>online</em> makes the plot beside it with the generator that "
        "is already there. <em>PN</em> is the paper's baseline: four samples of three-dimensional "
        "Perlin noise for every voxel, its material and its flow, by the classic table of "
        "permutations in doubles. <em>PN, tuned</em> is the same noise reorganised as hard as the "
        "terrain is: rows, single floats, vector instructions.");
    page.paragraph(
        "Milliseconds of a machine of 2013 and of this one say nothing about each other. The "
        "ratios to PN of the same run can be compared, and they are what to look at. Two cautions: "
        "the paper does not print its materials, so the worlds here are ours with its counts and "
        "densities; and its PN may have been written differently from the one here.");
    write_table_2(page);
    write_table_3(page, table);
    write_ratios(page, table);
    write_ratio_chart(page, table);
    page.paragraph(
        "Figures 4 and 5 compare configurations with each other. The paper's PN stands beside its "
        "bars; beside ours stands the tuned one (medians), because the classic PN would be a bar "
        "twenty times as high. Thin lines are the paper's standard deviations.");
    write_figure(page, table, false);
    write_figure(page, table, true);
}

void write_size(Page& page, const SpeedTable& table) {
    page.heading("Size: limits and bytes");
    page.paragraph("A terrain of 50 × 50 columns, 125,000 voxels. The paper counts " +
                   fixed(kPaperLimits, 2) +
                   " limits and does not say how a limit at a chunk's border counts, so here are "
                   "both rules: every column once from bottom to top (<em>whole</em>), or every "
                   "chunk for itself, with the limits just outside it that its interpolation "
                   "needs (<em>chunked</em>; chunks of one material have none). Bytes are those of "
                   "the columns as the server's codec writes them, before any zstd.");
    ReportTable out{.name = "size",
                    .title = "Limits and bytes (averages)",
                    .head = {"", "limits, whole", "limits, chunked", "chunked / voxels",
                             "limits a column, whole", "bytes a column, with flow",
                             "bytes a column, without flow", "bits a voxel, with flow"},
                    .rows = {}};
    constexpr double kColumns = kPaperSide * kPaperSide;
    BarChart chart{.title = "Stored values a terrain",
                   .y_label = "limits, or voxels",
                   .groups = {"voxels", "paper"},
                   .series = {{.name = "",
                               .values = {static_cast<double>(kPaperVoxels), kPaperLimits},
                               .deviations = {}}},
                   .log_y = false,
                   .width = 720};
    chart.series[0].name = "chunked (paper: unknown rule)";
    chart.series.push_back({.name = "whole columns",
                            .values = {static_cast<double>(kPaperVoxels), kPaperLimits},
                            .deviations = {}});
    for (const ConfigurationSpeed& here : table.configurations) {
        const double bytes = here.bytes_whole.mean;
        out.rows.push_back(
            {here.name, fixed(here.limits_whole.mean, 0), fixed(here.limits_chunked.mean, 0),
             fixed(here.limits_chunked.mean / kPaperVoxels, 3),
             fixed(here.limits_whole.mean / kColumns, 2), fixed(bytes / kColumns, 2),
             fixed(here.bytes_no_flow.mean / kColumns, 2), fixed(8 * bytes / kPaperVoxels, 3)});
        chart.groups.push_back(here.name);
        chart.series[0].values.push_back(here.limits_chunked.mean);
        chart.series[1].values.push_back(here.limits_whole.mean);
    }
    out.rows.push_back(
        {"paper", "", "84376", fixed(kPaperLimits / kPaperVoxels, 3), "", "", "", ""});
    page.table(out);
    page.chart("figure-size", chart);
}

}  // namespace terrane
