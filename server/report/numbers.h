// What a list of measured numbers comes to.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace terrane {

struct Summary {
    double mean = 0;
    double deviation = 0;  ///< standard deviation of the sample
    double median = 0;
};

/// All 0 of an empty list.
Summary summarize(std::vector<double> values);

/// Pearson's; 0 if a side does not vary. Needs lists of one length.
double correlation(std::span<const double> a, std::span<const double> b);

/// Slope of the best line through (log x, log y): the exponent of a power law. Needs values above
/// 0.
double growth_exponent(std::span<const double> x, std::span<const double> y);

/// With so many digits after the point.
std::string fixed(double value, int digits);
/// Three significant digits, whatever the size.
std::string three_digits(double value);

}  // namespace terrane
