#include "generator/baseline/row_perlin.h"
#include "generator/terrain/random.h"
#include "generator/terrain/world.h"
#include "generator/world/world_definition.h"
#include "protocol/base/result.h"
#include "server/report/chart.h"
#include "server/report/metrics.h"
#include "server/report/numbers.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/shipped_world.h"
#include "server/report/survey.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace terrane {
namespace {

constexpr std::int32_t kSide = 100;
constexpr std::int32_t kHeight = 50;
constexpr int kMaterials = 6;
constexpr std::array<std::int32_t, 6> kDistances = {1, 2, 4, 8, 16, 32};

/// A block of voxels, a material each: x fastest, then y, then z.
using Materials = std::vector<std::uint16_t>;

std::size_t index_of(std::int32_t x, std::int32_t y, std::int32_t z) {
    return (static_cast<std::size_t>(z) * kHeight + static_cast<std::size_t>(y)) * kSide +
           static_cast<std::size_t>(x);
}

Materials white_noise() {
    Materials out(std::size_t{kSide} * kHeight * kSide);
    RandomStream random(7);
    for (std::uint16_t& material : out) {
        material = static_cast<std::uint16_t>(1 + random.next() % kMaterials);
    }
    return out;
}

/// The paper's PN: noise cut into equally many materials of about equal volume.
Materials perlin_noise() {
    RowPerlin noise(5, 28);
    std::vector<float> values(std::size_t{kSide} * kHeight * kSide);
    noise.fill(values.data(),
               {.x0 = 0, .y0 = 0, .z0 = 0, .width = kSide, .height = kHeight, .length = kSide});
    std::vector<float> sorted = values;
    std::ranges::sort(sorted);
    Materials out;
    for (const float value : values) {
        const auto below =
            static_cast<double>(std::ranges::lower_bound(sorted, value) - sorted.begin());
        out.push_back(static_cast<std::uint16_t>(1 + below * kMaterials /
                                                         static_cast<double>(sorted.size())));
    }
    return out;
}

/// Share of pairs of solid voxels at a distance along x or y that have one material, less what
/// chance gives: 1 is one material throughout, 0 is noise.
double likeness(const Materials& materials, std::int32_t away, bool upward) {
    std::array<double, 64> counts{};
    double same = 0;
    double pairs = 0;
    double solid = 0;
    for (std::int32_t z = 0; z < kSide; ++z) {
        for (std::int32_t y = 0; y < kHeight - (upward ? away : 0); ++y) {
            for (std::int32_t x = 0; x < kSide - (upward ? 0 : away); ++x) {
                const std::uint16_t a = materials[index_of(x, y, z)];
                const std::uint16_t b =
                    materials[upward ? index_of(x, y + away, z) : index_of(x + away, y, z)];
                if (a != 0) {
                    counts[a % 64] += 1;
                    solid += 1;
                }
                if (a != 0 && b != 0) {
                    same += a == b ? 1 : 0;
                    pairs += 1;
                }
            }
        }
    }
    double chance = 0;
    for (const double count : counts) {
        chance += count * count / (solid * solid);
    }
    return pairs > 0 && chance < 1 ? (same / pairs - chance) / (1 - chance) : 0;
}

LineSeries likeness_series(const std::string& name, const Materials& materials, bool upward) {
    LineSeries series{.name = name, .points = {}};
    for (const std::int32_t away : kDistances) {
        if (upward && away > kHeight / 3) {
            break;  // few pairs are left, and those of top and bottom only
        }
        series.points.push_back({static_cast<double>(away), likeness(materials, away, upward)});
    }
    return series;
}

Result<double> layer_correlation(const WorldDefinition& definition, std::int32_t seeds) {
    std::vector<double> values;
    for (std::int32_t seed = 1; seed <= seeds; ++seed) {
        const auto world = build_with_seed(definition, static_cast<std::uint64_t>(seed));
        if (!world) {
            return tl::unexpected(world.error());
        }
        const auto surveyed = survey(*world);
        if (!surveyed) {
            return tl::unexpected(surveyed.error());
        }
        for (std::size_t k = 1; k < surveyed->layer_tops.size(); ++k) {
            values.push_back(correlation(surveyed->layer_tops[k - 1], surveyed->layer_tops[k]));
        }
    }
    return summarize(values).mean;
}

/// The same measure for two surfaces of white noise.
double noise_correlation() {
    RandomStream random(11);
    std::vector<double> a(std::size_t{kSurveySide} * kSurveySide);
    std::vector<double> b(a.size());
    std::ranges::generate(a, [&] { return random.unit(); });
    std::ranges::generate(b, [&] { return random.unit(); });
    return correlation(a, b);
}

}  // namespace

Result<void> write_structure(Page& page, const ReportOptions& options) {
    const WorldDefinition definition = shipped_definition("paper-B3");
    const auto world = World::build(definition);
    if (!world) {
        return tl::unexpected(world.error());
    }
    const auto terrain =
        main_materials(*world, {.x0 = 0, .z0 = 0, .width = kSide, .length = kSide}, kHeight);
    const auto coupled = layer_correlation(definition, options.seeds);
    WorldDefinition uncoupled_definition = definition;
    uncoupled_definition.terrain.layer_similarity = 0;
    const auto uncoupled = layer_correlation(uncoupled_definition, options.seeds);
    if (!terrain || !coupled || !uncoupled) {
        return tl::unexpected(!terrain   ? terrain.error()
                              : !coupled ? coupled.error()
                                         : uncoupled.error());
    }
    const Materials perlin = perlin_noise();
    const Materials white = white_noise();
    page.begin_row();
    for (const bool upward : {false, true}) {
        page.chart(upward ? "structure-upward" : "structure-sideways",
                   LineChart{.title = upward ? "Same material straight above"
                                             : "Same material to the side",
                             .x_label = "distance, voxels",
                             .y_label = "likeness beyond chance",
                             .series = {likeness_series("terrain (B3)", *terrain, upward),
                                        likeness_series("Perlin noise", perlin, upward),
                                        likeness_series("white noise", white, upward)},
                             .log_x = true});
    }
    page.end_row();
    page.table({.name = "structure",
                .title = "Correlation of the top of a layer with that of the next, mean of all",
                .head = {"", "correlation"},
                .rows = {{"terrain (B3)", fixed(*coupled, 2)},
                         {"plain Perlin layers (the same, similarity 0)", fixed(*uncoupled, 2)},
                         {"white noise", fixed(noise_correlation(), 2)}}});
    page.paragraph(
        "White noise is 0 at any distance. Perlin noise holds together alike in all directions: "
        "blobs. The terrain stays one material much farther sideways than upwards: layers (below 0 "
        "upwards: another layer is likelier "
        "than the same one). And "
        "they are coupled, each layer following the one below as far as the materials' "
        "<em>similarity</em> says; at similarity 0 what is left comes from layers that pinch "
        "out. What a number can't show: whether a person recognises what "
        "they see; for that, look at the slices below.");
    return {};
}

}  // namespace terrane
