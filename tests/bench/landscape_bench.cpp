// What landscapes cost beside version 1 on the same stack of layers: the same world with and
// without structure, relief and caves.
#include "generator/terrain/generate_stack.h"
#include "tests/bench/bench_world.h"

#include <benchmark/benchmark.h>

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

namespace terrane::bench {
namespace {

/// The world without what format 2 adds.
std::shared_ptr<const World> plain_world(const World& world) {
    WorldDefinition definition = world.definition;
    definition.structure = {};
    definition.relief = {};
    definition.caves = {};
    auto plain = World::build(std::move(definition));
    return std::make_shared<const World>(std::move(*plain));
}

/// Each run makes the same ones, however fast the machine is: places differ much in what they cost.
constexpr std::int32_t kStacksAside = 16;
constexpr std::int64_t kStacks = std::int64_t{kStacksAside} * kStacksAside;

enum class Order : std::uint8_t {
    next_to_each_other,  ///< as viewers ask for them, and one worker makes them
    apart                ///< never one beside the one before
};

StackPos stack_at(std::int32_t n, Order order, std::int32_t lod) {
    if (order == Order::apart) {
        n = n * 37 % static_cast<std::int32_t>(kStacks);  // (5, 2) further on each time
    }
    return {.lod = lod, .x = n % kStacksAside, .z = n / kStacksAside % kStacksAside};
}

void generate(benchmark::State& state, const World& world, std::int32_t lod,
              Order order = Order::next_to_each_other) {
    StackGenerator generator(world);
    Stack stack;
    std::int32_t n = 0;
    std::int64_t limits = 0;
    std::int64_t columns = 0;
    for (auto _ : state) {
        if (auto made = generator.generate(stack, stack_at(n, order, lod)); !made) {
            state.SkipWithError(made.error().message.c_str());
            return;
        }
        ++n;
        limits += static_cast<std::int64_t>(stack.columns.limits.size());
        columns += static_cast<std::int64_t>(stack.columns.offsets.size()) - 1;
    }
    const auto a_column = benchmark::Counter::kIsRate | benchmark::Counter::kInvert;
    state.counters["s_per_column"] =
        benchmark::Counter(static_cast<double>(state.iterations()) * world.definition.grid.side *
                               world.definition.grid.side,
                           a_column);
    state.counters["limits_per_column"] =
        static_cast<double>(limits) / static_cast<double>(std::max<std::int64_t>(1, columns));
}

[[maybe_unused]] const int kRegistered = [] {
    for (const char* name : {"canyon", "karst", "fold", "range", "alpine", "coast"}) {
        const auto world = bench_world(name);
        const auto plain = plain_world(*world);
        benchmark::RegisterBenchmark((std::string("landscape/version_1/") + name).c_str(),
                                     [plain](benchmark::State& s) { generate(s, *plain, 0); })
            ->Iterations(kStacks);
        benchmark::RegisterBenchmark((std::string("landscape/version_2/") + name).c_str(),
                                     [world](benchmark::State& s) { generate(s, *world, 0); })
            ->Iterations(kStacks);
        benchmark::RegisterBenchmark(
            (std::string("landscape/apart/") + name).c_str(),
            [world](benchmark::State& s) { generate(s, *world, 0, Order::apart); })
            ->Iterations(kStacks);
    }
    const auto canyon = bench_world("canyon");
    for (const std::int32_t lod : {0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 13, 17}) {
        benchmark::RegisterBenchmark(
            ("landscape/level/" + std::to_string(lod)).c_str(),
            [canyon, lod](benchmark::State& s) { generate(s, *canyon, lod); })
            ->Iterations(kStacks);
    }
    return 0;
}();

}  // namespace
}  // namespace terrane::bench
