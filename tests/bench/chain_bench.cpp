// A cold mesh, whole and stage by stage, against Draco's encoding alone; and two workers against
// one.
#include "generator/mesh/draco_codec.h"
#include "generator/mesh/height_field.h"
#include "generator/mesh/surface_nets.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "tests/bench/bench_world.h"
#include "tests/bench/ratios.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace terrane::bench {
namespace {

constexpr const char* kWorld = "basin";

/// What a worker has, and one stack after another, so that no cache holds the answer.
struct Chain {
    std::shared_ptr<const World> world = bench_world(kWorld);
    StackGenerator generator{*world};
    SurfaceNetsMesher mesher{world->definition};
    DracoSettings settings{
        .side = world->definition.grid.side,
        .height_voxels = static_cast<std::int32_t>(world->stack.height_bound) + 3};
    Stack stack;
    Mesh mesh;

    bool generate(std::int64_t i) {
        const StackPos position{.lod = 0,
                                .x = static_cast<std::int32_t>(i % 1024) - 512,
                                .z = static_cast<std::int32_t>(i / 1024 % 1024)};
        return generator.generate(stack, position).has_value();
    }

    void make_mesh() { mesher.mesh(mesh, stack, heights_of(stack)); }

    /// Every surface there is, those towards the apron too.
    static HeightRange heights_of(const Stack& stack) {
        std::int32_t highest = 0;
        const ColumnGrid& columns = stack.columns;
        for (std::size_t i = 1; i < columns.offsets.size(); ++i) {
            highest = std::max(highest, columns.limits[columns.offsets[i] - 1].y256);
        }
        return {.first = 0, .last = highest / kUnitsPerVoxel + 2};
    }

    std::size_t encode() const {
        const auto bytes = encode_draco(mesh, settings);
        return bytes ? bytes->size() : 0;
    }
};

void cold_generate(benchmark::State& state) {
    Chain chain;
    std::int64_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(chain.generate(i++));
    }
}

/// A few stacks, made beforehand.
struct Prepared {
    Chain chain;
    std::vector<Stack> stacks = std::vector<Stack>(16);
    std::vector<Mesh> meshes = std::vector<Mesh>(16);

    Prepared() {
        for (std::size_t i = 0; i < stacks.size(); ++i) {
            chain.generate(static_cast<std::int64_t>(i) * 17);
            stacks[i] = chain.stack;
            chain.make_mesh();
            meshes[i] = chain.mesh;
        }
    }
};

void cold_mesh(benchmark::State& state) {
    Prepared prepared;
    std::size_t i = 0;
    std::size_t triangles = 0;
    for (auto _ : state) {
        const Stack& stack = prepared.stacks[i++ % 16];
        prepared.chain.mesher.mesh(prepared.chain.mesh, stack, Chain::heights_of(stack));
        triangles += prepared.chain.mesh.triangle_count();
    }
    state.counters["triangles"] =
        static_cast<double>(triangles) / static_cast<double>(state.iterations());
}

void cold_encode(benchmark::State& state) {
    Prepared prepared;
    std::size_t i = 0;
    for (auto _ : state) {
        const auto bytes = encode_draco(prepared.meshes[i++ % 16], prepared.chain.settings);
        benchmark::DoNotOptimize(bytes->data());
    }
}

void cold_whole(benchmark::State& state) {
    Chain chain;
    std::int64_t i = 0;
    for (auto _ : state) {
        chain.generate(i++);
        chain.make_mesh();
        benchmark::DoNotOptimize(chain.encode());
    }
}

/// A coarse level's tile: generate, height field with skirts, encode.
void cold_level(benchmark::State& state) {
    Chain chain;
    HeightFieldMesher mesher(chain.world->definition);
    std::int32_t i = 0;
    for (auto _ : state) {
        const StackPos position{.lod = static_cast<std::int32_t>(state.range(0)),
                                .x = i % 256 - 128,
                                .z = i / 256 % 256};
        benchmark::DoNotOptimize(chain.generator.generate(chain.stack, position));
        mesher.mesh(chain.mesh, chain.stack, true);
        benchmark::DoNotOptimize(chain.encode());
        ++i;
    }
}

/// `workers` threads, each with a chain of its own, share 64 stacks: each takes a stretch, as the
/// regions of `preseed` are shared out, so that no plot is made twice.
void workers_whole(benchmark::State& state) {
    const auto workers = static_cast<std::int64_t>(state.range(0));
    constexpr std::int64_t kStacks = 64;
    std::vector<Chain> chains(static_cast<std::size_t>(workers));
    std::int64_t round = 0;
    for (auto _ : state) {
        std::vector<std::jthread> threads;
        for (std::int64_t w = 0; w < workers; ++w) {
            threads.emplace_back([&chain = chains[static_cast<std::size_t>(w)], w, workers, round] {
                const std::int64_t share = kStacks / workers;
                for (std::int64_t i = w * share; i < (w + 1) * share; ++i) {
                    chain.generate(round * kStacks + i);
                    chain.make_mesh();
                    benchmark::DoNotOptimize(chain.encode());
                }
            });
        }
        threads.clear();
        ++round;
    }
}

BENCHMARK(cold_generate)->Unit(benchmark::kMicrosecond);
BENCHMARK(cold_mesh)->Unit(benchmark::kMicrosecond);
BENCHMARK(cold_encode)->Unit(benchmark::kMicrosecond);
BENCHMARK(cold_whole)->Unit(benchmark::kMicrosecond);
BENCHMARK(cold_level)->Arg(1)->Arg(3)->Arg(5)->Arg(9)->Arg(17)->Unit(benchmark::kMicrosecond);
BENCHMARK(workers_whole)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

const RatioEntry kWhole{{.what = "whole cold mesh (generate, mesh, encode) / Draco's encode alone",
                         .numerators = {"cold_whole"},
                         .denominator = "cold_encode",
                         .bar = 1.4}};
const RatioEntry kLevelsOf[] = {RatioEntry{{.what = "whole cold mesh of level 1 / of level 0",
                                            .numerators = {"cold_level/1"},
                                            .denominator = "cold_whole",
                                            .bar = 1.3}},
                                RatioEntry{{.what = "whole cold mesh of level 5 / of level 0",
                                            .numerators = {"cold_level/5"},
                                            .denominator = "cold_whole",
                                            .bar = 1.3}},
                                RatioEntry{{.what = "whole cold mesh of level 17 / of level 0",
                                            .numerators = {"cold_level/17"},
                                            .denominator = "cold_whole",
                                            .bar = 1.3}}};
const RatioEntry kMesh{{.what = "mesh / its Draco encode",
                        .numerators = {"cold_mesh"},
                        .denominator = "cold_encode",
                        .bar = 0.08}};
const RatioEntry kWorkers{{.what = "two workers / one worker, time for 64 cold meshes",
                           .numerators = {"workers_whole/2"},
                           .denominator = "workers_whole/1",
                           .bar = 1 / 1.85}};

}  // namespace
}  // namespace terrane::bench
