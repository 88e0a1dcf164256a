// A viewer that flies through a world by the client library, and what it saw of its view: how long
// each chunk took from being wanted to being there, and what came though it was not wanted any
// more.
#pragma once

#include "server/net/view.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace terrane::bench {

using Clock = std::chrono::steady_clock;

struct Place {
    double x = 0;
    double y = 200;
    double z = 0;
    double velocity_x = 0;  ///< voxels a second
    double velocity_z = 0;
};

struct FlightPlan {
    std::uint16_t port = 0;
    std::string name = "viewer";
    ViewWorld world;
    std::vector<std::uint32_t> radii = {16, 16, 16, 16, 16, 16};
    std::function<Place(double)> place;  ///< seconds since the start
    double seconds = 10;
    double updates_per_second = 20;
    double read_bytes_per_second = 0;  ///< 0: as fast as it comes; else it pauses after a chunk
    std::atomic<std::uint64_t>* received_bytes = nullptr;  ///< counted on, for who looks meanwhile
    std::function<void()> connected = {};                  ///< called then; may wait for others
    bool until_complete = false;  ///< end when nothing of the view is missing
    double settle_seconds = 0;    ///< what was wanted before gives no times
};

struct FlightFigures {
    std::vector<double> near_ms;    ///< wanted in the near ring to there; each chunk not there yet
    std::vector<double> wanted_ms;  ///< wanted at all to there
    std::uint64_t near_missed = 0;  ///< left the near ring before they came
    std::uint64_t chunks = 0;
    std::uint64_t payload_bytes = 0;
    std::uint64_t largest_payload_bytes = 0;
    std::uint64_t out_of_view_bytes = 0;  ///< came though the last view sent had them no more
    std::uint64_t twice = 0;              ///< came though they were there
    std::uint64_t updates = 0;
    std::uint64_t underfoot_missing =
        0;                       ///< updates at which a chunk of the own stack was not there
    double first_ground_ms = 0;  ///< until the whole own stack was there
    double complete_ms = 0;      ///< until nothing of the view was missing; 0: never
    std::string error;           ///< empty: it went to its end
};

FlightFigures fly(const FlightPlan& plan);

/// 0 of none.
double percentile(std::vector<double> values, double part);

}  // namespace terrane::bench
