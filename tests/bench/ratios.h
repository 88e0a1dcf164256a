// Speed as ratios between benchmarks of one run: the only figures that machines can share.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace terrane::bench {

/// "`numerators` (their mean) take at most `bar` times as long as `denominator`", by medians of
/// seconds an item. Names are as Google Benchmark prints them; "name:stage" is the counter
/// "stage_s" of benchmark "name". Two stages of one benchmark are compared repetition by
/// repetition: what else the machine did then was done to both.
struct Ratio {
    std::string what;
    std::vector<std::string> numerators;
    std::string denominator;
    double bar = 0;
};

/// All ratios that the program prints; each *_bench.cpp adds its own.
std::vector<Ratio>& ratios();

/// For use at namespace scope: `const RatioEntry kEntry{{...}};`
struct RatioEntry {
    explicit RatioEntry(Ratio ratio) { ratios().push_back(std::move(ratio)); }
};

}  // namespace terrane::bench
