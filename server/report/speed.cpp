#include "server/report/speed.h"

#include "generator/baseline/row_perlin.h"
#include "generator/terrain/element.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/region.h"
#include "generator/terrain/world.h"
#include "generator/volume/chunk.h"
#include "generator/volume/column_codec.h"
#include "generator/volume/stack.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "server/report/baselines.h"
#include "server/report/numbers.h"
#include "server/report/report_options.h"
#include "server/report/shipped_world.h"
#include "server/report/stopwatch.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace terrane {
namespace {

constexpr std::array<const char*, 8> kNames = {"A0", "A1", "A2", "A3", "B0", "B1", "B2", "B3"};

constexpr ColumnRectangle plot_at(std::int64_t x, std::int64_t z) {
    return {.x0 = x * kPaperSide, .z0 = z * kPaperSide, .width = kPaperSide, .length = kPaperSide};
}

/// One configuration's numbers, a value a terrain.
struct Samples {
    std::vector<double> offline;
    std::vector<double> online;
    std::vector<double> chunked;
    std::vector<double> layers;
    std::vector<double> elements;
    std::vector<double> limits_whole;
    std::vector<double> limits_chunked;
    std::vector<double> bytes_whole;
    std::vector<double> bytes_no_flow;
};

double encoded_bytes(const ColumnSet& set, bool with_flow) {
    Bytes bytes;
    encode_columns(bytes, set.columns, set.palette,
                   {.width = kPaperSide, .length = kPaperSide, .apron = 0, .with_flow = with_flow});
    return static_cast<double>(bytes.size());
}

/// The plot beside the origin's as the server would answer for it.
Result<void> measure_chunks(Samples& samples, const World& world, StackGenerator& generator) {
    const std::int32_t side = world.definition.grid.side;
    const std::int32_t stacks = kPaperSide / side;
    Stack stack;
    Chunk chunk;
    std::size_t limits = 0;
    const Stopwatch watch;
    for (std::int32_t z = 0; z < stacks; ++z) {
        for (std::int32_t x = 0; x < stacks; ++x) {
            if (auto made = generator.generate(stack, {.lod = 0, .x = stacks + x, .z = z}); !made) {
                return made;
            }
            for (std::int32_t y = 0; y < stacks; ++y) {
                cut_chunk(chunk, stack, y, world.definition.grid.height);
                limits += chunk.columns.limits.size();
            }
        }
    }
    samples.chunked.push_back(watch.milliseconds());
    samples.limits_chunked.push_back(static_cast<double>(limits));
    return {};
}

Result<void> measure_terrain(Samples& samples, const WorldDefinition& definition,
                             std::uint64_t seed) {
    ColumnSet set;
    const Stopwatch offline;
    const auto world = build_with_seed(definition, seed);
    if (!world) {
        return tl::unexpected(world.error());
    }
    StackGenerator generator(*world);
    if (auto made = generator.generate(set, plot_at(0, 0)); !made) {
        return made;
    }
    samples.offline.push_back(offline.milliseconds());
    samples.limits_whole.push_back(static_cast<double>(set.columns.limits.size()));
    samples.bytes_whole.push_back(encoded_bytes(set, true));
    samples.bytes_no_flow.push_back(encoded_bytes(set, false));
    const Stopwatch online;
    if (auto made = generator.generate(set, plot_at(1, 0)); !made) {
        return made;
    }
    samples.online.push_back(online.milliseconds());
    samples.layers.push_back(static_cast<double>(world->stack.layers.size()));
    std::vector<Element> elements;
    draw_plot(elements, *world, {.x = 0, .z = 0});
    samples.elements.push_back(static_cast<double>(elements.size()));
    return measure_chunks(samples, *world, generator);
}

}  // namespace

Result<SpeedTable> measure_speed(const ReportOptions& options) {
    std::array<Samples, kNames.size()> samples;
    std::vector<WorldDefinition> definitions;
    definitions.reserve(kNames.size());
    for (const char* name : kNames) {
        definitions.push_back(shipped_definition(std::string("paper-") + name));
    }
    VoxelBaseline voxels;
    RowBaseline rows;
    std::vector<double> perlin_ms;
    std::vector<double> tuned_ms;
    for (std::int32_t terrain = 0; terrain < options.terrains; ++terrain) {
        const VoxelBox box{.x0 = std::int64_t{terrain} * kPaperSide,
                           .y0 = 0,
                           .z0 = 0,
                           .width = kPaperSide,
                           .height = kPaperSide,
                           .length = kPaperSide};
        const Stopwatch perlin;
        voxels.generate(box);
        perlin_ms.push_back(perlin.milliseconds());
        for (std::size_t i = 0; i < kNames.size(); ++i) {
            if (auto made = measure_terrain(samples[i], definitions[i],
                                            static_cast<std::uint64_t>(terrain) + 1);
                !made) {
                return tl::unexpected(made.error());
            }
        }
        const Stopwatch tuned;
        rows.generate(box);
        tuned_ms.push_back(tuned.milliseconds());
    }
    SpeedTable table{
        .configurations = {}, .perlin = summarize(perlin_ms), .tuned_perlin = summarize(tuned_ms)};
    for (std::size_t i = 0; i < kNames.size(); ++i) {
        const Samples& s = samples[i];
        table.configurations.push_back({.name = kNames[i],
                                        .offline = summarize(s.offline),
                                        .online = summarize(s.online),
                                        .chunked = summarize(s.chunked),
                                        .layers = summarize(s.layers),
                                        .elements = summarize(s.elements),
                                        .limits_whole = summarize(s.limits_whole),
                                        .limits_chunked = summarize(s.limits_chunked),
                                        .bytes_whole = summarize(s.bytes_whole),
                                        .bytes_no_flow = summarize(s.bytes_no_flow)});
    }
    return table;
}

}  // namespace terrane
