// Generation: the paper's terrain extended online, against per-voxel Perlin noise of the same size.
#include "generator/baseline/row_perlin.h"
#include "generator/baseline/voxel_perlin.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/kernels/kernel_choice.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/random.h"
#include "generator/terrain/world.h"
#include "generator/volume/cut_columns.h"
#include "tests/bench/bench_world.h"
#include "tests/bench/ratios.h"

#include <benchmark/benchmark.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace terrane::bench {
namespace {

/// The paper's terrain: 5 x 5 x 5 chunks of 10^3 voxels.
constexpr std::int32_t kTerrainSide = 50;
constexpr std::int32_t kTerrainHeight = 50;
constexpr std::int64_t kTerrainVoxels = std::int64_t{kTerrainSide} * kTerrainSide * kTerrainHeight;

void perlin_per_voxel(benchmark::State& state) {
    const ClassicPerlin noises[4] = {ClassicPerlin(1), ClassicPerlin(2), ClassicPerlin(3),
                                     ClassicPerlin(4)};
    std::vector<PerlinVoxel> voxels(static_cast<std::size_t>(kTerrainVoxels));
    constexpr double kFrequency = 1.0 / 28;
    double offset = 0;
    for (auto _ : state) {
        std::size_t i = 0;
        for (int z = 0; z < kTerrainSide; ++z) {
            for (int y = 0; y < kTerrainHeight; ++y) {
                for (int x = 0; x < kTerrainSide; ++x) {
                    const double px = (x + offset) * kFrequency;
                    const double py = y * kFrequency;
                    const double pz = z * kFrequency;
                    voxels[i++] = {.material = static_cast<float>(noises[0].at(px, py, pz)),
                                   .flow_x = static_cast<float>(noises[1].at(px, py, pz)),
                                   .flow_y = static_cast<float>(noises[2].at(px, py, pz)),
                                   .flow_z = static_cast<float>(noises[3].at(px, py, pz))};
                }
            }
        }
        benchmark::DoNotOptimize(voxels.data());
        benchmark::ClobberMemory();
        offset += kTerrainSide;
    }
    state.SetItemsProcessed(state.iterations() * kTerrainVoxels);
}

/// The same four samples a voxel by rows, floats and vectors: tuned as hard as the terrain is.
void perlin_tuned(benchmark::State& state) {
    std::vector<RowPerlin> noises;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        noises.emplace_back(seed, 28.0F);
    }
    std::vector<float> values(static_cast<std::size_t>(4 * kTerrainVoxels));
    VoxelBox box{.x0 = 0,
                 .y0 = 0,
                 .z0 = 0,
                 .width = kTerrainSide,
                 .height = kTerrainHeight,
                 .length = kTerrainSide};
    for (auto _ : state) {
        for (std::size_t i = 0; i < noises.size(); ++i) {
            noises[i].fill(values.data() + i * static_cast<std::size_t>(kTerrainVoxels), box);
        }
        benchmark::DoNotOptimize(values.data());
        benchmark::ClobberMemory();
        box.x0 += kTerrainSide;
    }
    state.SetItemsProcessed(state.iterations() * kTerrainVoxels);
}

/// Extension plots around the origin, one after the other, so that no cache holds the answer.
ColumnRectangle next_plot(std::int64_t iteration) {
    return {.x0 = (1 + iteration % 512) * kTerrainSide,
            .z0 = (1 + iteration / 512 % 512) * kTerrainSide,
            .width = kTerrainSide,
            .length = kTerrainSide};
}

/// The online algorithm (4.2.4): a plot's columns with all their limits.
void extend(benchmark::State& state, const std::string& name) {
    const auto world = bench_world(name);
    StackGenerator generator(*world);
    ColumnSet set;
    std::int64_t iteration = 0;
    std::size_t limits = 0;
    for (auto _ : state) {
        if (!generator.generate(set, next_plot(iteration++))) {
            state.SkipWithError("out of range");
            break;
        }
        limits += set.columns.limits.size();
        benchmark::DoNotOptimize(set.columns.limits.data());
    }
    state.SetItemsProcessed(state.iterations() * kTerrainVoxels);
    state.counters["limits"] =
        static_cast<double>(limits) / static_cast<double>(state.iterations());
}

/// The same, cut into the paper's 125 chunks, which all stay: limits as each chunk's own.
void extend_chunks(benchmark::State& state, const std::string& name) {
    const auto world = bench_world(name);
    const std::int32_t side = world->definition.grid.side;
    const std::int32_t height = world->definition.grid.height;
    const std::int32_t squares = kTerrainSide / side;
    StackGenerator generator(*world);
    ColumnSet set;
    ColumnCutter cutter;
    std::vector<std::vector<ChunkLimits>> chunks(static_cast<std::size_t>(squares * squares));
    std::int64_t iteration = 0;
    for (auto _ : state) {
        if (!generator.generate(set, next_plot(iteration++))) {
            state.SkipWithError("out of range");
            break;
        }
        for (std::int32_t i = 0; i < squares * squares; ++i) {
            cutter.cut(chunks[static_cast<std::size_t>(i)], set.columns, set.palette,
                       {.x0 = i % squares * side,
                        .z0 = i / squares * side,
                        .side = side,
                        .height = height,
                        .first_y = 0,
                        .count = kTerrainHeight / height});
        }
        benchmark::ClobberMemory();
    }
    std::size_t limits = 0;
    for (const auto& stack : chunks) {
        for (const ChunkLimits& chunk : stack) {
            limits += chunk.columns.limits.size();
        }
    }
    state.SetItemsProcessed(state.iterations() * kTerrainVoxels);
    state.counters["limits"] = static_cast<double>(limits);
}

constexpr std::int64_t kStackVoxels = std::int64_t{32} * 32 * 256;

/// Chunk stacks to limits, apron included; `items` are voxels.
void stack_limits(benchmark::State& state, double density, std::int32_t lod) {
    const auto world = high_world(density);
    StackGenerator generator(*world);
    Stack stack;
    std::int32_t i = 0;
    for (auto _ : state) {
        if (!generator.generate(stack, {.lod = lod, .x = i % 1024 - 512, .z = i / 1024})) {
            state.SkipWithError("out of range");
            break;
        }
        ++i;
        benchmark::DoNotOptimize(stack.columns.limits.data());
    }
    state.SetItemsProcessed(state.iterations() * kStackVoxels);
    state.counters["layers"] = static_cast<double>(world->stack.layers.size());
}

void noise_scalar(benchmark::State& state) {
    const Noise noise = Noise::make(key(1, Tag::noise, 0), static_cast<double>(state.range(0)), 1);
    std::int64_t z = 0;
    for (auto _ : state) {
        float sum = 0;
        for (std::int64_t x = 0; x < 64; ++x) {
            sum += noise_at(noise, x, z);
        }
        benchmark::DoNotOptimize(sum);
        ++z;
    }
    state.SetItemsProcessed(state.iterations() * 64);
}

void noise_rows(benchmark::State& state, const RowKernels* kernels) {
    const Noise noise = Noise::make(key(1, Tag::noise, 0), static_cast<double>(state.range(0)), 1);
    RectangleShape shape{.x0 = 0, .z0 = 0, .width = 64, .length = 64};
    std::vector<float> out(shape.padded_size());
    NoiseBuffers buffers;
    for (auto _ : state) {
        noise_rectangle(out.data(), noise, shape, *kernels, buffers);
        benchmark::DoNotOptimize(out.data());
        shape.x0 += 64;
    }
    state.SetItemsProcessed(state.iterations() * 64 * 64);
}

void register_all() {
    benchmark::RegisterBenchmark("perlin_per_voxel", perlin_per_voxel);
    benchmark::RegisterBenchmark("perlin_tuned", perlin_tuned);
    for (const char* name : {"A0", "A1", "A2", "A3", "B0", "B1", "B2", "B3"}) {
        benchmark::RegisterBenchmark(
            (std::string("extend/") + name).c_str(),
            [name](benchmark::State& state) { extend(state, std::string("paper-") + name); });
        benchmark::RegisterBenchmark((std::string("extend_chunks/") + name).c_str(),
                                     [name](benchmark::State& state) {
                                         extend_chunks(state, std::string("paper-") + name);
                                     });
    }
    for (const std::int32_t lod : {0, 1, 3, 5, 9, 17}) {
        for (const double density : {0.0, 0.25}) {
            const std::string name =
                "stack_limits/level" + std::to_string(lod) + (density > 0 ? "/elements" : "/plain");
            benchmark::RegisterBenchmark(name.c_str(), [density, lod](benchmark::State& state) {
                stack_limits(state, density, lod);
            });
        }
    }
    benchmark::RegisterBenchmark("noise_scalar", noise_scalar)->Arg(28);
    for (const KernelSet& set : available_kernel_sets()) {
        benchmark::RegisterBenchmark(
            (std::string("noise_rows/") + std::string(set.name)).c_str(),
            [kernels = set.kernels](benchmark::State& state) { noise_rows(state, kernels); })
            ->Arg(28)
            ->Arg(7);
    }
}

const bool kRegistered = (register_all(), true);

const std::vector<std::string> kEight = {"extend_chunks/A0", "extend_chunks/A1", "extend_chunks/A2",
                                         "extend_chunks/A3", "extend_chunks/B0", "extend_chunks/B1",
                                         "extend_chunks/B2", "extend_chunks/B3"};
const RatioEntry kExtend{
    {.what = "extend the paper's terrain online to chunks, mean of 8 / per-voxel Perlin",
     .numerators = kEight,
     .denominator = "perlin_per_voxel",
     .bar = 0.03}};
const RatioEntry kExtendTuned{{.what = "the same / per-voxel Perlin tuned as hard",
                               .numerators = kEight,
                               .denominator = "perlin_tuned",
                               .bar = 0.6}};
const RatioEntry kExtendB3{{.what = "extend the paper's B3 online to chunks / per-voxel Perlin",
                            .numerators = {"extend_chunks/B3"},
                            .denominator = "perlin_per_voxel",
                            .bar = 0.06}};
const RatioEntry kStackPlain{
    {.what = "stack to limits, 12 layers, 256 high, no elements / per-voxel Perlin",
     .numerators = {"stack_limits/level0/plain"},
     .denominator = "perlin_per_voxel",
     .bar = 0.014}};
const RatioEntry kStackElements{
    {.what = "the same with vein and cave density 0.25 / per-voxel Perlin",
     .numerators = {"stack_limits/level0/elements"},
     .denominator = "perlin_per_voxel",
     .bar = 0.028}};
const RatioEntry kLevelFive{{.what = "generate a level-5 stack / a level-0 stack",
                             .numerators = {"stack_limits/level5/elements"},
                             .denominator = "stack_limits/level0/elements",
                             .bar = 3}};
const RatioEntry kNoise{{.what = "noise, rows of 64, AVX2, period 28 / scalar twin",
                         .numerators = {"noise_rows/avx2/28"},
                         .denominator = "noise_scalar/28",
                         .bar = 1.0 / 25}};

}  // namespace
}  // namespace terrane::bench
