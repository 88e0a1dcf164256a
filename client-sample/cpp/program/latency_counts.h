// Latencies as counts in steps of 2 %: percentiles of any number of samples in little memory.
#pragma once

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {

/// One thread.
class LatencyCounts {
  public:
    void add(std::chrono::microseconds latency) {
        const auto us = std::max<std::int64_t>(latency.count(), 1);
        max_us_ = std::max(max_us_, us);
        ++count_;
        ++counts_[std::min(step_of(us), kSteps - 1)];
    }

    void add(const LatencyCounts& other) {
        for (std::size_t i = 0; i < kSteps; ++i) {
            counts_[i] += other.counts_[i];
        }
        count_ += other.count_;
        max_us_ = std::max(max_us_, other.max_us_);
    }

    std::uint64_t count() const { return count_; }

    double max_ms() const { return static_cast<double>(max_us_) / 1000; }

    /// The least latency, rounded up to its step, that the share `q` of all samples is within; 0
    /// without samples.
    double quantile_ms(double q) const {
        const auto wanted = static_cast<std::uint64_t>(std::ceil(q * static_cast<double>(count_)));
        std::uint64_t sum = 0;
        for (std::size_t i = 0; i < kSteps; ++i) {
            sum += counts_[i];
            if (sum >= wanted && sum > 0) {
                return std::min(upper_us(i) / 1000, max_ms());
            }
        }
        return 0;
    }

  private:
    static constexpr double kStepsPerOctave = 32;
    static constexpr std::size_t kSteps = std::size_t{36} * 32;  ///< to 19 hours

    static std::size_t step_of(std::int64_t us) {
        return static_cast<std::size_t>(std::log2(static_cast<double>(us)) * kStepsPerOctave);
    }

    static double upper_us(std::size_t step) {
        return std::exp2(static_cast<double>(step + 1) / kStepsPerOctave);
    }

    std::vector<std::uint32_t> counts_ = std::vector<std::uint32_t>(kSteps);
    std::uint64_t count_ = 0;
    std::int64_t max_us_ = 0;
};

}  // namespace terrane
