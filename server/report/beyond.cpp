#include "server/report/beyond.h"

#include "generator/landscape/river_graph.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "generator/volume/chunk_codec.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/volume/water.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/render/png.h"
#include "server/render/render_picture.h"
#include "server/render/section.h"
#include "server/report/chart.h"
#include "server/report/joined_intervals.h"
#include "server/report/numbers.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/shipped_world.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <ctime>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr std::array<const char*, 6> kLandscapes = {"canyon", "karst",  "fold",
                                                    "range",  "alpine", "coast"};
/// A wet column may stand so much above what is next to it.
constexpr std::int32_t kWetStepMax256 = 3 * kUnitsPerVoxel / 4;
constexpr std::int32_t kDry = std::numeric_limits<std::int32_t>::min();
constexpr std::int32_t kSky256 = 1 << 30;
/// Of each way to generate, so many stacks and rounds are timed, one way after the other.
constexpr std::int32_t kTimedStacks = 12;
constexpr int kTimedRounds = 5;

/// A square of columns as measures see it.
struct Square {
    std::size_t width = 0;
    IntervalColumns solid;
    std::vector<std::int32_t> water256;  ///< open water's level, or kDry
    std::size_t limits = 0;
    std::size_t bytes = 0;  ///< of the stacks as columns, before compression

    double columns() const { return static_cast<double>(solid.size()); }
};

/// Neighbouring solid of any kind is one interval.
std::vector<Interval> solid_of(std::span<const Limit> limits, const Palette& palette) {
    std::vector<Interval> found;
    for (std::size_t i = 0; i + 1 < limits.size(); ++i) {
        const Interval here{.low = limits[i].y256, .high = limits[i + 1].y256};
        if (here.high <= here.low || !palette[limits[i].palette_id].is_solid()) {
            continue;
        }
        if (!found.empty() && found.back().high == here.low) {
            found.back().high = here.high;
        } else {
            found.push_back(here);
        }
    }
    return found;
}

std::int32_t open_water_of(std::span<const Limit> limits, const Palette& palette,
                           std::span<const Material> materials) {
    std::int32_t level = kDry;
    for (std::size_t i = 0; i + 1 < limits.size(); ++i) {
        const PaletteEntry& entry = palette[limits[i].palette_id];
        if (limits[i + 1].y256 > limits[i].y256) {
            level = is_water(entry, materials) ? limits[i + 1].y256
                    : entry.is_solid()         ? kDry
                                               : level;
        }
    }
    return level;
}

Result<Square> square_of(const World& world, std::int32_t region_columns) {
    const std::int32_t side = world.definition.grid.side;
    const std::int32_t stacks = std::max(1, region_columns / side);
    Square square;
    square.width = static_cast<std::size_t>(stacks) * static_cast<std::size_t>(side);
    square.solid.resize(square.width * square.width);
    square.water256.resize(square.solid.size());
    StackGenerator generator(world);
    Stack stack;
    Bytes bytes;
    for (std::int32_t i = 0; i < stacks * stacks; ++i) {
        const StackPos at{.lod = 0, .x = i % stacks, .z = i / stacks};
        if (auto made = generator.generate(stack, at); !made) {
            return tl::unexpected(made.error());
        }
        encode_stack(bytes, stack);
        square.bytes += bytes.size();
        for (std::int32_t z = 0; z < side; ++z) {
            for (std::int32_t x = 0; x < side; ++x) {
                const auto limits = stack.columns.column(x, z);
                const auto column = static_cast<std::size_t>(at.z * side + z) * square.width +
                                    static_cast<std::size_t>(at.x * side + x);
                square.limits += limits.size();
                square.solid[column] = solid_of(limits, stack.palette);
                square.water256[column] =
                    open_water_of(limits, stack.palette, world.definition.materials);
            }
        }
    }
    return square;
}

struct WetSteps {
    std::int64_t wet = 0;
    std::int64_t too_high = 0;
    std::int32_t highest256 = 0;
};

WetSteps wet_steps(const Square& square) {
    WetSteps steps;
    const auto look = [&](std::size_t wet, std::size_t next) {
        if (square.water256[wet] == kDry) {
            return;
        }
        const std::int32_t there = std::max(square.water256[next], square.solid[next].back().high);
        const std::int32_t step = square.water256[wet] - there;
        steps.highest256 = std::max(steps.highest256, step);
        steps.too_high += step > kWetStepMax256 ? 1 : 0;
    };
    for (std::size_t i = 0; i < square.solid.size(); ++i) {
        steps.wet += square.water256[i] != kDry ? 1 : 0;
        const bool has_right = i % square.width + 1 < square.width;
        const bool has_below = i + square.width < square.solid.size();
        for (const auto& [is_there, next] :
             {std::pair(has_right, i + 1), std::pair(has_below, i + square.width)}) {
            if (is_there) {
                look(i, next);
                look(next, i);
            }
        }
    }
    return steps;
}

double voxels(const Interval& interval) {
    return static_cast<double>(interval.high - interval.low) / kUnitsPerVoxel;
}

struct Rock {
    double solid = 0;     ///< voxels
    double floating = 0;  ///< of them hang on nothing: neither on the bottom nor on the border
};

Rock rock_of(const Square& square) {
    JoinedIntervals joined(square.solid, square.width, 1);
    std::vector<std::uint8_t> held(joined.size(), 0);
    for (std::size_t c = 0; c < square.solid.size(); ++c) {
        const std::size_t x = c % square.width;
        const std::size_t z = c / square.width;
        const bool is_border = x == 0 || z == 0 || x + 1 == square.width || z + 1 == square.width;
        for (std::size_t i = 0; i < square.solid[c].size(); ++i) {
            if (is_border || square.solid[c][i].low == 0) {
                held[joined.root(c, i)] = 1;
            }
        }
    }
    Rock rock;
    for (std::size_t c = 0; c < square.solid.size(); ++c) {
        for (std::size_t i = 0; i < square.solid[c].size(); ++i) {
            const double volume = voxels(square.solid[c][i]);
            rock.solid += volume;
            rock.floating += held[joined.root(c, i)] == 0 ? volume : 0;
        }
    }
    return rock;
}

struct Caves {
    double volume = 0;  ///< voxels
    double reached = 0;
    double largest = 0;  ///< of the largest system, the sky not counted as a way
};

Caves caves_of(const Square& square) {
    IntervalColumns with_sky(square.solid.size());
    IntervalColumns hollows(square.solid.size());
    for (std::size_t c = 0; c < square.solid.size(); ++c) {
        const auto& solid = square.solid[c];
        for (std::size_t i = 0; i + 1 < solid.size(); ++i) {
            hollows[c].push_back({.low = solid[i].high, .high = solid[i + 1].low});
        }
        with_sky[c] = hollows[c];
        with_sky[c].push_back({.low = solid.back().high, .high = kSky256});
    }
    JoinedIntervals open(with_sky, square.width, kUnitsPerVoxel);
    std::vector<std::uint8_t> is_reached(open.size(), 0);
    for (std::size_t c = 0; c < with_sky.size(); ++c) {
        is_reached[open.root(c, with_sky[c].size() - 1)] = 1;
    }
    JoinedIntervals systems(hollows, square.width, kUnitsPerVoxel);
    std::vector<double> volumes(systems.size() + 1, 0);
    Caves caves;
    for (std::size_t c = 0; c < hollows.size(); ++c) {
        for (std::size_t i = 0; i < hollows[c].size(); ++i) {
            const double volume = voxels(hollows[c][i]);
            caves.volume += volume;
            caves.reached += is_reached[open.root(c, i)] != 0 ? volume : 0;
            volumes[systems.root(c, i)] += volume;
        }
    }
    caves.largest = *std::ranges::max_element(volumes);
    return caves;
}

struct Rivers {
    std::int64_t reaches = 0;
    std::int64_t uphill = 0;  ///< of them end no lower than they begin
};

Rivers rivers_of(const World& world) {
    constexpr std::int64_t kCells = 40;
    RiverGraph graph;
    graph.build(RiverConstants(world.definition),
                {.first_i = 0, .last_i = kCells, .first_j = 0, .last_j = kCells});
    Rivers rivers;
    for (const Reach& reach : graph.reaches()) {
        rivers.reaches += reach.is_sink ? 0 : 1;
        rivers.uphill += !reach.is_sink && reach.level_change >= 0 ? 1 : 0;
    }
    return rivers;
}

struct Cost {
    double microseconds = 0;  ///< a column
    double ratio = 0;         ///< to the same layers without a landscape
};

/// The program's own time: nothing else of it runs meanwhile, and what other programs do does not
/// count.
double processor_ms() {
    return 1000.0 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

Result<Cost> cost_of(const World& world) {
    WorldDefinition definition = world.definition;
    definition.relief = {};
    definition.structure = {};
    definition.caves = {};
    const auto plain = World::build(definition);
    if (!plain) {
        return tl::unexpected(plain.error());
    }
    std::array<StackGenerator, 2> generators = {StackGenerator(world), StackGenerator(*plain)};
    std::array<std::vector<double>, 2> milliseconds;
    Stack stack;
    for (int round = 0; round <= kTimedRounds; ++round) {
        for (std::size_t which = 0; which < 2; ++which) {
            const double begin = processor_ms();
            for (std::int32_t i = 0; i < kTimedStacks; ++i) {
                // In a row, as a flight asks for them.
                const StackPos at{.lod = 0, .x = round * kTimedStacks + i, .z = 100};
                if (auto made = generators[which].generate(stack, at); !made) {
                    return tl::unexpected(made.error());
                }
            }
            if (round > 0) {  // the first fills the caches
                milliseconds[which].push_back(processor_ms() - begin);
            }
        }
    }
    const double columns =
        static_cast<double>(kTimedStacks) * world.definition.grid.side * world.definition.grid.side;
    const double own = summarize(milliseconds[0]).median;
    return Cost{.microseconds = own * 1000 / columns,
                .ratio = own / summarize(milliseconds[1]).median};
}

std::string percent(double share) {
    return fixed(100 * share, share < 0.1 ? 1 : 0) + " %";
}

struct Tables {
    ReportTable columns{.name = "landscape-columns",
                        .title = "Columns and their cost",
                        .head = {"World", "limits a column", "bytes a column", "µs a column",
                                 "times its layers alone"},
                        .rows = {}};
    ReportTable water{.name = "landscape-water",
                      .title = "Water runs downhill and stays in its bed",
                      .head = {"World", "reaches", "of them uphill", "wet columns",
                               "highest step, voxels", "steps over 0.75"},
                      .rows = {}};
    ReportTable rock{.name = "landscape-rock",
                     .title = "Rock hangs together, and so do caves",
                     .head = {"World", "solid voxels", "floating", "caves in the rock",
                              "reached from the sky", "largest system"},
                     .rows = {}};
    BarChart caves{.title = "How caves hang together",
                   .y_label = "% of the cave volume",
                   .groups = {},
                   .series = {{.name = "reached from the sky", .values = {}, .deviations = {}},
                              {.name = "largest system", .values = {}, .deviations = {}}},
                   .log_y = false,
                   .width = 440};
    BarChart cost{.title = "What a landscape costs",
                  .y_label = "times the same layers alone",
                  .groups = {},
                  .series = {{.name = "time of a stack", .values = {}, .deviations = {}}},
                  .log_y = false,
                  .width = 440};
};

Result<void> measure(Tables& out, const char* name, const ReportOptions& options) {
    const auto world = World::build(shipped_definition(name));
    if (!world) {
        return tl::unexpected(world.error());
    }
    const auto square = square_of(*world, options.region_columns);
    if (!square) {
        return tl::unexpected(square.error());
    }
    const auto cost = cost_of(*world);
    if (!cost) {
        return tl::unexpected(cost.error());
    }
    const WetSteps steps = wet_steps(*square);
    const Rock rock = rock_of(*square);
    const Caves caves = caves_of(*square);
    const Rivers rivers = rivers_of(*world);
    const double cave_volume = std::max(1.0, caves.volume);
    out.columns.rows.push_back({name,
                                fixed(static_cast<double>(square->limits) / square->columns(), 1),
                                fixed(static_cast<double>(square->bytes) / square->columns(), 1),
                                three_digits(cost->microseconds), fixed(cost->ratio, 2)});
    out.water.rows.push_back({name, std::to_string(rivers.reaches), std::to_string(rivers.uphill),
                              std::to_string(steps.wet),
                              fixed(static_cast<double>(steps.highest256) / kUnitsPerVoxel, 2),
                              std::to_string(steps.too_high)});
    out.rock.rows.push_back({name, fixed(rock.solid, 0), fixed(rock.floating, 0),
                             percent(caves.volume / (rock.solid + caves.volume)),
                             percent(caves.reached / cave_volume),
                             percent(caves.largest / cave_volume)});
    out.caves.groups.emplace_back(name);
    out.caves.series[0].values.push_back(100 * caves.reached / cave_volume);
    out.caves.series[1].values.push_back(100 * caves.largest / cave_volume);
    out.cost.groups.emplace_back(name);
    out.cost.series[0].values.push_back(cost->ratio);
    return {};
}

struct Cut {
    const char* world;
    std::int64_t from_x;
    std::int64_t to_x;
    const char* caption;
};

constexpr std::array<Cut, 3> kCuts = {{
    {"fold", -260, 219, "fold: a valley has cut the anticline on the right open"},
    {"range", 80, 559, "range: two faults; the sheets along them carry ore near the ground"},
    {"karst", 140, 619, "karst: caves on soluble beds, the lowest under water"},
}};

struct Sight {
    const char* world;
    glm::dvec3 eye;
    glm::dvec3 look;
};

const std::array<Sight, 2> kSights = {{
    {"canyon", {-300, 300, -300}, {170, 150, 170}},
    {"coast", {-260, 300, -260}, {170, 140, 170}},
}};

Result<void> show(Page& page, const ReportOptions& options) {
    page.begin_row();
    for (const Cut& cut : kCuts) {
        const auto world = World::build(shipped_definition(cut.world));
        if (!world) {
            return tl::unexpected(world.error());
        }
        StackGenerator generator(*world);
        const auto png =
            draw_section(
                {.world = &*world, .generator = &generator},
                {.from = {.x = cut.from_x, .z = 0}, .to = {.x = cut.to_x, .z = 0}, .scale = 2})
                .and_then([](const Image& image) { return encode_png(image); });
        if (!png) {
            return tl::unexpected(png.error());
        }
        page.picture(std::string("slice-") + cut.world, *png, cut.caption);
    }
    page.end_row();
    page.begin_row();
    for (const Sight& sight : kSights) {
        const auto world = World::build(shipped_definition(sight.world));
        if (!world) {
            return tl::unexpected(world.error());
        }
        const auto png = render_picture(*world,
                                        {.eye = sight.eye,
                                         .look = sight.look,
                                         .width = options.picture_width,
                                         .height = options.picture_height,
                                         .field_of_view = 55,
                                         .block = {}},
                                        options.threads)
                             .and_then([](const Image& image) { return encode_png(image); });
        if (!png) {
            return tl::unexpected(png.error());
        }
        page.picture(std::string("picture-") + sight.world, *png,
                     std::string(sight.world) + ", to the horizon");
    }
    page.end_row();
    return {};
}

}  // namespace

Result<void> write_beyond(Page& page, const ReportOptions& options) {
    page.heading("Beyond the paper");
    page.paragraph(
        "The paper names what its method lacks: a surface that is plain Perlin noise, and caves of "
        "simple shapes. In worlds of format 2 the same stack of layers is bent by folds, broken by "
        "faults, cut by rivers and pierced by cave systems; a column stays a list of limits, and a "
        "pure function of world file and place. Six such worlds, over " +
        std::to_string(options.region_columns) + " × " + std::to_string(options.region_columns) +
        " columns each.");
    Tables tables;
    for (const char* name : kLandscapes) {
        if (auto done = measure(tables, name, options); !done) {
            return done;
        }
    }
    page.table(tables.columns);
    page.paragraph(
        "Bytes are those of whole stacks as columns, before compression. The last column is the "
        "median of one interleaved run, in processor time, against the same world file with "
        "nothing bent, cut or "
        "pierced.");
    page.table(tables.water);
    page.paragraph(
        "A step is how far a wet column stands above the ground or the water of a column next to "
        "it: above 0.75 a wall of water would be seen.");
    page.table(tables.rock);
    page.paragraph(
        "Floating is what hangs neither on the bottom nor on the square's border: overhangs may "
        "leave single voxels. Caves are all hollows under rock, overhangs' too.");
    page.begin_row();
    page.chart("landscape-cost", tables.cost);
    page.chart("landscape-caves", tables.caves);
    page.end_row();
    return show(page, options);
}

}  // namespace terrane
