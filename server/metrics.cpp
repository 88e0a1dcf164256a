#include "server/metrics.h"

#include "protocol/base/result.h"
#include "server/chunks/answer.h"

#include <prometheus/counter.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace terrane {

namespace {

/// Seconds. An answer out of the store takes some 50 us, a cold tile some 2 ms, a queue seconds.
prometheus::Histogram::BucketBoundaries stage_buckets() {
    return {50e-6, 100e-6, 200e-6, 500e-6, 1e-3, 2e-3, 5e-3, 10e-3, 20e-3,
            50e-3, 100e-3, 200e-3, 500e-3, 1,    2,    5,    10};
}

double seconds_of(std::uint32_t microseconds) {
    return static_cast<double>(microseconds) * 1e-6;
}

}  // namespace

struct Metrics::Impl {
    prometheus::Registry registry;
    prometheus::Family<prometheus::Histogram>& stages =
        prometheus::BuildHistogram()
            .Name("terrane_stage_seconds")
            .Help("How long the stages of an answer took, those that it had")
            .Register(registry);
    prometheus::Histogram& queue = stages.Add({{"stage", "queue"}}, stage_buckets());
    prometheus::Histogram& generate = stages.Add({{"stage", "generate"}}, stage_buckets());
    prometheus::Histogram& mesh = stages.Add({{"stage", "mesh"}}, stage_buckets());
    prometheus::Histogram& encode = stages.Add({{"stage", "encode"}}, stage_buckets());
};

Metrics::Metrics() : impl_(std::make_unique<Impl>()) {}

Metrics::~Metrics() = default;

void Metrics::observe(const Result<Answer>& answer, std::chrono::microseconds queued) {
    impl_->queue.Observe(std::chrono::duration<double>(queued).count());
    const auto* chunk = answer ? std::get_if<ServedChunk>(&*answer) : nullptr;
    if (chunk == nullptr) {
        return;
    }
    const auto stage = [](prometheus::Histogram& histogram, std::uint32_t microseconds) {
        if (microseconds > 0) {
            histogram.Observe(seconds_of(microseconds));
        }
    };
    stage(impl_->generate, chunk->timings.generate_us);
    stage(impl_->mesh, chunk->timings.mesh_us);
    stage(impl_->encode, chunk->timings.encode_us);
}

std::string Metrics::text(const std::vector<MetricSample>& samples) const {
    std::vector<prometheus::MetricFamily> families = impl_->registry.Collect();
    for (const MetricSample& sample : samples) {
        const bool is_counter = sample.kind == MetricSample::Kind::counter;
        if (families.empty() || families.back().name != sample.name) {
            prometheus::MetricFamily family;
            family.name = sample.name;
            family.help = sample.help;
            family.type =
                is_counter ? prometheus::MetricType::Counter : prometheus::MetricType::Gauge;
            families.push_back(std::move(family));
        }
        prometheus::ClientMetric metric;
        for (std::string_view rest = sample.labels; !rest.empty();) {
            const std::string_view label = rest.substr(0, rest.find(','));
            rest.remove_prefix(std::min(label.size() + 1, rest.size()));
            const std::size_t equals = std::min(label.find('='), label.size());
            metric.label.push_back({std::string(label.substr(0, equals)),
                                    std::string(label.substr(std::min(equals + 1, label.size())))});
        }
        (is_counter ? metric.counter.value : metric.gauge.value) = sample.value;
        families.back().metric.push_back(std::move(metric));
    }
    return prometheus::TextSerializer().Serialize(families);
}

}  // namespace terrane
