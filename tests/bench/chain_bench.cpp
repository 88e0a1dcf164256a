// A cold mesh, whole and stage by stage, against Draco's encoding alone; and two workers against
// one. Two worlds: the paper's B3 in stacks of 32 x 32, whose meshes have some 3,000 triangles, and
// basin, of more and thinner layers, with caves.
#include "generator/mesh/draco_codec.h"
#include "generator/mesh/height_field.h"
#include "generator/mesh/surface_nets.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "tests/bench/bench_world.h"
#include "tests/bench/ratios.h"

#include <benchmark/benchmark.h>

#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace terrane::bench {
namespace {

std::shared_ptr<const World> chain_world(const std::string& name) {
    const auto world = bench_world(name);
    WorldDefinition definition = world->definition;
    definition.grid.side = definition.grid.height = 32;
    auto wide = World::build(definition);
    if (!wide) {
        std::abort();
    }
    return std::make_shared<const World>(std::move(*wide));
}

/// What a worker has, and one stack after another, so that no cache holds the answer.
struct Chain {
    std::shared_ptr<const World> world;
    StackGenerator generator{*world};
    SurfaceNetsMesher mesher{world->definition};
    DracoSettings settings{
        .side = world->definition.grid.side,
        .height_voxels = static_cast<std::int32_t>(world->stack.height_bound) + 3};
    HeightRange heights{.first = 0, .last = settings.height_voxels};
    Stack stack;
    Mesh mesh;

    explicit Chain(const std::string& name) : world(chain_world(name)) {}

    bool generate(std::int64_t i) {
        const StackPos position{.lod = 0,
                                .x = static_cast<std::int32_t>(i % 1024) - 512,
                                .z = static_cast<std::int32_t>(i / 1024 % 1024)};
        return generator.generate(stack, position).has_value();
    }

    /// Every surface there is, those towards the apron too.
    void make_mesh() { mesher.mesh(mesh, stack, heights); }

    std::size_t encode() const {
        const auto bytes = encode_draco(mesh, settings);
        return bytes ? bytes->size() : 0;
    }
};

enum class Stage : std::uint8_t { generate, mesh, encode, whole };

double thread_seconds() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// The whole chain over the same stacks whatever stage is timed, so that each finds in the caches
/// what the one before left there.
void cold(benchmark::State& state, const std::string& name, Stage stage) {
    Chain chain(name);
    std::int64_t i = 0;
    std::size_t triangles = 0;
    for (auto _ : state) {
        const double begin = thread_seconds();
        chain.generate(i++);
        const double generated = thread_seconds();
        chain.make_mesh();
        const double meshed = thread_seconds();
        benchmark::DoNotOptimize(chain.encode());
        const double encoded = thread_seconds();
        triangles += chain.mesh.triangle_count();
        state.SetIterationTime(stage == Stage::generate ? generated - begin
                               : stage == Stage::mesh   ? meshed - generated
                               : stage == Stage::encode ? encoded - meshed
                                                        : encoded - begin);
    }
    state.counters["triangles"] =
        static_cast<double>(triangles) / static_cast<double>(state.iterations());
}

/// A coarse level's tile: generate, height field with skirts, encode.
void cold_level(benchmark::State& state) {
    Chain chain("basin");
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
    std::vector<std::unique_ptr<Chain>> chains;
    for (std::int64_t w = 0; w < workers; ++w) {
        chains.push_back(std::make_unique<Chain>("basin"));
    }
    std::int64_t round = 0;
    for (auto _ : state) {
        std::vector<std::jthread> threads;
        for (std::int64_t w = 0; w < workers; ++w) {
            threads.emplace_back(
                [&chain = *chains[static_cast<std::size_t>(w)], w, workers, round] {
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

void register_stages() {
    for (const std::string world : {"paper-B3", "basin"}) {
        const auto add = [&world](const std::string& name, Stage stage) {
            benchmark::RegisterBenchmark(
                (name + "/" + world).c_str(),
                [world, stage](benchmark::State& state) { cold(state, world, stage); })
                ->Iterations(128)
                ->UseManualTime()
                ->Unit(benchmark::kMicrosecond);
        };
        add("cold_generate", Stage::generate);
        add("cold_mesh", Stage::mesh);
        add("cold_encode", Stage::encode);
        add("cold_whole", Stage::whole);
    }
}

const bool kRegistered = (register_stages(), true);

BENCHMARK(cold_level)->Arg(1)->Arg(3)->Arg(5)->Arg(9)->Arg(17)->Unit(benchmark::kMicrosecond);
BENCHMARK(workers_whole)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

const RatioEntry kWholePaper{
    {.what = "whole cold mesh (generate, mesh, encode) / Draco's encode alone, paper's B3",
     .numerators = {"cold_whole/paper-B3"},
     .denominator = "cold_encode/paper-B3",
     .bar = 1.2}};
const RatioEntry kWholeBasin{{.what = "the same, basin",
                              .numerators = {"cold_whole/basin"},
                              .denominator = "cold_encode/basin",
                              .bar = 1.4}};
const RatioEntry kLevelsOf[] = {RatioEntry{{.what = "whole cold mesh of level 1 / of level 0",
                                            .numerators = {"cold_level/1"},
                                            .denominator = "cold_whole/basin",
                                            .bar = 1.3}},
                                RatioEntry{{.what = "whole cold mesh of level 5 / of level 0",
                                            .numerators = {"cold_level/5"},
                                            .denominator = "cold_whole/basin",
                                            .bar = 1.3}},
                                RatioEntry{{.what = "whole cold mesh of level 17 / of level 0",
                                            .numerators = {"cold_level/17"},
                                            .denominator = "cold_whole/basin",
                                            .bar = 1.3}}};
const RatioEntry kWorkers{{.what = "two workers / one worker, time for 64 cold meshes",
                           .numerators = {"workers_whole/2"},
                           .denominator = "workers_whole/1",
                           .bar = 1 / 1.85}};

}  // namespace
}  // namespace terrane::bench
