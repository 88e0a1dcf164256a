#include "server/report/metrics.h"

#include "protocol/base/result.h"
#include "server/report/chart.h"
#include "server/report/numbers.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/shipped_world.h"
#include "server/report/speed.h"

#include <algorithm>
#include <string>

namespace terrane {
namespace {

void write_claims(Page& page) {
    page.table({.name = "metrics",
                .title = "The nine metrics of section 2.1",
                .head = {"Metric", "the paper requires", "its scale", "evidence here"},
                .rows = {{"Innovation", "2", "0-2", "distances between seeds"},
                         {"Structure", "2", "0-2", "likeness and coupling against two noises"},
                         {"Interest", "2", "0-2", "caves reached, way to the next vein; no proof"},
                         {"Speed", "2", "0-2", "online rate"},
                         {"Usability", "2", "0-2", "words"},
                         {"Control", "2", "0-3", "every parameter swept"},
                         {"Ampliability", "2", "0-2", "words"},
                         {"Scalability", "1", "0-1", "18 levels of detail"},
                         {"Realism", "2", "0-3", "words and pictures"}}});
}

void write_online_rate(Page& page, const SpeedTable& speed) {
    const auto rate = [](double milliseconds) {
        return static_cast<double>(kPaperVoxels) / milliseconds / 1000;
    };
    BarChart chart{.title = "Voxels made online, one thread",
                   .y_label = "million voxels a second (medians)",
                   .groups = {},
                   .series = {{.name = "whole columns", .values = {}, .deviations = {}},
                              {.name = "cut into chunks of 10³", .values = {}, .deviations = {}}},
                   .log_y = false,
                   .width = 720};
    double slowest = 1e18;
    for (const ConfigurationSpeed& here : speed.configurations) {
        chart.groups.push_back(here.name);
        chart.series[0].values.push_back(rate(here.online.median));
        chart.series[1].values.push_back(rate(here.chunked.median));
        slowest = std::min(slowest, rate(here.chunked.median));
    }
    chart.groups.emplace_back("PN");
    chart.series[0].values.push_back(rate(speed.perlin.median));
    chart.series[1].values.push_back(rate(speed.perlin.median));
    chart.groups.emplace_back("tuned");
    chart.series[0].values.push_back(rate(speed.tuned_perlin.median));
    chart.series[1].values.push_back(rate(speed.tuned_perlin.median));
    page.chart("online-rate", chart);
    page.paragraph(
        "Online means faster than it is walked through. The slowest configuration, cut "
        "into chunks as a client gets them, makes " +
        fixed(slowest, 0) +
        " million voxels a second on one thread of this machine, so a terrain of the "
        "paper's size every " +
        three_digits(kPaperVoxels / slowest / 1e6 * 1000) +
        " ms. Not in it: the network, and meshes.");
}

void write_usability(Page& page) {
    page.subheading("Usability");
    page.paragraph(
        "The paper's 2 is: parameters are related to the result. A world file has twelve numbers "
        "for the terrain, four for its grid, and a few for each material (where it lies, how "
        "thick, how rough, how like what is below, how far it blends), all in voxels or shares. "
        "Two of them smell of the technique: <code>octaves</code> and <code>plot</code>. Faults "
        "come all at once, each with its line and what is allowed. Whether designers find it easy, "
        "no number here shows; that takes designers.");
}

void write_ampliability(Page& page) {
    page.subheading("Ampliability");
    page.paragraph(
        "The paper's 2 is: other results by other input. The " +
        std::to_string(shipped_worlds().size()) +
        " worlds of this page are one program with as many world files: the paper's "
        "eight, a basin, an ore mountain and a fantasy land, and six landscapes. The bound of "
        "the paper's method is whatever is layered; overhangs, rivers and faults are "
        "what landscapes add to it. Floating islands no world file makes.");
}

void write_realism(Page& page) {
    page.subheading("Realism");
    page.paragraph(
        "The paper's 2 is: based on our reality, but not a simulation of it. That is what it is: "
        "folded, pinched and blended strata look like sediment, as the slices below show, and "
        "nothing was eroded, deposited or heated to make them. How real it looks is a question "
        "for geologists and eyes; no number on this page answers it.");
}

}  // namespace

Result<void> write_metrics(Page& page, const SpeedTable& speed, const ReportOptions& options) {
    page.heading("The nine metrics");
    page.paragraph(
        "The paper sets nine metrics for terrain generators and gives its own method "
        "marks by argument. Here is what can be computed for each, and plain words "
        "where nothing can.");
    write_claims(page);
    page.subheading("Innovation");
    if (auto done = write_innovation(page, options); !done) {
        return done;
    }
    page.subheading("Structure");
    if (auto done = write_structure(page, options); !done) {
        return done;
    }
    page.subheading("Interest");
    if (auto done = write_interest(page, options); !done) {
        return done;
    }
    page.subheading("Speed");
    write_online_rate(page, speed);
    write_usability(page);
    page.subheading("Control");
    page.paragraph(
        "Each parameter of the terrain, alone, over its range, with what should follow "
        "it: means of " +
        std::to_string(options.seeds) +
        " seeds of B3 with more veins and caves. A line that goes its way is control; "
        "what a number can't show is whether what a designer has in mind can be "
        "reached. Where a line bends back, something else limits the effect: thick "
        "elements hide each other, and the number of layers is drawn.");
    if (auto done = write_control(page, options); !done) {
        return done;
    }
    write_ampliability(page);
    page.subheading("Scalability");
    if (auto done = write_scalability(page, options); !done) {
        return done;
    }
    write_realism(page);
    return {};
}

}  // namespace terrane
