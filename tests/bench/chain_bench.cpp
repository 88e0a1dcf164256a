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
#include "tests/bench/thread_clock.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <span>
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

/// The whole chain over one stack after another; each stage's seconds a stack are a counter.
void cold(benchmark::State& state, const std::string& name) {
    Chain chain(name);
    std::int64_t i = 0;
    std::size_t triangles = 0;
    std::array<double, 3> stages{};  // generate, mesh, encode
    for (auto _ : state) {
        const double begin = thread_seconds();
        chain.generate(i++);
        const double generated = thread_seconds();
        chain.make_mesh();
        const double meshed = thread_seconds();
        benchmark::DoNotOptimize(chain.encode());
        const double encoded = thread_seconds();
        triangles += chain.mesh.triangle_count();
        stages[0] += generated - begin;
        stages[1] += meshed - generated;
        stages[2] += encoded - meshed;
    }
    const auto a_stack = [&state](double sum) {
        return sum / static_cast<double>(state.iterations());
    };
    state.counters["triangles"] = a_stack(static_cast<double>(triangles));
    state.counters["generate_s"] = a_stack(stages[0]);
    state.counters["mesh_s"] = a_stack(stages[1]);
    state.counters["encode_s"] = a_stack(stages[2]);
    state.counters["whole_s"] = a_stack(stages[0] + stages[1] + stages[2]);
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

/// Seconds until all of `workers` threads have done `work(number of the thread)`.
template <typename Work>
double timed_threads(std::size_t workers, const Work& work) {
    const auto begin = std::chrono::steady_clock::now();
    {
        std::vector<std::jthread> threads;
        for (std::size_t worker = 0; worker < workers; ++worker) {
            threads.emplace_back([&work, worker] { work(worker); });
        }
    }
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

constexpr std::int64_t kRoundStacks = 64;

/// Each chain makes the cold meshes of its own stretch of a round's stacks, as the regions of
/// `preseed` are shared out, so that no plot is made twice.
double timed_round(std::span<const std::unique_ptr<Chain>> chains, std::int64_t round) {
    return timed_threads(chains.size(), [chains, round](std::size_t worker) {
        Chain& chain = *chains[worker];
        const auto share = kRoundStacks / static_cast<std::int64_t>(chains.size());
        const std::int64_t first = round * kRoundStacks + share * static_cast<std::int64_t>(worker);
        for (std::int64_t i = first; i < first + share; ++i) {
            chain.generate(i);
            chain.make_mesh();
            benchmark::DoNotOptimize(chain.encode());
        }
    });
}

/// Work that needs nothing but a core's registers and adders: what it gains by a second thread is
/// all that the machine has to give.
void add_in_registers(std::int64_t count) {
    std::array<std::uint64_t, 8> sums{};
    for (std::int64_t i = 0; i < count; ++i) {
        for (std::uint64_t& sum : sums) {
            benchmark::DoNotOptimize(sum += sum + 1);
        }
    }
}

double timed_additions(std::size_t workers) {
    static constexpr std::int64_t kAdditions = 16'000'000;
    return timed_threads(workers, [workers](std::size_t) {
        add_in_registers(kAdditions / static_cast<std::int64_t>(workers));
    });
}

/// One worker and two take turns at the same stacks, and one thread and two at additions: a machine
/// that others use as well is not the same from one second to the next. The iteration's time is all
/// four's.
void workers(benchmark::State& state) {
    const auto chains_of = [](std::size_t count) {
        std::vector<std::unique_ptr<Chain>> chains;
        std::generate_n(std::back_inserter(chains), count,
                        [] { return std::make_unique<Chain>("basin"); });
        return chains;
    };
    const auto alone = chains_of(1);
    const auto two = chains_of(2);
    // Buffers grow to their size.
    timed_round(alone, 0);
    timed_round(two, 0);
    std::int64_t round = 1;
    std::array<double, 4> seconds{};
    for (auto _ : state) {
        seconds[0] += timed_round(alone, round);
        seconds[1] += timed_round(two, round);
        seconds[2] += timed_additions(1);
        seconds[3] += timed_additions(2);
        ++round;
    }
    const std::array<const char*, 4> names = {"one_s", "two_s", "additions_one_s",
                                              "additions_two_s"};
    for (std::size_t i = 0; i < names.size(); ++i) {
        state.counters[names[i]] = seconds[i] / static_cast<double>(state.iterations());
    }
}

BENCHMARK_CAPTURE(cold, paper_B3, "paper-B3")->Iterations(128)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(cold, basin, "basin")->Iterations(128)->Unit(benchmark::kMicrosecond);
BENCHMARK(cold_level)->Arg(1)->Arg(3)->Arg(5)->Arg(9)->Arg(17)->Unit(benchmark::kMicrosecond);
BENCHMARK(workers)->Iterations(4)->UseRealTime()->Unit(benchmark::kMillisecond);

const RatioEntry kWholePaper{
    {.what = "whole cold mesh (generate, mesh, encode) / Draco's encode alone, paper's B3",
     .numerators = {"cold/paper_B3:whole"},
     .denominator = "cold/paper_B3:encode",
     .bar = 1.2}};
const RatioEntry kWholeBasin{{.what = "the same, basin",
                              .numerators = {"cold/basin:whole"},
                              .denominator = "cold/basin:encode",
                              .bar = 1.4}};
const RatioEntry kLevelsOf[] = {RatioEntry{{.what = "whole cold mesh of level 1 / of level 0",
                                            .numerators = {"cold_level/1"},
                                            .denominator = "cold/basin:whole",
                                            .bar = 1.3}},
                                RatioEntry{{.what = "whole cold mesh of level 5 / of level 0",
                                            .numerators = {"cold_level/5"},
                                            .denominator = "cold/basin:whole",
                                            .bar = 1.3}},
                                RatioEntry{{.what = "whole cold mesh of level 17 / of level 0",
                                            .numerators = {"cold_level/17"},
                                            .denominator = "cold/basin:whole",
                                            .bar = 1.3}}};
const RatioEntry kWorkers{{.what = "two workers / one worker, time for 64 cold meshes",
                           .numerators = {"workers:two"},
                           .denominator = "workers:one",
                           .bar = 1 / 1.85}};
const RatioEntry kMachine{
    {.what = "the same of additions in registers: what this machine's two cores give",
     .numerators = {"workers:additions_two"},
     .denominator = "workers:additions_one",
     .bar = 1}};

}  // namespace
}  // namespace terrane::bench
