// Runs the benchmarks, interleaved and repeated, and prints ratios of medians against their bars.
//
//   terrane_bench [--json FILE] [--check] [Google Benchmark's own flags]
//
// --json FILE also writes medians and ratios; --check exits 1 if a ratio is above its bar.
#include "tests/bench/ratios.h"

#include <benchmark/benchmark.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>
#include <string>
#include <vector>

namespace terrane::bench {

std::vector<Ratio>& ratios() {
    static std::vector<Ratio> list;
    return list;
}

namespace {

/// Keeps every repetition's time an item, in seconds.
class CollectingReporter : public benchmark::ConsoleReporter {
  public:
    CollectingReporter() : ConsoleReporter(OO_Tabular) {}

    void ReportRuns(const std::vector<Run>& runs) override {
        std::vector<Run> shown;
        for (const Run& run : runs) {
            if (run.run_type == Run::RT_Aggregate && run.aggregate_name == "median") {
                shown.push_back(run);
            }
            if (run.run_type != Run::RT_Iteration || run.error_occurred) {
                continue;
            }
            const auto rate = run.counters.find("items_per_second");
            const double seconds =
                rate != run.counters.end() && rate->second.value > 0
                    ? 1 / rate->second.value
                    : (has_own_clock(run) ? run.real_accumulated_time : run.cpu_accumulated_time) /
                          static_cast<double>(run.iterations);
            // Without the repetition count that str() appends.
            const std::string& arguments = run.run_name.args;
            const std::string name =
                run.run_name.function_name + (arguments.empty() ? "" : "/" + arguments);
            times_[name].push_back(seconds);
            for (const auto& [counter, value] : run.counters) {
                if (counter.ends_with("_s")) {
                    times_[name + ":" + counter.substr(0, counter.size() - 2)].push_back(
                        value.value);
                }
            }
        }
        if (!shown.empty()) {
            ConsoleReporter::ReportRuns(shown);
        }
    }

    /// Whether a benchmark measures the clock on the wall, since it uses several threads, or times
    /// itself; all others count processor time, which a busy machine disturbs less.
    static bool has_own_clock(const Run& run) { return !run.run_name.time_type.empty(); }

    /// Median seconds an item; 0 if the benchmark did not run.
    double median(const std::string& name) const {
        const auto found = times_.find(name);
        return found == times_.end() ? 0 : median_of(found->second);
    }

    /// The median of a repetition's own ratio, of two stages of one benchmark; -1 if it did not
    /// run.
    double paired_median(const std::string& above, const std::string& below) const {
        const auto numerators = times_.find(above);
        const auto denominators = times_.find(below);
        if (numerators == times_.end() || denominators == times_.end()) {
            return -1;
        }
        std::vector<double> quotients;
        for (std::size_t i = 0; i < numerators->second.size(); ++i) {
            quotients.push_back(numerators->second[i] / denominators->second[i]);
        }
        return median_of(std::move(quotients));
    }

    const std::map<std::string, std::vector<double>>& times() const { return times_; }

  private:
    static double median_of(std::vector<double> values) {
        std::sort(values.begin(), values.end());
        return values[values.size() / 2];
    }

    std::map<std::string, std::vector<double>> times_;
};

/// -1 if one of its benchmarks did not run.
double value_of(const Ratio& ratio, const CollectingReporter& reporter) {
    const auto benchmark_of = [](const std::string& name) {
        return name.substr(0, name.find(':'));
    };
    if (ratio.numerators.size() == 1 &&
        benchmark_of(ratio.numerators[0]) == benchmark_of(ratio.denominator)) {
        return reporter.paired_median(ratio.numerators[0], ratio.denominator);
    }
    double sum = 0;
    for (const std::string& name : ratio.numerators) {
        const double median = reporter.median(name);
        if (median == 0) {
            return -1;
        }
        sum += median;
    }
    const double below = reporter.median(ratio.denominator);
    return below == 0 ? -1 : sum / static_cast<double>(ratio.numerators.size()) / below;
}

bool print_ratios(const CollectingReporter& reporter, nlohmann::json& json) {
    bool all_met = true;
    std::printf("\n%-72s %9s %9s\n", "ratio (medians of this run)", "measured", "bar");
    for (const Ratio& ratio : ratios()) {
        const double value = value_of(ratio, reporter);
        if (value < 0) {
            continue;
        }
        const bool met = value <= ratio.bar;
        all_met = all_met && met;
        std::printf("%-72s %9.4f %9.4f %s\n", ratio.what.c_str(), value, ratio.bar,
                    met ? "met" : "MISSED");
        json["ratios"].push_back(
            {{"what", ratio.what}, {"value", value}, {"bar", ratio.bar}, {"met", met}});
    }
    return all_met;
}

int run(const std::vector<char*>& arguments) {
    std::string json_path;
    bool check = false;
    std::vector<std::string> defaults = {"--benchmark_repetitions=9",
                                         "--benchmark_enable_random_interleaving=true",
                                         "--benchmark_min_time=0.05"};
    std::vector<char*> rest = {arguments[0]};
    for (std::string& flag : defaults) {
        rest.push_back(flag.data());
    }
    for (std::size_t i = 1; i < arguments.size(); ++i) {
        const std::string argument = arguments[i];
        if (argument == "--json" && i + 1 < arguments.size()) {
            json_path = arguments[++i];
        } else if (argument == "--check") {
            check = true;
        } else {
            rest.push_back(arguments[i]);
        }
    }
    int count = static_cast<int>(rest.size());
    benchmark::Initialize(&count, rest.data());
    if (benchmark::ReportUnrecognizedArguments(count, rest.data())) {
        return 2;
    }
    CollectingReporter reporter;
    benchmark::RunSpecifiedBenchmarks(&reporter);
    nlohmann::json json{{"ratios", nlohmann::json::array()}};
    const bool all_met = print_ratios(reporter, json);
    for (const auto& [name, times] : reporter.times()) {
        json["medians_s"][name] = reporter.median(name);
    }
    if (!json_path.empty()) {
        std::ofstream(json_path) << json.dump(2) << '\n';
    }
    return check && !all_met ? 1 : 0;
}

}  // namespace
}  // namespace terrane::bench

int main(int argc, char** argv) {
    return terrane::bench::run({argv, argv + argc});
}
