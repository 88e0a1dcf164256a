#include "server/report/numbers.h"

#include "protocol/base/check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <span>
#include <string>
#include <vector>

namespace terrane {

Summary summarize(std::vector<double> values) {
    if (values.empty()) {
        return {};
    }
    const auto count = static_cast<double>(values.size());
    Summary summary;
    for (const double value : values) {
        summary.mean += value / count;
    }
    for (const double value : values) {
        summary.deviation += (value - summary.mean) * (value - summary.mean);
    }
    summary.deviation = values.size() > 1 ? std::sqrt(summary.deviation / (count - 1)) : 0;
    std::ranges::sort(values);
    const std::size_t half = values.size() / 2;
    summary.median = values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
    return summary;
}

double correlation(std::span<const double> a, std::span<const double> b) {
    TERRANE_ASSERT(a.size() == b.size());
    const double mean_a = summarize({a.begin(), a.end()}).mean;
    const double mean_b = summarize({b.begin(), b.end()}).mean;
    double both = 0;
    double square_a = 0;
    double square_b = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        both += (a[i] - mean_a) * (b[i] - mean_b);
        square_a += (a[i] - mean_a) * (a[i] - mean_a);
        square_b += (b[i] - mean_b) * (b[i] - mean_b);
    }
    const double norm = std::sqrt(square_a * square_b);
    return norm > 0 ? both / norm : 0;
}

double growth_exponent(std::span<const double> x, std::span<const double> y) {
    TERRANE_ASSERT(x.size() == y.size() && x.size() > 1);
    std::vector<double> log_x;
    std::vector<double> log_y;
    for (std::size_t i = 0; i < x.size(); ++i) {
        log_x.push_back(std::log(x[i]));
        log_y.push_back(std::log(y[i]));
    }
    const Summary of_x = summarize(log_x);
    const Summary of_y = summarize(log_y);
    return of_x.deviation > 0 ? correlation(log_x, log_y) * of_y.deviation / of_x.deviation : 0;
}

std::string fixed(double value, int digits) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "%.*f", digits, value);
    return text.data();
}

std::string three_digits(double value) {
    const double size = std::abs(value);
    if (size == 0) {
        return "0";
    }
    if (size < 1e-4 || size >= 1e7) {
        std::array<char, 64> text{};
        std::snprintf(text.data(), text.size(), "%.2e", value);
        return text.data();
    }
    const int whole = static_cast<int>(std::floor(std::log10(size))) + 1;
    return fixed(value, std::clamp(3 - whole, 0, 6));
}

}  // namespace terrane
