// The paper's claim O(n^2 m), measured: time against side, depth and number of layers, next to
// voxel methods.
#pragma once

#include "protocol/base/result.h"
#include "server/report/page.h"
#include "server/report/report_options.h"

namespace terrane {

Result<void> write_complexity(Page& page, const ReportOptions& options);

}  // namespace terrane
