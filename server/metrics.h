// What the server is doing, in Prometheus' text format. Times and outcomes of answers are observed
// as they are made; everything else is read when somebody asks.
#pragma once

#include "server/chunks/answer.h"

#include <chrono>
#include <memory>
#include <string>
#include <vector>

namespace terrane {

/// A value at the time of asking.
struct MetricSample {
    enum class Kind : std::uint8_t { counter, gauge };

    std::string name;
    std::string help;
    Kind kind = Kind::gauge;
    double value = 0;
    /// "kind=chunk,outcome=busy"; empty: none. Samples of one name stand together.
    std::string labels = {};
};

/// Any thread.
class Metrics {
  public:
    Metrics();
    ~Metrics();
    Metrics(const Metrics&) = delete;
    Metrics& operator=(const Metrics&) = delete;

    /// A worker has made an answer, or failed to, after the task had waited for `queued`.
    void observe(const Result<Answer>& answer, std::chrono::microseconds queued);

    std::string text(const std::vector<MetricSample>& samples) const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace terrane
