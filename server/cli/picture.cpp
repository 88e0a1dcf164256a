// terrane picture: the terrain as seen from somewhere.
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "protocol/base/write_file.h"
#include "server/cli/arguments.h"
#include "server/cli/open_world.h"
#include "server/cli/program.h"
#include "server/cli/progress.h"
#include "server/render/png.h"
#include "server/render/render_picture.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>

namespace terrane {
namespace {

struct PictureOptions {
    std::string world;
    std::array<double, 3> eye{};
    std::array<double, 3> look{};
    std::array<std::int32_t, 2> size = {1280, 720};
    double field_of_view = 55;
    std::string block;
    std::string out;
};

int wrong_use(const Error& error) {
    std::fprintf(stderr, "terrane: picture: %s\n", error.message.c_str());
    return kExitWrongUse;
}

int run_picture(const PictureOptions& options) {
    PictureView view{.eye = {options.eye[0], options.eye[1], options.eye[2]},
                     .look = {options.look[0], options.look[1], options.look[2]},
                     .width = options.size[0],
                     .height = options.size[1],
                     .field_of_view = options.field_of_view,
                     .block = {}};
    if (!options.block.empty()) {
        std::array<std::int64_t, 4> sides{};
        if (const auto parsed = parse_integers(sides, options.block, kColumnBounds); !parsed) {
            return wrong_use(parsed.error());
        }
        view.block = {
            .x_first = sides[0], .z_first = sides[1], .x_end = sides[2], .z_end = sides[3]};
    }
    const auto world = open_world(options.world);
    if (!world) {
        return kExitWrongUse;
    }
    const auto threads =
        static_cast<std::int32_t>(std::max(1U, std::thread::hardware_concurrency()));
    ShownProgress progress("rows");
    const auto image = render_picture(*world, view, threads, progress.teller());
    progress.finish();
    if (!image) {
        return wrong_use(image.error());
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

void add_picture_command(CLI::App& app, int& exit_code) {
    const auto options = std::make_shared<PictureOptions>();
    CLI::App* picture = app.add_subcommand("picture", "Draw the terrain as seen from a place");
    const auto numbers = CLI::Range(-9e15, 9e15);
    picture->add_option("--world", options->world, "World file")->required();
    picture->add_option("--eye", options->eye, "Where to stand, voxels: X,Y,Z; Y is up")
        ->delimiter(',')
        ->required()
        ->check(numbers);
    picture->add_option("--look", options->look, "What to look at: X,Y,Z")
        ->delimiter(',')
        ->required()
        ->check(numbers);
    picture->add_option("--size", options->size, "Pixels: W,H; 1280,720 if absent")
        ->delimiter(',')
        ->check(CLI::Range(std::int64_t{1}, kImageSideMax));
    picture->add_option("--fov", options->field_of_view, "Degrees along the longer side")
        ->check(CLI::Range(1.0, 150.0))
        ->capture_default_str();
    picture->add_option("--block", options->block,
                        "Draw only columns X0,Z0,X1,Z1 (last excluded), cut out, strata showing");
    picture->add_option("-o,--out", options->out, "PNG file to write")->required();
    picture->footer(
        "Write negative numbers after an equals sign: --eye=-300,90,0.\n"
        "Exit code: 0 done, 1 the file cannot be written, 2 a bad world file, place or size.\n"
        "Example: terrane picture --world generator/worlds/fantasy.toml --eye 0,260,0 --look "
        "400,150,300 -o view.png");
    picture->callback([options, &exit_code] { exit_code = run_picture(*options); });
}

}  // namespace terrane
