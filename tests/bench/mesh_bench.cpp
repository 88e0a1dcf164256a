// Meshing and Draco encoding of whole 32 x 32 stacks, in nanoseconds a triangle.
#include "generator/mesh/blocky.h"
#include "generator/mesh/draco_codec.h"
#include "generator/mesh/surface_nets.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "generator/world/world_file.h"
#include "tests/bench/ratios.h"

#include <benchmark/benchmark.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace terrane {
namespace {

constexpr std::int32_t kSide = 32;

/// Four neighbouring stacks of a test world (they fit the second cache, as a stack does that was
/// just made), cut to 32 x 32 columns whatever its file says.
struct Tiles {
    WorldDefinition definition;
    std::vector<Stack> stacks;
    std::int32_t highest_voxels = 0;

    explicit Tiles(const std::string& name) {
        WorldFileResult file = load_world_file(std::filesystem::path(TERRANE_SOURCE_DIR) /
                                               "tests/data" / (name + ".toml"));
        definition = file.definition;
        definition.grid.side = kSide;
        const auto world = World::build(definition);
        if (!file.faults.empty() || !world) {
            std::abort();
        }
        StackGenerator generator(*world);
        for (std::int32_t i = 0; i < 4; ++i) {
            Stack stack;
            if (!generator.generate(stack, {.lod = 0, .x = i % 2, .z = i / 2})) {
                std::abort();
            }
            for (const Limit& limit : stack.columns.limits) {
                highest_voxels = std::max(highest_voxels, limit.y256 / kUnitsPerVoxel + 1);
            }
            stacks.push_back(std::move(stack));
        }
    }

    HeightRange heights() const { return {.first = 0, .last = highest_voxels + 1}; }
};

constexpr const char* kWorlds[] = {"paper-B3-seed42", "dense-seed43", "edge-dense", "edge-many"};

void report(benchmark::State& state, const char* world, std::size_t triangles) {
    using benchmark::Counter;
    state.SetLabel(world);
    const auto count = static_cast<double>(triangles);
    state.counters["s/triangle"] = Counter(count, Counter::kIsRate | Counter::kInvert);
    state.counters["triangles"] = Counter(count, Counter::kAvgIterations);
}

template <typename Mesher>
void mesh_stack_with(benchmark::State& state) {
    const char* const name = kWorlds[state.range(0)];
    const Tiles tiles(name);
    Mesher mesher(tiles.definition);
    Mesh mesh;
    std::size_t next = 0;
    std::size_t triangles = 0;
    for (auto _ : state) {
        mesher.mesh(mesh, tiles.stacks[next++ % tiles.stacks.size()], tiles.heights());
        triangles += mesh.triangle_count();
        benchmark::DoNotOptimize(mesh.indices.data());
    }
    report(state, name, triangles);
}

void mesh_stack(benchmark::State& state) {
    mesh_stack_with<SurfaceNetsMesher>(state);
}

BENCHMARK(mesh_stack)->DenseRange(0, 3)->Unit(benchmark::kMicrosecond);

/// Blocks: fewer triangles, so compare times of whole stacks with mesh_stack's, not of triangles.
void mesh_blocks(benchmark::State& state) {
    mesh_stack_with<BlockyMesher>(state);
}

BENCHMARK(mesh_blocks)->DenseRange(0, 3)->Unit(benchmark::kMicrosecond);

template <typename Mesher>
void encode_stack_of(benchmark::State& state) {
    const char* const name = kWorlds[state.range(0)];
    const Tiles tiles(name);
    Mesher mesher(tiles.definition);
    std::vector<Mesh> meshes(tiles.stacks.size());
    for (std::size_t i = 0; i < meshes.size(); ++i) {
        mesher.mesh(meshes[i], tiles.stacks[i], tiles.heights());
    }
    const DracoSettings settings = {.side = kSide, .height_voxels = tiles.highest_voxels + 2};
    std::size_t next = 0;
    std::size_t triangles = 0;
    std::size_t bytes = 0;
    for (auto _ : state) {
        const Mesh& mesh = meshes[next++ % meshes.size()];
        const auto encoded = encode_draco(mesh, settings);
        triangles += mesh.triangle_count();
        bytes += encoded->size();
    }
    report(state, name, triangles);
    state.counters["bytes/triangle"] = static_cast<double>(bytes) / static_cast<double>(triangles);
}

void encode_stack(benchmark::State& state) {
    encode_stack_of<SurfaceNetsMesher>(state);
}

BENCHMARK(encode_stack)->DenseRange(0, 3)->Unit(benchmark::kMicrosecond);

void encode_blocks(benchmark::State& state) {
    encode_stack_of<BlockyMesher>(state);
}

BENCHMARK(encode_blocks)->DenseRange(0, 3)->Unit(benchmark::kMicrosecond);

void decode_stack(benchmark::State& state) {
    const char* const name = kWorlds[state.range(0)];
    const Tiles tiles(name);
    SurfaceNetsMesher mesher(tiles.definition);
    Mesh mesh;
    mesher.mesh(mesh, tiles.stacks[0], tiles.heights());
    const auto encoded =
        encode_draco(mesh, {.side = kSide, .height_voxels = tiles.highest_voxels + 2});
    std::size_t triangles = 0;
    for (auto _ : state) {
        triangles += decode_draco(*encoded)->triangle_count();
    }
    report(state, name, triangles);
}

BENCHMARK(decode_stack)->DenseRange(0, 3)->Unit(benchmark::kMicrosecond);

const bench::RatioEntry kMesh{
    {.what = "mesh of a 32 x 32 stack of 3,200 triangles / its Draco encode",
     .numerators = {"mesh_stack/1"},
     .denominator = "encode_stack/1",
     .bar = 0.08}};

}  // namespace
}  // namespace terrane
