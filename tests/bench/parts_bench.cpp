// The parts that a stack is made of, one by one: heights of layers, elements on their squares; and
// voxels out of its limits.
#include "generator/terrain/element.h"
#include "generator/terrain/element_shape.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/kernels/kernel_choice.h"
#include "generator/volume/voxel.h"
#include "tests/bench/bench_world.h"

#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace terrane::bench {
namespace {

constexpr std::int32_t kSide = 64;
constexpr std::int32_t kColumns = kSide * kSide;

/// Eq. 4 of one layer over 64 x 64 columns.
void heights(benchmark::State& state, const RowKernels* kernels) {
    std::vector<float> noise(kColumns);
    for (std::size_t i = 0; i < noise.size(); ++i) {
        noise[i] = static_cast<float>(i % 7) * 0.1F - 0.3F;
    }
    std::vector<float> stacked(kColumns, 1.0F);
    std::vector<float> height(kColumns);
    const HeightConstants constants = {
        .below = 20.0F, .similarity = 0.8F, .roughness = 3.0F, .top = 24.0F};
    for (auto _ : state) {
        kernels->heights(height.data(), stacked.data(), noise.data(), kColumns, constants);
        benchmark::DoNotOptimize(height.data());
        benchmark::ClobberMemory();
    }
    state.SetItemsProcessed(state.iterations() * kColumns);
}

/// Eq. 6 of a plot's elements, one after the other, each over all of its own square.
void elements(benchmark::State& state, const RowKernels* kernels) {
    const auto world = high_world(0.25);
    std::vector<Element> drawn;
    draw_plot(drawn, *world, {.x = 1, .z = 0});
    std::erase_if(drawn, [](const Element& element) { return element.side < 1; });
    if (drawn.empty()) {
        state.SkipWithError("a plot without elements");
        return;
    }
    std::vector<ElementShape> shapes;
    for (const Element& element : drawn) {
        shapes.push_back(make_shape(element));
    }
    RasterBuffers buffers;
    std::vector<float> raster;
    std::size_t next = 0;
    std::int64_t columns = 0;
    for (auto _ : state) {
        const Element& element = drawn[next];
        const auto side = static_cast<std::int32_t>(std::ceil(element.side));
        const LocalRectangle square = {
            .x0 = static_cast<std::int64_t>(std::floor(element.center_x - element.side / 2)),
            .z0 = static_cast<std::int64_t>(std::floor(element.center_z - element.side / 2)),
            .width = side,
            .length = side};
        raster.resize(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
        raster_element(raster.data(), side, element, shapes[next], square, *kernels, buffers);
        benchmark::DoNotOptimize(raster.data());
        columns += std::int64_t{side} * side;
        next = (next + 1) % drawn.size();
    }
    state.SetItemsProcessed(columns);
}

/// Every voxel of a stack of 32 x 32 columns, 256 high.
void expand_voxels(benchmark::State& state) {
    const auto world = high_world(0.25);
    StackGenerator generator(*world);
    Stack stack;
    if (!generator.generate(stack, {.lod = 0, .x = 3, .z = 5})) {
        state.SkipWithError("out of range");
        return;
    }
    std::vector<Voxel> voxels(256);
    std::int64_t count = 0;
    for (auto _ : state) {
        for (std::int32_t z = 0; z < stack.side; ++z) {
            for (std::int32_t x = 0; x < stack.side; ++x) {
                expand_column(voxels, stack.columns.column(x, z), stack.palette, 0);
                benchmark::DoNotOptimize(voxels.data());
                benchmark::ClobberMemory();
                count += static_cast<std::int64_t>(voxels.size());
            }
        }
    }
    state.SetItemsProcessed(count);
}

void register_parts() {
    for (const KernelSet& set : available_kernel_sets()) {
        const std::string name(set.name);
        benchmark::RegisterBenchmark(
            ("heights/" + name).c_str(),
            [kernels = set.kernels](benchmark::State& state) { heights(state, kernels); });
        benchmark::RegisterBenchmark(
            ("elements/" + name).c_str(),
            [kernels = set.kernels](benchmark::State& state) { elements(state, kernels); });
    }
    benchmark::RegisterBenchmark("expand_voxels", expand_voxels);
}

const bool kPartsRegistered = (register_parts(), true);

}  // namespace
}  // namespace terrane::bench
