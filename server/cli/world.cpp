// terrane world check|show|init: for the designer of a world file.
#include "server/cli/example_world.h"
#include "server/cli/open_world.h"
#include "server/cli/program.h"
#include "server/cli/world_report.h"

#include <CLI/CLI.hpp>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>

namespace terrane {
namespace {

int run_check(const std::string& path) {
    const auto world = open_world(path);
    if (!world) {
        return kExitWrongUse;
    }
    std::printf("%s: a good world, %zu materials in %zu layers\n", path.c_str(),
                world->definition.materials.size(), world->stack.layers.size());
    return kExitDone;
}

int run_show(const std::string& path, bool as_json) {
    const auto world = open_world(path);
    if (!world) {
        return kExitWrongUse;
    }
    const std::string report = as_json ? world_report_json(*world) : world_report_text(*world);
    std::fputs(report.c_str(), stdout);
    return kExitDone;
}

/// "x": fails if the file is there already, so that nobody's work is overwritten.
int run_init(const std::string& path) {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "wbx"),
                                                               &std::fclose);
    if (!file) {
        std::fprintf(stderr, "terrane: %s cannot be made: %s\n", path.c_str(),
                     std::strerror(errno));
        return kExitFailed;
    }
    const std::string_view text = example_world();
    if (std::fwrite(text.data(), 1, text.size(), file.get()) != text.size() ||
        std::fflush(file.get()) != 0) {
        std::fprintf(stderr, "terrane: %s cannot be written: %s\n", path.c_str(),
                     std::strerror(errno));
        return kExitFailed;
    }
    std::printf("%s: written; now try: terrane world show %s\n", path.c_str(), path.c_str());
    return kExitDone;
}

}  // namespace

void add_world_command(CLI::App& app, int& exit_code) {
    struct Options {
        std::string path;
        bool as_json = false;
    };

    const auto options = std::make_shared<Options>();
    CLI::App* world = app.add_subcommand("world", "Check, show or begin a world file");
    world->require_subcommand(1);
    world->footer(
        "A world file is TOML: general parameters, a grid, materials and how they go together.\n"
        "Examples:\n"
        "  terrane world init my.toml          begin with a commented example\n"
        "  terrane world check my.toml         every fault with file:line:column, exit code 2\n"
        "  terrane world show my.toml          the layers it gives");

    CLI::App* check = world->add_subcommand("check", "Say everything that is wrong with a world");
    check->add_option("FILE", options->path, "World file")->required();
    check->footer(
        "Faults go to stderr, one a line: file:line:column: key: what is wrong; what is allowed.\n"
        "Exit code: 0 a good world, 2 faults or a file that cannot be read.\n"
        "Example: terrane world check generator/worlds/basin.toml");
    check->callback([options, &exit_code] { exit_code = run_check(options->path); });

    CLI::App* show = world->add_subcommand("show", "Print the layers that a world gives");
    show->add_option("FILE", options->path, "World file")->required();
    show->add_flag("--json", options->as_json, "One JSON object, layers bottom first");
    show->footer(
        "Examples:\n"
        "  terrane world show generator/worlds/basin.toml\n"
        "  terrane world show --json my.toml | jq -r .fingerprint");
    show->callback(
        [options, &exit_code] { exit_code = run_show(options->path, options->as_json); });

    CLI::App* init = world->add_subcommand("init", "Write a commented example to begin with");
    init->add_option("FILE", options->path, "File to make; an existing one is left alone")
        ->required();
    init->footer("Example: terrane world init my.toml");
    init->callback([options, &exit_code] { exit_code = run_init(options->path); });
}

}  // namespace terrane
