// What `terrane-client load` found, for people and as JSON.
#pragma once

#include "client-sample/cpp/program/latency_counts.h"
#include "client-sample/cpp/program/load_client.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace terrane {

/// Sums over all clients.
struct LoadResult {
    std::size_t clients = 0;
    double seconds = 0;  ///< from the first connection to the last goodbye
    std::uint64_t chunks = 0;
    std::uint64_t bytes = 0;
    std::uint64_t wasted_chunks = 0;
    std::uint64_t wasted_bytes = 0;
    std::uint64_t forgotten = 0;
    std::uint64_t triangles = 0;
    std::uint64_t busy = 0;
    std::uint64_t refused = 0;
    std::uint64_t checked = 0;
    std::uint64_t wrong = 0;         ///< differ from local generation, or do not decode
    std::size_t hung = 0;            ///< clients that wanted and heard nothing for the patience
    std::size_t disconnected = 0;    ///< could not connect, or were cut off
    std::size_t unfilled = 0;        ///< still got chunks when the load ended
    LatencyCounts latency;           ///< wanted to decoded
    LatencyCounts fill;              ///< of clients whose view was filled
    double cpu_seconds = 0;          ///< of the load itself: at one a second it measures itself
    double fairness = 1;             ///< Jain's index of the clients' rates
    double fairness_min_max = 1;     ///< the slowest client's rate over the fastest's
    std::vector<std::string> notes;  ///< what was wrong, first of each kind

    bool is_good() const { return wrong == 0 && hung == 0 && disconnected == 0 && refused == 0; }
};

/// Adds one client's counts.
void add(LoadResult& result, const LoadCounts& counts);

/// Jain's index, (sum x)^2 / (n sum x^2): 1 when all are equal, 1/n when one has all. 1 for nobody.
double jain_index(std::span<const double> rates);

/// Where a client stood when the last client had come: from then on all compete.
struct LoadStart {
    std::uint64_t chunks = 0;
    std::chrono::microseconds wanting{};
};

/// Chunks that a client got a second from then on until its first view was whole, or as long as it
/// wanted any if that never was: what fairness is about. Nothing if its view was whole before, for
/// it did not compete: later a client wants little, and its rate says nothing.
std::optional<double> rate_of(const LoadCounts& counts, const LoadStart& start);

std::string load_json(const LoadResult& result);
std::string load_text(const LoadResult& result);

}  // namespace terrane
