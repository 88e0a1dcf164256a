// What landscapes cost beside version 1 on the same stack of layers: the same world with and
// without structure, relief and caves.
#include "generator/terrain/generate_stack.h"
#include "tests/bench/bench_world.h"
#include "tests/bench/ratios.h"
#include "tests/bench/thread_clock.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
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

/// One worker's way over the stacks of a world.
struct Walk {
    explicit Walk(const World& of) : world(of), generator(of) {}

    bool make(const StackPos& position) {
        const bool is_made = generator.generate(stack, position).has_value();
        limits += static_cast<std::int64_t>(stack.columns.limits.size());
        columns += static_cast<std::int64_t>(stack.columns.offsets.size()) - 1;
        return is_made;
    }

    double limits_per_column() const {
        return static_cast<double>(limits) /
               static_cast<double>(std::max<std::int64_t>(1, columns));
    }

    const World& world;
    StackGenerator generator;
    Stack stack;
    std::int64_t limits = 0;
    std::int64_t columns = 0;
};

void generate(benchmark::State& state, const World& world, std::int32_t lod,
              Order order = Order::next_to_each_other) {
    Walk walk(world);
    std::int32_t n = 0;
    for (auto _ : state) {
        if (!walk.make(stack_at(n++, order, lod))) {
            state.SkipWithError("a stack was not made");
            return;
        }
    }
    const auto a_column = benchmark::Counter::kIsRate | benchmark::Counter::kInvert;
    state.counters["s_per_column"] =
        benchmark::Counter(static_cast<double>(state.iterations()) * world.definition.grid.side *
                               world.definition.grid.side,
                           a_column);
    state.counters["limits_per_column"] = walk.limits_per_column();
}

/// Rows of stacks of both worlds in turn, so that what else the machine does is done to both; the
/// counters are seconds a stack.
void compare(benchmark::State& state, const World& plain, const World& landscape) {
    Walk before(plain);
    Walk after(landscape);
    std::array<double, 2> seconds{};
    for (auto _ : state) {
        for (std::int32_t row = 0; row < kStacksAside; ++row) {
            for (Walk* walk : {&before, &after}) {
                const double begin = thread_seconds();
                for (std::int32_t i = 0; i < kStacksAside; ++i) {
                    const std::int32_t n = row * kStacksAside + i;
                    if (!walk->make(stack_at(n, Order::next_to_each_other, 0))) {
                        state.SkipWithError("a stack was not made");
                        return;
                    }
                }
                seconds[walk == &after ? 1 : 0] += thread_seconds() - begin;
            }
        }
    }
    const double made = static_cast<double>(state.iterations() * kStacks);
    state.counters["version_1_s"] = seconds[0] / made;
    state.counters["version_2_s"] = seconds[1] / made;
    state.counters["limits_per_column"] = after.limits_per_column();
}

[[maybe_unused]] const int kRegistered = [] {
    for (const char* const world_name : {"canyon", "karst", "fold", "range", "alpine", "coast"}) {
        const std::string name = world_name;
        const auto world = bench_world(name);
        const auto plain = plain_world(*world);
        benchmark::RegisterBenchmark(("landscape/" + name).c_str(), [plain,
                                                                     world](benchmark::State& s) {
            compare(s, *plain, *world);
        })->Iterations(1);
        ratios().push_back(
            {.what = std::string("a stack of ") + name + " / of the same layers as version 1",
             .numerators = {"landscape/" + name + ":version_2"},
             .denominator = "landscape/" + name + ":version_1",
             .bar = name == "canyon" ? 2.2 : 2.5});
        benchmark::RegisterBenchmark(("landscape/apart/" + name).c_str(), [world](
                                                                              benchmark::State& s) {
            generate(s, *world, 0, Order::apart);
        })->Iterations(kStacks);
    }
    const auto canyon = bench_world("canyon");
    for (const std::int32_t lod : {0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 13, 17}) {
        const std::string level = std::to_string(lod);
        benchmark::RegisterBenchmark(
            ("landscape/level/" + level).c_str(),
            [canyon, lod](benchmark::State& s) { generate(s, *canyon, lod); })
            ->Iterations(kStacks);
        if (lod > 0) {
            ratios().push_back(
                {.what = std::string("a tile of level ") + level + " of canyon / a level-0 stack",
                 .numerators = {"landscape/level/" + level},
                 .denominator = "landscape/level/0",
                 .bar = 4});
        }
    }
    return 0;
}();

}  // namespace
}  // namespace terrane::bench
