// The report's page: one HTML file that needs nothing else, the same numbers as CSV, and the
// pictures as files of their own.
#pragma once

#include "protocol/base/bytes.h"
#include "server/report/chart.h"

#include <string>
#include <vector>

namespace terrane {

struct ReportTable {
    std::string name;   ///< in the CSV
    std::string title;  ///< above the table
    std::vector<std::string> head;
    std::vector<std::vector<std::string>> rows;  ///< the first cell of each is its name
};

struct ReportFile {
    std::string name;
    Bytes bytes;
};

/// Filled from top to bottom.
class Page {
  public:
    void heading(const std::string& text);
    void subheading(const std::string& text);
    /// `html` is markup already.
    void paragraph(const std::string& html);
    void table(const ReportTable& table);
    /// Every point also goes into the CSV, under `name`.
    void chart(const std::string& name, const LineChart& chart);
    void chart(const std::string& name, const BarChart& chart);
    /// Charts and pictures between these stand beside each other where there is room.
    void begin_row();
    void end_row();
    void picture(const std::string& name, const Bytes& png, const std::string& caption);

    std::string html() const;
    /// table,row,column,value
    std::string csv() const;

    const std::vector<ReportFile>& pictures() const { return pictures_; }

  private:
    void add_number(const std::string& table, const std::string& row, const std::string& column,
                    const std::string& value);

    std::string body_;
    std::string contents_;
    std::string csv_ = "table,row,column,value\n";
    int headings_ = 0;
    std::vector<ReportFile> pictures_;
};

}  // namespace terrane
