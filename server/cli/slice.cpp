#include "server/cli/slice.h"

#include "generator/terrain/generate_stack.h"
#include "generator/volume/color.h"
#include "protocol/base/write_file.h"
#include "server/cli/arguments.h"
#include "server/cli/open_world.h"
#include "server/cli/program.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <span>
#include <string>

namespace terrane {
namespace {

// What a picture is to fit in when nobody says: most of a full-HD screen.
constexpr std::int64_t kGoodWidth = 1600;
constexpr std::int64_t kGoodHeight = 900;
constexpr std::int64_t kGoodScaleMax = 12;

constexpr Rgb8 kSkyAtTop = {.r = 118, .g = 170, .b = 222};
constexpr Rgb8 kSkyAtGround = {.r = 226, .g = 238, .b = 246};
// Caves are dark but for a glimmer on the floor, which tells them from black rock.
constexpr Rgb8 kCaveFloor = {.r = 66, .g = 56, .b = 72};
constexpr Rgb8 kCaveDark = {.r = 13, .g = 10, .b = 17};

/// A limit with what it looks like.
struct SeenLimit {
    std::int32_t y256 = 0;
    PaletteKind kind = PaletteKind::layer;
    LinearColor color;
};

using SeenColumn = std::vector<SeenLimit>;

LinearColor mix(LinearColor a, LinearColor b, float share) {
    return {.r = a.r + (b.r - a.r) * share,
            .g = a.g + (b.g - a.g) * share,
            .b = a.b + (b.b - a.b) * share};
}

/// Part of a line's columns, and the rectangle around them that is generated at once.
struct LinePart {
    std::size_t first = 0;
    std::size_t end = 0;
    ColumnRectangle box;
};

ColumnRectangle box_around(ColumnPos a, ColumnPos b) {
    return {.x0 = std::min(a.x, b.x),
            .z0 = std::min(a.z, b.z),
            .width = static_cast<std::int32_t>(std::abs(a.x - b.x)) + 1,
            .length = static_cast<std::int32_t>(std::abs(a.z - b.z)) + 1};
}

/// As many columns from `first` on as fit into a box that is not mostly of other columns: a
/// diagonal line needs one column of a row only.
LinePart part_from(std::span<const ColumnPos> columns, std::size_t first) {
    constexpr std::size_t kColumnsMax = 64;
    constexpr std::size_t kWasteMax = 16;
    LinePart part = {.first = first, .end = first, .box = {}};
    while (part.end < columns.size() && part.end - first < kColumnsMax) {
        const ColumnRectangle box = box_around(columns[first], columns[part.end]);
        const auto area =
            static_cast<std::size_t>(box.width) * static_cast<std::size_t>(box.length);
        if (area > kWasteMax * (part.end - first + 1)) {
            break;
        }
        part.box = box;
        ++part.end;
    }
    return part;
}

Result<std::vector<SeenColumn>> see_columns(const World& world,
                                            std::span<const ColumnPos> positions) {
    const std::span<const Material> materials = world.definition.materials;
    StackGenerator generator(world);
    ColumnSet set;
    std::vector<SeenColumn> seen;
    seen.reserve(positions.size());
    for (std::size_t first = 0; first < positions.size();) {
        const LinePart part = part_from(positions, first);
        if (const auto made = generator.generate(set, part.box); !made) {
            return tl::unexpected(made.error());
        }
        for (const ColumnPos at : positions.subspan(part.first, part.end - part.first)) {
            SeenColumn column;
            for (const Limit& limit :
                 set.columns.column(static_cast<std::int32_t>(at.x - part.box.x0),
                                    static_cast<std::int32_t>(at.z - part.box.z0))) {
                const PaletteEntry& entry = set.palette[limit.palette_id];
                column.push_back({.y256 = limit.y256,
                                  .kind = entry.kind,
                                  .color = color_of(entry.composition.shares(), materials)});
            }
            seen.push_back(std::move(column));
        }
        first = part.end;
    }
    return seen;
}

std::int64_t highest_voxel(std::span<const SeenColumn> columns) {
    std::int32_t highest = 0;
    for (const SeenColumn& column : columns) {
        highest = std::max(highest, column.back().y256);
    }
    return highest / kUnitsPerVoxel + 1;
}

/// Height of the picture in voxels: a sixth of the terrain's is sky.
std::int64_t picture_voxels(std::span<const SeenColumn> columns) {
    const std::int64_t terrain = highest_voxel(columns);
    return terrain + std::max<std::int64_t>(3, terrain / 6);
}

std::int64_t good_scale(std::int64_t columns, std::int64_t voxels) {
    return std::clamp<std::int64_t>(std::min(kGoodWidth / columns, kGoodHeight / voxels), 1,
                                    kGoodScaleMax);
}

/// The void, from light above the ground to blue at the picture's top.
std::vector<Rgb8> sky_rows(std::int32_t height) {
    std::vector<Rgb8> rows;
    for (std::int32_t row = 0; row < height; ++row) {
        // The terrain takes most of the height, so the gradient runs over the upper third.
        const float down = std::min(1.0F, static_cast<float>(row) * 3 / static_cast<float>(height));
        rows.push_back(srgb_from_linear(
            mix(linear_from_srgb(kSkyAtTop), linear_from_srgb(kSkyAtGround), down)));
    }
    return rows;
}

/// Draws one column, a pixel wide, bottom up.
void draw_column(Image& image, std::int32_t x, const SeenColumn& column, std::int32_t scale,
                 std::span<const Rgb8> sky) {
    std::size_t i = 0;
    for (std::int32_t up = 0; up < image.height; ++up) {
        const std::int32_t row = image.height - 1 - up;
        // The pixel's centre in 1/256 voxel.
        const std::int64_t y256 = (2 * std::int64_t{up} + 1) * kUnitsPerVoxel / (2 * scale);
        while (i + 1 < column.size() && column[i + 1].y256 <= y256) {
            ++i;
        }
        const SeenLimit& lo = column[i];
        if (lo.kind == PaletteKind::void_) {
            image.at(x, row) = sky[static_cast<std::size_t>(row)];
            continue;
        }
        const SeenLimit& hi = column[std::min(i + 1, column.size() - 1)];
        const float share = hi.y256 > lo.y256 ? static_cast<float>(y256 - lo.y256) /
                                                    static_cast<float>(hi.y256 - lo.y256)
                                              : 0.0F;
        const bool cave = lo.kind == PaletteKind::cave;
        image.at(x, row) =
            srgb_from_linear(cave ? mix(linear_from_srgb(kCaveFloor), linear_from_srgb(kCaveDark),
                                        std::min(1.0F, 2 * share))
                                  : mix(lo.color, hi.color, share));
    }
}

struct SliceOptions {
    std::string world;
    std::string from;
    std::string to;
    std::int32_t scale = 0;
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
    const auto image = draw_slice(*world, {.from = *from, .to = *to, .scale = options.scale});
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

std::vector<ColumnPos> columns_on(const SliceLine& line) {
    const std::int64_t dx = line.to.x - line.from.x;
    const std::int64_t dz = line.to.z - line.from.z;
    const std::int64_t steps = std::max(std::abs(dx), std::abs(dz));
    // i * d / steps to the nearest integer; the products fit, as there are few steps.
    const auto along = [steps](std::int64_t d, std::int64_t i) {
        return steps == 0 ? 0 : floor_div(2 * i * d + steps, 2 * steps);
    };
    std::vector<ColumnPos> columns;
    for (std::int64_t i = 0; i <= steps; ++i) {
        columns.push_back({.x = line.from.x + along(dx, i), .z = line.from.z + along(dz, i)});
    }
    return columns;
}

Result<Image> draw_slice(const World& world, const SliceLine& line) {
    const std::int64_t steps =
        std::max(std::abs(line.to.x - line.from.x), std::abs(line.to.z - line.from.z));
    if (steps >= kImageSideMax) {
        return fail(ErrorCode::too_large, "a line of " + std::to_string(steps + 1) +
                                              " columns is too long: at most " +
                                              std::to_string(kImageSideMax));
    }
    const auto columns = see_columns(world, columns_on(line));
    if (!columns) {
        return tl::unexpected(columns.error());
    }
    const auto count = static_cast<std::int64_t>(columns->size());
    const std::int64_t voxels = picture_voxels(*columns);
    const std::int64_t scale = line.scale > 0 ? line.scale : good_scale(count, voxels);
    auto image = make_image(count * scale, voxels * scale);
    if (!image) {
        return image;
    }
    const std::vector<Rgb8> sky = sky_rows(image->height);
    for (std::int32_t x = 0; x < image->width; ++x) {
        draw_column(*image, x, (*columns)[static_cast<std::size_t>(x / scale)],
                    static_cast<std::int32_t>(scale), sky);
    }
    return image;
}

void add_slice_command(CLI::App& app, int& exit_code) {
    const auto options = std::make_shared<SliceOptions>();
    CLI::App* slice = app.add_subcommand("slice", "Draw a vertical cut through the terrain");
    slice->add_option("--world", options->world, "World file")->required();
    slice->add_option("--from", options->from, "Column X,Z at the left end; may be negative")
        ->required();
    slice->add_option("--to", options->to, "Column X,Z at the right end, included")->required();
    slice->add_option("--scale", options->scale, "Pixels a voxel; chosen to fit a screen if absent")
        ->check(CLI::Range(1, kSliceScaleMax));
    slice->add_option("-o,--out", options->out, "PNG file to write")->required();
    slice->footer(
        "Colours are mixed by composition; blends are smooth, veins bright, caves dark.\n"
        "Exit code: 0 done, 1 the file cannot be written, 2 a bad world file, line or size.\n"
        "Example: terrane slice --world generator/worlds/basin.toml --from -200,0 --to 199,0 -o "
        "cut.png");
    slice->callback([options, &exit_code] { exit_code = run_slice(*options); });
}

}  // namespace terrane
