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
    std::string eye;
    std::string look;
    std::string size = "1280,720";
    double field_of_view = 55;
    std::string block;
    std::string out;
};

int wrong_use(const Error& error) {
    std::fprintf(stderr, "terrane: picture: %s\n", error.message.c_str());
    return kExitWrongUse;
}

/// The view that the options ask for, but for a block.
Result<PictureView> view_of(const PictureOptions& options) {
    constexpr double kFarthest = 9e15;
    std::array<double, 3> eye{};
    std::array<double, 3> look{};
    std::array<std::int64_t, 2> size{};
    const auto named = [](const char* flag) {
        return [flag](const Error& error) {
            return Error{.code = error.code, .message = flag + (" " + error.message)};
        };
    };
    return parse_numbers(eye, options.eye, -kFarthest, kFarthest)
        .map_error(named("--eye"))
        .and_then([&] {
            return parse_numbers(look, options.look, -kFarthest, kFarthest)
                .map_error(named("--look"));
        })
        .and_then([&] {
            return parse_integers(size, options.size, {.least = 1, .most = kImageSideMax})
                .map_error(named("--size"));
        })
        .map([&] {
            return PictureView{.eye = {eye[0], eye[1], eye[2]},
                               .look = {look[0], look[1], look[2]},
                               .width = static_cast<std::int32_t>(size[0]),
                               .height = static_cast<std::int32_t>(size[1]),
                               .field_of_view = options.field_of_view,
                               .block = {}};
        });
}

int run_picture(const PictureOptions& options) {
    const auto asked = view_of(options);
    if (!asked) {
        return wrong_use(asked.error());
    }
    PictureView view = *asked;
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
    picture->add_option("--world", options->world, "World file")->required();
    picture->add_option("--eye", options->eye, "Where to stand, voxels; Y is up")
        ->type_name("X,Y,Z")
        ->required();
    picture->add_option("--look", options->look, "What to look at")->type_name("X,Y,Z")->required();
    picture->add_option("--size", options->size, "Pixels; at most 33,554,432 in all")
        ->type_name("W,H")
        ->capture_default_str();
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
