#include "server/report/chart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {
namespace {

// Dark enough for white paper, told apart by people who see colours differently (Okabe and Ito).
constexpr std::array<std::string_view, 5> kColors = {"#0072b2", "#d55e00", "#009e73", "#a0509b",
                                                     "#8a6d00"};
constexpr int kLeft = 54;
constexpr int kRight = 14;
constexpr int kTop = 52;
constexpr int kBottom = 46;
constexpr int kBottomBare = 28;  ///< without a name for the x axis
constexpr int kLegendRow = 17;

/// What lies along one axis, from `first` to `last` pixels.
struct Axis {
    double least = 0;
    double most = 1;
    bool logarithmic = false;
    double first = 0;
    double last = 1;

    double at(double value) const {
        const double share = logarithmic ? std::log(value / least) / std::log(most / least)
                                         : (value - least) / (most - least);
        return first + share * (last - first);
    }
};

struct Extent {
    double least = std::numeric_limits<double>::infinity();
    double most = -std::numeric_limits<double>::infinity();

    void add(double value) {
        least = std::min(least, value);
        most = std::max(most, value);
    }
};

/// 1, 2 or 5 times a power of ten.
double nice_step(double range, int steps) {
    const double rough = range / steps;
    const double power = std::pow(10, std::floor(std::log10(rough)));
    for (const double factor : {1.0, 2.0, 5.0}) {
        if (factor * power >= rough) {
            return factor * power;
        }
    }
    return 10 * power;
}

std::vector<double> ticks_of(const Axis& axis) {
    std::vector<double> ticks;
    if (axis.logarithmic) {
        const bool few = axis.most / axis.least < 300;
        double power = std::pow(10, std::floor(std::log10(axis.least)));
        while (power <= axis.most * 1.0001) {
            for (const double factor : {1.0, 2.0, 5.0}) {
                const double tick = power * factor;
                if ((few || factor == 1.0) && tick >= axis.least * 0.9999 &&
                    tick <= axis.most * 1.0001) {
                    ticks.push_back(tick);
                }
            }
            power *= 10;
        }
        return ticks;
    }
    const double step = nice_step(axis.most - axis.least, 5);
    for (double i = std::ceil(axis.least / step - 1e-9); i * step <= axis.most + step * 1e-6; ++i) {
        ticks.push_back(i * step);
    }
    return ticks;
}

/// Widened to whole steps, from 0 on if nothing is below it and `from_zero`.
Axis axis_of(Extent extent, bool logarithmic, bool from_zero, double first, double last) {
    Axis axis{.least = extent.least,
              .most = extent.most,
              .logarithmic = logarithmic,
              .first = first,
              .last = last};
    if (!(extent.least <= extent.most)) {
        axis.least = logarithmic ? 0.1 : 0;
        axis.most = 1;
    } else if (logarithmic) {
        axis.least = extent.least / 1.15;
        axis.most = extent.most * 1.15;
        if (from_zero) {  // bars stand on a power of ten
            axis.least = std::pow(10, std::floor(std::log10(extent.least / 1.5)));
        }
    } else {
        if (from_zero && extent.least >= 0) {
            axis.least = 0;
        }
        if (axis.most - axis.least < 1e-12) {
            axis.most = axis.least + (axis.least == 0 ? 1 : std::abs(axis.least) * 0.1);
        }
        const double step = nice_step(axis.most - axis.least, 5);
        axis.least = std::floor(axis.least / step + 1e-9) * step;
        axis.most = std::ceil(axis.most / step - 1e-9) * step;
    }
    return axis;
}

std::string number(double value) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.1f", value);
    return text.data();
}

std::string tick_text(double value) {
    const double size = std::abs(value);
    std::array<char, 32> text{};
    if (size < 1e-12) {
        return "0";
    }
    if (size >= 1e4 && size < 1e6) {
        std::snprintf(text.data(), text.size(), "%.6gk", value / 1000);
    } else if (size >= 1e6 || (size > 0 && size < 1e-3)) {
        std::snprintf(text.data(), text.size(), "%.0e", value);
    } else {
        std::snprintf(text.data(), text.size(), "%.6g", value);
    }
    return text.data();
}

struct TextPlace {
    double x = 0;
    double y = 0;
    std::string_view anchor = "middle";
    std::string_view style = "t";
};

void add_text(std::string& svg, const TextPlace& place, const std::string& text) {
    svg += "<text class=\"" + std::string(place.style) + "\" x=\"" + number(place.x) + "\" y=\"" +
           number(place.y) + "\" text-anchor=\"" + std::string(place.anchor) + "\">" +
           escape_html(text) + "</text>";
}

void add_line(std::string& svg, std::string_view style, ChartPoint a, ChartPoint b) {
    svg += "<line class=\"" + std::string(style) + "\" x1=\"" + number(a.x) + "\" y1=\"" +
           number(a.y) + "\" x2=\"" + number(b.x) + "\" y2=\"" + number(b.y) + "\"/>";
}

/// Everything around the data. `names` are the legend's; one alone needs none.
struct Frame {
    std::string title;
    std::string x_label;
    std::string y_label;
    std::vector<std::string> names;
    int width = 0;
    int height = 0;

    // Names beside each other while they fit, roughly 6.2 pixels a letter.
    std::vector<std::vector<std::size_t>> legend_rows() const {
        std::vector<std::vector<std::size_t>> rows;
        double used = 1e9;
        for (std::size_t i = 0; i < names.size() && names.size() > 1; ++i) {
            const double needed = 24 + 6.2 * static_cast<double>(names[i].size());
            if (used + needed > width - kRight - 10) {
                rows.emplace_back();
                used = 0;
            }
            rows.back().push_back(i);
            used += needed;
        }
        return rows;
    }

    double top() const { return kTop + kLegendRow * static_cast<double>(legend_rows().size()); }

    double bottom() const { return height - (x_label.empty() ? kBottomBare : kBottom); }

    double right() const { return width - kRight; }
};

std::string begin_svg(const Frame& frame) {
    std::string svg = "<svg class=\"chart\" viewBox=\"0 0 " + std::to_string(frame.width) + " " +
                      std::to_string(frame.height) + "\" width=\"" + std::to_string(frame.width) +
                      "\" height=\"" + std::to_string(frame.height) + "\" role=\"img\">";
    add_text(svg, {.x = 10, .y = 18, .anchor = "start", .style = "ct"}, frame.title);
    add_text(svg, {.x = 10, .y = 35, .anchor = "start", .style = "t q"}, frame.y_label);
    double y = kTop;
    for (const auto& row : frame.legend_rows()) {
        double x = 12;
        for (const std::size_t i : row) {
            svg += "<rect x=\"" + number(x) + "\" y=\"" + number(y - 8) +
                   "\" width=\"10\" height=\"10\" fill=\"" +
                   std::string(kColors[i % kColors.size()]) + "\"/>";
            add_text(svg, {.x = x + 14, .y = y + 1, .anchor = "start"}, frame.names[i]);
            x += 24 + 6.2 * static_cast<double>(frame.names[i].size());
        }
        y += kLegendRow;
    }
    return svg;
}

void add_y_axis(std::string& svg, const Frame& frame, const Axis& axis) {
    for (const double tick : ticks_of(axis)) {
        const double y = axis.at(tick);
        add_line(svg, "g", {kLeft, y}, {frame.right(), y});
        add_text(svg, {.x = kLeft - 6, .y = y + 4, .anchor = "end"}, tick_text(tick));
    }
    add_line(svg, "a", {kLeft, frame.bottom()}, {frame.right(), frame.bottom()});
    add_text(svg, {.x = (kLeft + frame.right()) / 2, .y = frame.height - 8.0}, frame.x_label);
}

void add_series(std::string& svg, const LineSeries& series, std::string_view color, const Axis& x,
                const Axis& y) {
    std::string path;
    std::string marks;
    for (const ChartPoint point : series.points) {
        if ((x.logarithmic && point.x <= 0) || (y.logarithmic && point.y <= 0)) {
            continue;
        }
        const std::string at_x = number(x.at(point.x));
        const std::string at_y = number(y.at(point.y));
        path.append(path.empty() ? "M" : "L").append(at_x).append(" ").append(at_y);
        marks.append("<circle cx=\"").append(at_x).append("\" cy=\"").append(at_y);
        marks.append("\" r=\"3\" fill=\"").append(color).append("\"/>");
    }
    svg += "<path d=\"" + path + "\" fill=\"none\" stroke-width=\"2\" stroke=\"" +
           std::string(color) + "\"/>" + marks;
}

}  // namespace

std::string escape_html(const std::string& text) {
    std::string out;
    for (const char c : text) {
        switch (c) {
            case '&':
                out += "&amp;";
                break;
            case '<':
                out += "&lt;";
                break;
            case '>':
                out += "&gt;";
                break;
            case '"':
                out += "&quot;";
                break;
            default:
                out += c;
        }
    }
    return out;
}

std::string draw_chart(const LineChart& chart) {
    Frame frame{.title = chart.title,
                .x_label = chart.x_label,
                .y_label = chart.y_label,
                .names = {},
                .width = chart.width,
                .height = chart.height};
    Extent of_x;
    Extent of_y;
    for (const LineSeries& series : chart.series) {
        frame.names.push_back(series.name);
        for (const ChartPoint point : series.points) {
            if ((!chart.log_x || point.x > 0) && (!chart.log_y || point.y > 0)) {
                of_x.add(point.x);
                of_y.add(point.y);
            }
        }
    }
    const Axis x = axis_of(of_x, chart.log_x, false, kLeft + 6, frame.right() - 8);
    const Axis y = axis_of(of_y, chart.log_y, !chart.log_y, frame.bottom(), frame.top() + 4);
    std::string svg = begin_svg(frame);
    add_y_axis(svg, frame, y);
    double text_end = -1e9;
    for (const double tick : ticks_of(x)) {
        const std::string text = tick_text(tick);
        const double half = 3.6 * static_cast<double>(text.size());
        if (x.at(tick) - half < text_end + 4) {
            continue;  // no room beside the one before
        }
        text_end = x.at(tick) + half;
        add_line(svg, "a", {x.at(tick), frame.bottom()}, {x.at(tick), frame.bottom() + 4});
        add_text(svg, {.x = x.at(tick), .y = frame.bottom() + 17}, text);
    }
    for (std::size_t i = 0; i < chart.series.size(); ++i) {
        add_series(svg, chart.series[i], kColors[i % kColors.size()], x, y);
    }
    return svg + "</svg>";
}

std::string draw_chart(const BarChart& chart) {
    Frame frame{.title = chart.title,
                .x_label = "",
                .y_label = chart.y_label,
                .names = {},
                .width = chart.width,
                .height = chart.height};
    Extent extent;
    for (const BarSeries& series : chart.series) {
        frame.names.push_back(series.name);
        for (std::size_t i = 0; i < series.values.size(); ++i) {
            if (chart.log_y && series.values[i] <= 0) {
                continue;
            }
            extent.add(series.values[i]);
            extent.add(series.values[i] + (series.deviations.empty() ? 0 : series.deviations[i]));
        }
    }
    const Axis y = axis_of(extent, chart.log_y, true, frame.bottom(), frame.top() + 4);
    std::string svg = begin_svg(frame);
    add_y_axis(svg, frame, y);
    const double group = (frame.right() - kLeft) / static_cast<double>(chart.groups.size());
    const double bar = group * 0.76 / static_cast<double>(chart.series.size());
    for (std::size_t g = 0; g < chart.groups.size(); ++g) {
        const double left = kLeft + group * (static_cast<double>(g) + 0.12);
        for (std::size_t s = 0; s < chart.series.size(); ++s) {
            const double value = chart.series[s].values[g];
            if (chart.log_y && value <= 0) {
                continue;
            }
            const double x = left + bar * static_cast<double>(s);
            const double top = std::min(y.at(value), frame.bottom());
            svg += "<rect x=\"" + number(x) + "\" y=\"" + number(top) + "\" width=\"" +
                   number(bar * 0.92) + "\" height=\"" + number(frame.bottom() - top) +
                   "\" fill=\"" + std::string(kColors[s % kColors.size()]) + "\"/>";
            if (!chart.series[s].deviations.empty() && chart.series[s].deviations[g] > 0) {
                const double middle = x + bar * 0.46;
                const double spread = chart.series[s].deviations[g];
                const double low = std::max(value - spread, y.least);
                add_line(svg, "e", {middle, y.at(value + spread)}, {middle, y.at(low)});
            }
        }
        add_text(svg, {.x = left + group * 0.38, .y = frame.bottom() + 17}, chart.groups[g]);
    }
    return svg + "</svg>";
}

}  // namespace terrane
