#include "server/cli/program.h"

#include "generator/terrain/kernels/kernel_choice.h"
#include "protocol/base/command_line.h"

#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>

namespace terrane {

int run_program(int argc, char** argv) {
    CLI::App app("Terrane makes volumetric terrain on request and streams it.", "terrane");
    app.require_subcommand(1);
    app.set_version_flag("--version", TERRANE_VERSION);
    app.set_help_all_flag("--help-all", "Print the help of every subcommand");
    if (const auto kernels = kernel_set_from_environment(); !kernels) {
        std::fprintf(stderr, "terrane: %s\n", kernels.error().message.c_str());
        return kExitWrongUse;
    }
    int exit_code = kExitDone;
    add_preseed_command(app, exit_code);
    add_serve_command(app, exit_code);
    add_token_command(app, exit_code);
    add_verify_command(app, exit_code);
    add_world_command(app, exit_code);
    add_column_command(app, exit_code);
    add_map_command(app, exit_code);
    add_slice_command(app, exit_code);
    add_picture_command(app, exit_code);
    add_report_command(app, exit_code);
    if (const auto slip = unknown_subcommand(app, {argv + 1, argv + argc})) {
        std::fprintf(stderr, "terrane: %s\n", slip->c_str());
        return kExitWrongUse;
    }
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? kExitDone : kExitWrongUse;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "terrane: %s\n", error.what());
        return kExitFailed;
    }
    return exit_code == kExitDone && !output_is_whole() ? kExitFailed : exit_code;
}

}  // namespace terrane
