#include "server/report/page.h"

#include "protocol/base/bytes.h"
#include "server/report/chart.h"
#include "server/report/numbers.h"

#include <cctype>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace terrane {
namespace {

constexpr std::string_view kStyle = R"css(
:root{color-scheme:light}
*{box-sizing:border-box}
body{margin:0;background:#fff;color:#1c2024;font:16px/1.55 system-ui,"Segoe UI",Helvetica,Arial,
"DejaVu Sans",sans-serif}
main{max-width:1020px;margin:0 auto;padding:36px 28px 80px}
h1{font-size:34px;line-height:1.2;margin:0 0 6px;letter-spacing:-.01em}
h2{font-size:24px;margin:52px 0 10px;padding-top:14px;border-top:2px solid #1c2024}
h3{font-size:18px;margin:30px 0 6px}
p{max-width:78ch;margin:10px 0}
a{color:#00558a}
nav{columns:2;font-size:15px;margin:18px 0;padding:12px 18px;background:#f3f5f7;border-radius:6px}
nav a{display:block;text-decoration:none;padding:2px 0}
table{border-collapse:collapse;margin:14px 0 18px;font-size:13.5px;font-variant-numeric:tabular-nums}
.wide{overflow-x:auto}
caption{text-align:left;font-weight:600;padding:6px 0;caption-side:top}
th,td{padding:4px 8px;text-align:right;border-bottom:1px solid #dde1e5;white-space:nowrap}
th{background:#f3f5f7;font-weight:600;white-space:normal;vertical-align:bottom;line-height:1.25}
th:first-child,td:first-child,.w{text-align:left}
.row{display:flex;flex-wrap:wrap;gap:14px 22px;margin:14px 0}
figure{margin:0;max-width:100%}
figure img{display:block;max-width:100%;height:auto;border-radius:4px}
figure.big{width:100%}
figure.half{width:calc(50% - 11px)}
figcaption{font-size:13.5px;color:#4a5259;padding:5px 0 2px;line-height:1.4}
svg.chart{display:block;max-width:100%;height:auto;background:#fff;border:1px solid #dde1e5;
border-radius:4px}
svg text{font-family:system-ui,"Segoe UI",Helvetica,Arial,"DejaVu Sans",sans-serif;fill:#1c2024}
svg .t{font-size:11.5px}svg .q{fill:#4a5259}svg .ct{font-size:13.5px;font-weight:600}
svg .g{stroke:#e3e7ea}svg .a{stroke:#596068}svg .e{stroke:#1c2024;stroke-width:1.3}
@media screen and (max-width:760px){figure.half{width:100%}nav{columns:1}}
@media print{body{font-size:10.5pt}main{max-width:none;padding:0}h2{break-after:avoid}
h3{break-after:avoid}figure,svg,tr{break-inside:avoid}nav{columns:2;background:none;padding:0}
a{color:inherit}.row{gap:8px 12px}th{background:none}table{font-size:7.5pt}
th,td{padding:2px 4px}svg.chart{max-width:88mm}
svg.chart[width="720"]{max-width:150mm}svg.chart[width="300"]{max-width:57mm}}
)css";

std::string base64(std::span<const std::byte> bytes) {
    constexpr std::string_view kDigits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    out.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t group = 0;
        for (std::size_t j = 0; j < 3; ++j) {
            group = group << 8U |
                    (i + j < bytes.size() ? std::to_integer<std::uint32_t>(bytes[i + j]) : 0U);
        }
        for (std::size_t j = 0; j < 4; ++j) {
            out += i + j <= bytes.size() ? kDigits[group >> (18U - 6U * j) & 63U] : '=';
        }
    }
    return out;
}

/// As RFC 4180 wants a field.
std::string csv_field(const std::string& text) {
    if (text.find_first_of(",\"\n") == std::string::npos) {
        return text;
    }
    std::string quoted = "\"";
    for (const char c : text) {
        quoted += c;
        if (c == '"') {
            quoted += c;
        }
    }
    return quoted + '"';
}

}  // namespace

void Page::add_number(const std::string& table, const std::string& row, const std::string& column,
                      const std::string& value) {
    csv_ += csv_field(table) + ',' + csv_field(row) + ',' + csv_field(column) + ',' +
            csv_field(value) + '\n';
}

void Page::heading(const std::string& text) {
    const std::string id = "s" + std::to_string(++headings_);
    body_ += "<h2 id=\"" + id + "\">" + escape_html(text) + "</h2>\n";
    contents_ += "<a href=\"#" + id + "\">" + escape_html(text) + "</a>\n";
}

void Page::subheading(const std::string& text) {
    body_ += "<h3>" + escape_html(text) + "</h3>\n";
}

void Page::paragraph(const std::string& html) {
    body_ += "<p>" + html + "</p>\n";
}

void Page::table(const ReportTable& table) {
    body_ +=
        "<div class=\"wide\"><table><caption>" + escape_html(table.title) + "</caption><thead><tr>";
    // Columns of words stand to the left, columns of numbers to the right.
    const auto opening = [&](const char* tag, std::size_t column) {
        const bool words = column > 0 && !table.rows.empty() && column < table.rows[0].size() &&
                           !table.rows[0][column].empty() &&
                           std::isalpha(static_cast<unsigned char>(table.rows[0][column][0])) != 0;
        return '<' + std::string(tag) + (words ? " class=\"w\">" : ">");
    };
    for (std::size_t i = 0; i < table.head.size(); ++i) {
        body_ += opening("th", i) + escape_html(table.head[i]) + "</th>";
    }
    body_ += "</tr></thead><tbody>\n";
    for (const auto& row : table.rows) {
        body_ += "<tr>";
        for (std::size_t i = 0; i < row.size(); ++i) {
            body_ += opening("td", i) + escape_html(row[i]) + "</td>";
            if (i > 0) {
                add_number(table.name, row[0], table.head[i], row[i]);
            }
        }
        body_ += "</tr>\n";
    }
    body_ += "</tbody></table></div>\n";
}

void Page::chart(const std::string& name, const LineChart& chart) {
    body_ += "<figure>" + draw_chart(chart) + "</figure>\n";
    for (const LineSeries& series : chart.series) {
        for (const ChartPoint point : series.points) {
            add_number(name, series.name.empty() ? chart.y_label : series.name,
                       three_digits(point.x), three_digits(point.y));
        }
    }
}

void Page::chart(const std::string& name, const BarChart& chart) {
    body_ += "<figure>" + draw_chart(chart) + "</figure>\n";
    for (const BarSeries& series : chart.series) {
        for (std::size_t i = 0; i < series.values.size(); ++i) {
            add_number(name, series.name.empty() ? chart.y_label : series.name, chart.groups[i],
                       three_digits(series.values[i]));
        }
    }
}

void Page::begin_row() {
    body_ += "<div class=\"row\">\n";
}

void Page::end_row() {
    body_ += "</div>\n";
}

void Page::picture(const std::string& name, const Bytes& png, const std::string& caption) {
    body_ += "<figure class=\"half\"><img alt=\"" + escape_html(caption) +
             "\" src=\"data:image/png;base64," + base64(png) + "\"><figcaption>" +
             escape_html(caption) + "</figcaption></figure>\n";
    pictures_.push_back({.name = name + ".png", .bytes = png});
}

std::string Page::html() const {
    return "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
           "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n"
           "<title>Terrane: the paper, reproduced</title>\n<style>" +
           std::string(kStyle) +
           "</style></head>\n<body><main>\n<h1>The paper, reproduced</h1>\n"
           "<p>Every table and figure of Santamaría-Ibirika et al., <em>Procedural approach to "
           "volumetric terrain generation</em> (The Visual Computer, 2013), beside what this "
           "program does on this machine.</p>\n<nav>\n" +
           contents_ + "</nav>\n" + body_ + "</main></body></html>\n";
}

std::string Page::csv() const {
    return csv_;
}

}  // namespace terrane
