// What the paper leaves open and landscapes add: folds, faults, rivers, caves, each measured.
#pragma once

#include "protocol/base/result.h"
#include "server/report/page.h"
#include "server/report/report_options.h"

namespace terrane {

/// The chapter "Beyond the paper": the six shipped landscapes.
Result<void> write_beyond(Page& page, const ReportOptions& options);

}  // namespace terrane
