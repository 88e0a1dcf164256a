// Charts as SVG, to stand inside an HTML page.
#pragma once

#include <string>
#include <vector>

namespace terrane {

inline constexpr int kChartWidth = 460;  ///< pixels, unless said otherwise
inline constexpr int kChartHeight = 290;

struct ChartPoint {
    double x = 0;
    double y = 0;
};

struct LineSeries {
    std::string name;
    std::vector<ChartPoint> points;
};

/// Lines with a mark at each point. A logarithmic axis leaves out what is not above 0.
struct LineChart {
    std::string title;
    std::string x_label;
    std::string y_label;
    std::vector<LineSeries> series;
    bool log_x = false;
    bool log_y = false;
    int width = kChartWidth;
    int height = kChartHeight;
};

struct BarSeries {
    std::string name;
    std::vector<double> values;      ///< one a group
    std::vector<double> deviations;  ///< likewise, or empty
};

struct BarChart {
    std::string title;
    std::string y_label;
    std::vector<std::string> groups;
    std::vector<BarSeries> series;
    bool log_y = false;
    int width = kChartWidth;
    int height = kChartHeight;
};

std::string draw_chart(const LineChart& chart);
std::string draw_chart(const BarChart& chart);

/// & < > " as entities.
std::string escape_html(const std::string& text);

}  // namespace terrane
