// The whole report, measured and put together.
#pragma once

#include "protocol/base/result.h"
#include "server/report/page.h"
#include "server/report/report_options.h"

#include <functional>
#include <string>

namespace terrane {

/// Measures everything; `say` is told what is being measured. Takes the machine as it is: for times
/// that mean something nothing else should run on it.
Result<Page> make_report(const ReportOptions& options,
                         const std::function<void(const std::string&)>& say);

}  // namespace terrane
