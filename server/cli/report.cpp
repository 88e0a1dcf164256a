// terrane report: the paper's tables and figures beside ours, on this machine.
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "protocol/base/write_file.h"
#include "server/cli/program.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/stopwatch.h"
#include "server/report/write_report.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <thread>

namespace terrane {
namespace {

struct ReportCommand {
    std::string out;
    bool quick = false;
};

Result<void> make_folder(const std::filesystem::path& folder) {
    std::error_code refused;
    std::filesystem::create_directories(folder, refused);
    if (refused) {
        return fail(ErrorCode::io_error, folder.string() + ": " + refused.message());
    }
    return {};
}

Result<void> write_all(const Page& page, const std::filesystem::path& folder) {
    for (const ReportFile& file : page.pictures()) {
        if (auto written = write_file(folder / file.name, file.bytes); !written) {
            return written;
        }
    }
    return write_file(folder / "report.csv", bytes_of(page.csv())).and_then([&] {
        return write_file(folder / "report.html", bytes_of(page.html()));
    });
}

int run_report(const ReportCommand& command) {
    const Stopwatch watch;
    ReportOptions options = command.quick ? quick_report() : ReportOptions{};
    options.threads = static_cast<std::int32_t>(std::max(1U, std::thread::hardware_concurrency()));
    // First, so that nobody waits for what then has no place to go.
    const auto page = make_folder(command.out).and_then([&] {
        return make_report(options, [&](const std::string& what) {
            std::fprintf(stderr, "%6.1f s  %s\n", watch.milliseconds() / 1000, what.c_str());
        });
    });
    auto written = page ? write_all(*page, command.out) : tl::unexpected(page.error());
    if (!written) {
        std::fprintf(stderr, "terrane: %s\n", written.error().message.c_str());
        return kExitFailed;
    }
    std::fprintf(stderr, "%6.1f s  wrote %s\n", watch.milliseconds() / 1000,
                 (std::filesystem::path(command.out) / "report.html").c_str());
    return kExitDone;
}

}  // namespace

void add_report_command(CLI::App& app, int& exit_code) {
    const auto options = std::make_shared<ReportCommand>();
    CLI::App* report =
        app.add_subcommand("report", "Measure the paper's tables and figures on this machine");
    report->add_option("-o,--out", options->out, "Folder for report.html, report.csv and pictures")
        ->required();
    report->add_flag("--quick", options->quick, "Fewer terrains, smaller pictures: under a minute");
    report->footer(
        "Times are this machine's: let nothing else run, and compare ratios.\n"
        "Exit code: 0 done, 1 the folder cannot be written.\n"
        "Example: terrane report -o report --quick");
    report->callback([options, &exit_code] { exit_code = run_report(*options); });
}

}  // namespace terrane
