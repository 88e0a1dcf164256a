// Figures 1, 6 and 7 of the paper: slices and pictures of the shipped worlds.
#pragma once

#include "protocol/base/result.h"
#include "server/report/page.h"
#include "server/report/report_options.h"

namespace terrane {

Result<void> write_figures(Page& page, const ReportOptions& options);

}  // namespace terrane
