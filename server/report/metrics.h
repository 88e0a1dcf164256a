// The paper's nine metrics (section 2.1), each with what can be computed for it.
#pragma once

#include "protocol/base/result.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/speed.h"

namespace terrane {

/// Distances between terrains of different seeds.
Result<void> write_innovation(Page& page, const ReportOptions& options);
/// How layers hold together, against Perlin noise and white noise.
Result<void> write_structure(Page& page, const ReportOptions& options);
/// Caves one can walk into, and how far it is to the next vein.
Result<void> write_interest(Page& page, const ReportOptions& options);
/// Levels of detail.
Result<void> write_scalability(Page& page, const ReportOptions& options);
/// Every parameter swept.
Result<void> write_control(Page& page, const ReportOptions& options);

/// All nine, in the paper's order.
Result<void> write_metrics(Page& page, const SpeedTable& speed, const ReportOptions& options);

}  // namespace terrane
