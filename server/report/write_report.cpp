#include "server/report/write_report.h"

#include "protocol/base/result.h"
#include "server/report/beyond.h"
#include "server/report/complexity.h"
#include "server/report/figures.h"
#include "server/report/metrics.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/speed.h"

#include <functional>
#include <string>

namespace terrane {

Result<Page> make_report(const ReportOptions& options,
                         const std::function<void(const std::string&)>& say) {
    Page page;
    say("speed: " + std::to_string(options.terrains) + " terrains of eight configurations");
    const auto speed = measure_speed(options);
    if (!speed) {
        return tl::unexpected(speed.error());
    }
    write_speed(page, *speed, options);
    write_size(page, *speed);
    say("complexity");
    if (auto done = write_complexity(page, options); !done) {
        return tl::unexpected(done.error());
    }
    say("the nine metrics");
    if (auto done = write_metrics(page, *speed, options); !done) {
        return tl::unexpected(done.error());
    }
    say("slices and pictures");
    if (auto done = write_figures(page, options); !done) {
        return tl::unexpected(done.error());
    }
    say("beyond the paper");
    if (auto done = write_beyond(page, options); !done) {
        return tl::unexpected(done.error());
    }
    return page;
}

}  // namespace terrane
