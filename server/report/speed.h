// Tables 2 and 3 and figures 4 and 5 of the paper: how long terrains take, and how large they are.
#pragma once

#include "protocol/base/result.h"
#include "server/report/numbers.h"
#include "server/report/page.h"
#include "server/report/report_options.h"

#include <string>
#include <vector>

namespace terrane {

/// The paper's terrain: 5 x 5 x 5 chunks of 10 x 10 x 10 voxels.
inline constexpr std::int32_t kPaperSide = 50;
inline constexpr std::int64_t kPaperVoxels = 125000;

/// One configuration over all its terrains. Times in milliseconds.
struct ConfigurationSpeed {
    std::string name;  ///< "A0"
    Summary offline;   ///< world built from its definition and the origin plot generated
    Summary online;    ///< a plot beside it generated
    Summary chunked;   ///< the same plot as the server makes it: 25 stacks, cut into 125 chunks
    Summary layers;
    Summary elements;        ///< veins and caves of the origin plot
    Summary limits_whole;    ///< of whole columns
    Summary limits_chunked;  ///< each chunk's limits counted for itself
    Summary bytes_whole;     ///< of those columns as the codec writes them, flow included
    Summary bytes_no_flow;
};

struct SpeedTable {
    std::vector<ConfigurationSpeed> configurations;
    Summary perlin;        ///< the paper's PN: table of permutations, double, voxel by voxel
    Summary tuned_perlin;  ///< rows, floats, vectors
};

/// Measures everything interleaved: terrain by terrain, each configuration and both baselines.
Result<SpeedTable> measure_speed(const ReportOptions& options);

void write_speed(Page& page, const SpeedTable& table, const ReportOptions& options);
void write_size(Page& page, const SpeedTable& table);

}  // namespace terrane
