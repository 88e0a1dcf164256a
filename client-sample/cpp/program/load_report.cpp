#include "client-sample/cpp/program/load_report.h"

#include "client-sample/cpp/program/load_client.h"

#include <nlohmann/json.hpp>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <span>
#include <string>

namespace terrane {

namespace {

double share(std::uint64_t part, std::uint64_t whole) {
    return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

double per_second(std::uint64_t count, double seconds) {
    return seconds > 0 ? static_cast<double>(count) / seconds : 0;
}

/// To three decimals, so that the JSON is readable.
double rounded(double value) {
    return std::round(value * 1000) / 1000;
}

template <typename... Values>
std::string line(const char* format, Values... values) {
    std::array<char, 256> text{};
    std::snprintf(text.data(), text.size(), format, values...);
    return text.data();
}

}  // namespace

void add(LoadResult& result, const LoadCounts& counts) {
    result.chunks += counts.chunks;
    result.bytes += counts.bytes;
    result.wasted_chunks += counts.wasted_chunks;
    result.wasted_bytes += counts.wasted_bytes;
    result.forgotten += counts.forgotten;
    result.triangles += counts.triangles;
    result.busy += counts.busy;
    result.refused += counts.refused;
    result.wrong += counts.undecodable;
    result.latency.add(counts.latency);
    if (counts.fill) {
        result.fill.add(*counts.fill);
    }
}

double jain_index(std::span<const double> rates) {
    double sum = 0;
    double squares = 0;
    for (const double rate : rates) {
        sum += rate;
        squares += rate * rate;
    }
    return squares > 0 ? sum * sum / (static_cast<double>(rates.size()) * squares) : 1;
}

std::optional<double> rate_of(const LoadCounts& counts, const LoadStart& start) {
    const std::uint64_t chunks = counts.fill ? counts.fill_chunks : counts.chunks;
    const auto wanting = (counts.fill ? *counts.fill : counts.wanting) - start.wanting;
    if (chunks <= start.chunks || wanting.count() <= 0) {
        // Served to the end before it counted, or starved from then on.
        return counts.fill ? std::nullopt : std::optional(0.0);
    }
    return per_second(chunks - start.chunks, std::chrono::duration<double>(wanting).count());
}

std::string load_json(const LoadResult& r) {
    const nlohmann::ordered_json json = {{"clients", r.clients},
                                         {"seconds", rounded(r.seconds)},
                                         {"chunks", r.chunks},
                                         {"chunks_per_s", rounded(per_second(r.chunks, r.seconds))},
                                         {"bytes", r.bytes},
                                         {"checked", r.checked},
                                         {"wrong", r.wrong},
                                         {"hung", r.hung},
                                         {"busy", r.busy},
                                         {"p50_ms", rounded(r.latency.quantile_ms(0.5))},
                                         {"p90_ms", rounded(r.latency.quantile_ms(0.9))},
                                         {"p99_ms", rounded(r.latency.quantile_ms(0.99))},
                                         {"max_ms", rounded(r.latency.max_ms())},
                                         {"fairness", rounded(r.fairness)},
                                         {"fairness_min_max", rounded(r.fairness_min_max)},
                                         {"fill_p50_ms", rounded(r.fill.quantile_ms(0.5))},
                                         {"fill_p90_ms", rounded(r.fill.quantile_ms(0.9))},
                                         {"fill_max_ms", rounded(r.fill.max_ms())},
                                         {"filled", r.fill.count()},
                                         {"unfilled", r.unfilled},
                                         {"disconnected", r.disconnected},
                                         {"refused", r.refused},
                                         {"triangles", r.triangles},
                                         {"forgotten", r.forgotten},
                                         {"wasted_chunks", r.wasted_chunks},
                                         {"wasted_bytes", r.wasted_bytes},
                                         {"wasted_share", rounded(share(r.wasted_bytes, r.bytes))},
                                         {"load_cpu_seconds", rounded(r.cpu_seconds)},
                                         {"notes", r.notes}};
    return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string load_text(const LoadResult& r) {
    std::string text;
    text += line("%zu clients, %.1f s: %llu chunks, %.0f a second, %.1f MB, %llu triangles\n",
                 r.clients, r.seconds, static_cast<unsigned long long>(r.chunks),
                 per_second(r.chunks, r.seconds), static_cast<double>(r.bytes) / 1e6,
                 static_cast<unsigned long long>(r.triangles));
    text += line("wanted to decoded   p50 %.1f   p90 %.1f   p99 %.1f   max %.1f ms\n",
                 r.latency.quantile_ms(0.5), r.latency.quantile_ms(0.9),
                 r.latency.quantile_ms(0.99), r.latency.max_ms());
    text += line("view filled         p50 %.1f   p90 %.1f   max %.1f ms, %llu of %zu clients\n",
                 r.fill.quantile_ms(0.5), r.fill.quantile_ms(0.9), r.fill.max_ms(),
                 static_cast<unsigned long long>(r.fill.count()), r.clients);
    text += line("wasted %.1f %% of the bytes; busy %llu; fairness %.3f (Jain), %.3f (min/max)\n",
                 100 * share(r.wasted_bytes, r.bytes), static_cast<unsigned long long>(r.busy),
                 r.fairness, r.fairness_min_max);
    text +=
        line("checked %llu, wrong %llu, refused %llu, hung %zu, disconnected %zu, unfilled %zu\n",
             static_cast<unsigned long long>(r.checked), static_cast<unsigned long long>(r.wrong),
             static_cast<unsigned long long>(r.refused), r.hung, r.disconnected, r.unfilled);
    text += line("the load itself took %.1f s of processor time\n", r.cpu_seconds);
    for (const std::string& note : r.notes) {
        text += note + "\n";
    }
    return text;
}

}  // namespace terrane
