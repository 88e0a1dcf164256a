// terrane slice: a picture of a vertical cut.
#include "generator/terrain/generate_stack.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "protocol/base/write_file.h"
#include "server/cli/arguments.h"
#include "server/cli/open_world.h"
#include "server/cli/program.h"
#include "server/render/png.h"
#include "server/render/section.h"

#include <CLI/CLI.hpp>

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

namespace terrane {
namespace {

struct SliceOptions {
    std::string world;
    std::string from;
    std::string to;
    std::int32_t scale = 0;
    std::int32_t height = 0;
    std::string out;
};

int wrong_use(const char* flag, const Error& error) {
    std::fprintf(stderr, "terrane: %s: %s\n", flag, error.message.c_str());
    return kExitWrongUse;
}

int run_slice(const SliceOptions& options) {
    const auto from = parse_column(options.from);
    if (!from) {
        return wrong_use("--from", from.error());
    }
    const auto to = parse_column(options.to);
    if (!to) {
        return wrong_use("--to", to.error());
    }
    const auto world = open_world(options.world);
    if (!world) {
        return kExitWrongUse;
    }
    StackGenerator generator(*world);
    const auto image = draw_section(
        {.world = &*world, .generator = &generator},
        {.from = *from, .to = *to, .height_voxels = options.height, .scale = options.scale});
    if (!image) {
        return wrong_use("slice", image.error());
    }
    auto written = encode_png(*image).and_then(
        [&](const Bytes& bytes) { return write_file(options.out, bytes); });
    if (!written) {
        std::fprintf(stderr, "terrane: %s\n", written.error().message.c_str());
        return kExitFailed;
    }
    std::fprintf(stderr, "%s: %d x %d pixels\n", options.out.c_str(), image->width, image->height);
    return kExitDone;
}

}  // namespace

void add_slice_command(CLI::App& app, int& exit_code) {
    const auto options = std::make_shared<SliceOptions>();
    CLI::App* slice = app.add_subcommand("slice", "Draw a vertical cut through the terrain");
    slice->add_option("--world", options->world, "World file")->required();
    slice->add_option("--from", options->from, "Column X,Z at the left end; may be negative")
        ->required();
    slice->add_option("--to", options->to, "Column X,Z at the right end, included")->required();
    slice->add_option("--scale", options->scale, "Pixels a voxel; chosen to fit a screen if absent")
        ->check(CLI::Range(1, kSectionScaleMax));
    slice->add_option("--height", options->height, "Voxels from y = 0 up; all there is if absent")
        ->check(CLI::Range(std::int64_t{1}, kSectionHeightMax));
    slice->add_option("-o,--out", options->out, "PNG file to write")->required();
    slice->footer(
        "Colours are mixed by composition; blends are smooth, veins bright, caves dark.\n"
        "Exit code: 0 done, 1 the file cannot be written, 2 a bad world file, line or size.\n"
        "Example: terrane slice --world generator/worlds/basin.toml --from -200,0 --to 199,0 -o "
        "cut.png");
    slice->callback([options, &exit_code] { exit_code = run_slice(*options); });
}

}  // namespace terrane
