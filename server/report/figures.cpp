#include "server/report/figures.h"

#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "server/render/render_picture.h"
#include "server/render/section.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/shipped_world.h"

#include <array>
#include <cstdint>
#include <string>

namespace terrane {
namespace {

struct SliceFigure {
    const char* world;
    std::int64_t from_x;
    std::int64_t to_x;
    std::int64_t z;
    std::int32_t scale;
    const char* caption;
};

constexpr std::array<SliceFigure, 4> kSlices = {{
    {"paper-B3", -60, 59, 0, 8,
     "paper-B3: six regular materials, two veins and a cave (caves are black)"},
    {"basin", -300, 299, 40, 2,
     "basin: bands that keep the folds of the basement, ever more gently"},
    {"ore-mountain", -400, 399, 0, 1, "ore-mountain: steep folds with veins between the strata"},
    {"fantasy", -200, 199, 0, 3, "fantasy: layers that pinch out, swell and blend; wide caverns"},
}};

struct PictureFigure {
    const char* name;
    const char* world;
    glm::dvec3 eye;
    glm::dvec3 look;
    double field_of_view;
    std::int64_t block;  ///< side of a block around (0, 0), or 0
    const char* caption;
};

const std::array<PictureFigure, 4> kPictures = {{
    {"fantasy-block",
     "fantasy",
     {-265, 365, -355},
     {0, 52, 0},
     55,
     256,
     "fantasy, a block of 256 × 256 columns cut out"},
    {"paper-B3-block",
     "paper-B3",
     {-86, 94, -114},
     {0, 14, 0},
     50,
     80,
     "paper-B3, 80 × 80 columns: the paper's own kind of terrain"},
    {"ore-mountain",
     "ore-mountain",
     {0, 520, 0},
     {500, 330, 420},
     60,
     0,
     "ore-mountain, to the horizon"},
    {"basin", "basin", {0, 215, 0}, {400, 165, 300}, 60, 0, "basin, to the horizon"},
}};

Result<void> add_picture(Page& page, const PictureFigure& figure, const ReportOptions& options) {
    const auto world = World::build(shipped_definition(figure.world));
    if (!world) {
        return tl::unexpected(world.error());
    }
    PictureView view{.eye = figure.eye,
                     .look = figure.look,
                     .width = options.picture_width,
                     .height = options.picture_height,
                     .field_of_view = figure.field_of_view,
                     .block = {}};
    if (figure.block > 0) {
        view.block = {.x_first = -figure.block / 2,
                      .z_first = -figure.block / 2,
                      .x_end = figure.block / 2,
                      .z_end = figure.block / 2};
    }
    return render_picture(*world, view, options.threads)
        .and_then([](const Image& image) { return encode_png(image); })
        .map([&](const Bytes& png) {
            page.picture(std::string("picture-") + figure.name, png, figure.caption);
        });
}

}  // namespace

Result<void> write_figures(Page& page, const ReportOptions& options) {
    page.heading("Figures 6 and 7: slices and pictures");
    page.paragraph(
        "Figure 6 of the paper sets slices of real ground beside its own. These are "
        "ours; like the paper's they are stacked, folded and wedged, and like the "
        "paper's they have no faults. Drawn by <code>terrane slice</code>.");
    page.begin_row();
    for (const SliceFigure& figure : kSlices) {
        const auto world = World::build(shipped_definition(figure.world));
        if (!world) {
            return tl::unexpected(world.error());
        }
        StackGenerator generator(*world);
        const auto png = draw_section({.world = &*world, .generator = &generator},
                                      {.from = {.x = figure.from_x, .z = figure.z},
                                       .to = {.x = figure.to_x, .z = figure.z},
                                       .scale = figure.scale})
                             .and_then([](const Image& image) { return encode_png(image); });
        if (!png) {
            return tl::unexpected(png.error());
        }
        page.picture(std::string("slice-") + figure.world, *png, figure.caption);
    }
    page.end_row();
    page.paragraph(
        "Figure 7 shows terrains in three dimensions. Drawn by <code>terrane "
        "picture</code>: rays through the limits themselves, sun and shadows; no mesh.");
    page.begin_row();
    for (const PictureFigure& figure : kPictures) {
        if (auto done = add_picture(page, figure, options); !done) {
            return done;
        }
    }
    page.end_row();
    return {};
}

}  // namespace terrane
