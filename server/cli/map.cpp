// terrane map: the world seen from above.
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "protocol/base/write_file.h"
#include "server/cli/arguments.h"
#include "server/cli/open_world.h"
#include "server/cli/program.h"
#include "server/cli/progress.h"
#include "server/render/map_tile.h"

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

/// The longer side when nobody says how many columns a pixel is.
constexpr std::int64_t kGoodPixels = 2048;

struct MapOptions {
    std::string world;
    std::string rectangle;
    std::int32_t lod = -1;
    std::string out;
};

int wrong_use(const Error& error) {
    std::fprintf(stderr, "terrane: map: %s\n", error.message.c_str());
    return kExitWrongUse;
}

Result<MapArea> area_of(const MapOptions& options) {
    std::array<std::int64_t, 4> sides{};
    if (auto parsed = parse_integers(sides, options.rectangle, kColumnBounds); !parsed) {
        return tl::unexpected(parsed.error());
    }
    const std::int64_t width = sides[2] - sides[0];
    const std::int64_t length = sides[3] - sides[1];
    if (width < 1 || length < 1) {
        return fail(ErrorCode::invalid_argument,
                    "--rect " + options.rectangle + " is empty: the last column is excluded");
    }
    MapArea area{.first = {.x = sides[0], .z = sides[1]}, .lod = std::max(0, options.lod)};
    while (options.lod < 0 && area.lod < kMapZoomMax &&
           std::max(width, length) >> area.lod > kGoodPixels) {
        ++area.lod;
    }
    const std::int64_t pixels_wide = std::max<std::int64_t>(1, width >> area.lod);
    const std::int64_t pixels_high = std::max<std::int64_t>(1, length >> area.lod);
    if (std::max(pixels_wide, pixels_high) > kImageSideMax) {
        return fail(ErrorCode::too_large, "--rect " + options.rectangle +
                                              " is too large for one picture at level " +
                                              std::to_string(area.lod));
    }
    area.width = static_cast<std::int32_t>(pixels_wide);
    area.height = static_cast<std::int32_t>(pixels_high);
    return area;
}

int run_map(const MapOptions& options) {
    const auto area = area_of(options);
    if (!area) {
        return wrong_use(area.error());
    }
    const auto world = open_world(options.world);
    if (!world) {
        return kExitWrongUse;
    }
    const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
    ShownProgress progress("blocks");
    const auto image = draw_map(*world, *area, static_cast<std::int32_t>(cores), progress.teller());
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
    std::fprintf(stderr, "%s: %d x %d pixels, %lld columns a pixel\n", options.out.c_str(),
                 image->width, image->height, 1LL << area->lod);
    return kExitDone;
}

}  // namespace

void add_map_command(CLI::App& app, int& exit_code) {
    const auto options = std::make_shared<MapOptions>();
    CLI::App* map = app.add_subcommand("map", "Draw a hill-shaded map of an area");
    map->add_option("--world", options->world, "World file")->required();
    map->add_option("--rect", options->rectangle,
                    "Columns X0,Z0,X1,Z1, last excluded; north (-z) is up")
        ->required();
    map->add_option("--lod", options->lod,
                    "A pixel is 2^LOD columns a side; chosen to fit a screen if absent")
        ->check(CLI::Range(0, kMapZoomMax));
    map->add_option("-o,--out", options->out, "PNG file to write")->required();
    map->footer(
        "The colours are those of what lies on top, mixed by composition; the light comes from "
        "the\n"
        "north west. Write a negative rectangle after an equals sign.\n"
        "Exit code: 0 done, 1 the file cannot be written, 2 a bad world file, area or size.\n"
        "Example: terrane map --world generator/worlds/basin.toml --rect=-512,-512,512,512 -o "
        "map.png");
    map->callback([options, &exit_code] { exit_code = run_map(*options); });
}

}  // namespace terrane
