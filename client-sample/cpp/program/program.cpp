#include "client-sample/cpp/program/program.h"

#include "client-sample/cpp/program/load.h"
#include "client-sample/cpp/program/view.h"
#include "protocol/base/command_line.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

namespace terrane {

namespace {

/// CLI11 takes "-1,0,5" for a flag named 1. Joined to its option as "--at=-1,0,5" it is a value.
std::vector<std::string> joined_arguments(int argc, const char* const* argv) {
    std::vector<std::string> arguments;
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        const bool is_negative =
            argument.size() > 1 && argument[0] == '-' && argument[1] >= '0' && argument[1] <= '9';
        if (is_negative && !arguments.empty() &&
            (arguments.back() == "--at" || arguments.back() == "--lod" ||
             arguments.back() == "--eye" || arguments.back() == "--look")) {
            arguments.back() += "=" + argument;
        } else {
            arguments.push_back(argument);
        }
    }
    return arguments;
}

}  // namespace

int run_client_program(int argc, const char* const* argv) {
    int exit_code = kClientDone;
    try {
        CLI::App app("A client of Terrane servers: fetches, draws, and puts on load.",
                     "terrane-client");
        app.require_subcommand(1);
        app.set_version_flag("--version", TERRANE_VERSION);
        app.footer("Try: terrane-client get --help, load --help, view --help");
        add_get_command(app, exit_code);
        add_load_command(app, exit_code);
        add_view_command(app, exit_code);
        auto arguments = joined_arguments(argc, argv);
        if (const auto slip = unknown_subcommand(app, arguments)) {
            std::fprintf(stderr, "terrane-client: %s\n", slip->c_str());
            return kClientWrongUse;
        }
        std::ranges::reverse(arguments);  // as CLI11 wants them
        try {
            app.parse(arguments);
        } catch (const CLI::ParseError& error) {
            return app.exit(error) == 0 ? kClientDone : kClientWrongUse;
        }
    } catch (const std::exception& error) {
        std::fprintf(stderr, "terrane-client: %s\n", error.what());
        return kClientFailed;
    }
    return exit_code == kClientDone && !output_is_whole() ? kClientFailed : exit_code;
}

}  // namespace terrane
