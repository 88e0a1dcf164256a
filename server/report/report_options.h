// How much a report measures: everything, or enough to look at in under a minute.
#pragma once

#include <cstdint>

namespace terrane {

struct ReportOptions {
    std::int32_t terrains = 100;  ///< of each configuration, the paper's number
    std::int32_t repeats = 15;    ///< of each point of the complexity charts; their median counts
    std::int32_t seeds = 24;      ///< of each value of a swept parameter
    std::int32_t region_columns = 512;  ///< side of the region searched for caves and veins
    std::int32_t picture_width = 1280;
    std::int32_t picture_height = 720;
    std::int32_t threads = 1;
};

constexpr ReportOptions quick_report() {
    return {.terrains = 30,
            .repeats = 5,
            .seeds = 6,
            .region_columns = 256,
            .picture_width = 480,
            .picture_height = 270,
            .threads = 1};
}

}  // namespace terrane
