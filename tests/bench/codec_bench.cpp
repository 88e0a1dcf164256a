// What coding a chunk stack costs beside generating it, and how small it gets.
//
// Counters: bytes_per_column is the record, zstd1 and zstd3 the same after compression.
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/load_world.h"
#include "generator/volume/chunk_codec.h"
#include "protocol/base/check.h"
#include "tests/bench/bench_world.h"
#include "tests/bench/ratios.h"

#include <benchmark/benchmark.h>
#include <zstd.h>

#include <filesystem>
#include <memory>
#include <vector>

namespace terrane {
namespace {

/// The paper's world with chunks of 32 x 32 x 32, as games use them.
std::shared_ptr<const World> paper_world() {
    const std::filesystem::path folder = std::filesystem::path(TERRANE_SOURCE_DIR) / "tests/data";
    WorldFileResult file = load_world_file(folder / "paper-B3-seed42.toml");
    file.definition.grid.side = file.definition.grid.height = 32;
    file.definition.grid.plot = 160;
    auto loaded = build_world(std::move(file), "paper-B3-seed42.toml");
    TERRANE_ASSERT(loaded.ok());
    return loaded.world;
}

std::vector<Stack> some_stacks() {
    constexpr std::int32_t kSide = 4;
    const auto world = paper_world();
    StackGenerator generator(*world);
    std::vector<Stack> stacks(static_cast<std::size_t>(kSide * kSide));
    for (std::int32_t i = 0; i < kSide * kSide; ++i) {
        const bool made = generator
                              .generate(stacks[static_cast<std::size_t>(i)],
                                        {.lod = 0, .x = i % kSide, .z = i / kSide})
                              .has_value();
        TERRANE_ASSERT(made);
    }
    return stacks;
}

double zstd_bytes(const Bytes& bytes, int level) {
    std::vector<char> out(ZSTD_compressBound(bytes.size()));
    return static_cast<double>(
        ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), level));
}

void count_sizes(benchmark::State& state, const std::vector<Bytes>& records, double columns) {
    double raw = 0;
    double zstd1 = 0;
    double zstd3 = 0;
    for (const Bytes& record : records) {
        raw += static_cast<double>(record.size());
        zstd1 += zstd_bytes(record, 1);
        zstd3 += zstd_bytes(record, 3);
    }
    state.counters["bytes_per_column"] = raw / columns;
    state.counters["zstd1"] = zstd1 / columns;
    state.counters["zstd3"] = zstd3 / columns;
}

double columns_of(const std::vector<Stack>& stacks) {
    return static_cast<double>(stacks.size()) * stacks[0].side * stacks[0].side;
}

void set_rate(benchmark::State& state, const std::vector<Stack>& stacks) {
    const auto columns = static_cast<std::int64_t>(stacks[0].side) * stacks[0].side;
    state.SetItemsProcessed(state.iterations() * columns);  // columns
}

void generate_stacks(benchmark::State& state) {
    const auto world = paper_world();
    StackGenerator generator(*world);
    Stack stack;
    std::int32_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(generator.generate(stack, {.lod = 0, .x = i % 64, .z = i / 64}));
        ++i;
    }
    state.SetItemsProcessed(state.iterations() * stack.side * stack.side);
}

void encode_stacks(benchmark::State& state) {
    const std::vector<Stack> stacks = some_stacks();
    std::vector<Bytes> records(stacks.size());
    std::size_t i = 0;
    for (auto _ : state) {
        encode_stack(records[i % stacks.size()], stacks[i % stacks.size()]);
        ++i;
    }
    for (std::size_t stack = 0; stack < stacks.size(); ++stack) {
        encode_stack(records[stack], stacks[stack]);
    }
    set_rate(state, stacks);
    count_sizes(state, records, columns_of(stacks));
}

void decode_stacks(benchmark::State& state) {
    const std::vector<Stack> stacks = some_stacks();
    std::vector<Bytes> records(stacks.size());
    for (std::size_t stack = 0; stack < stacks.size(); ++stack) {
        encode_stack(records[stack], stacks[stack]);
    }
    std::size_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(decode_stack(records[i++ % records.size()]));
    }
    set_rate(state, stacks);
}

/// Cuts the chunk that holds the surface.
std::vector<Chunk> surface_chunks(const std::vector<Stack>& stacks) {
    std::vector<Chunk> chunks(stacks.size());
    for (std::size_t i = 0; i < stacks.size(); ++i) {
        cut_chunk(chunks[i], stacks[i], 1, 32);
    }
    return chunks;
}

void cut_chunks(benchmark::State& state) {
    const std::vector<Stack> stacks = some_stacks();
    Chunk chunk;
    std::size_t i = 0;
    for (auto _ : state) {
        cut_chunk(chunk, stacks[i++ % stacks.size()], 1, 32);
    }
    set_rate(state, stacks);
}

void encode_chunks(benchmark::State& state, FlowPlane flow) {
    const std::vector<Stack> stacks = some_stacks();
    const std::vector<Chunk> chunks = surface_chunks(stacks);
    std::vector<Bytes> records(chunks.size());
    std::size_t i = 0;
    for (auto _ : state) {
        encode_chunk(records[i % chunks.size()], chunks[i % chunks.size()], flow);
        ++i;
    }
    for (std::size_t chunk = 0; chunk < chunks.size(); ++chunk) {
        encode_chunk(records[chunk], chunks[chunk], flow);
    }
    set_rate(state, stacks);
    count_sizes(state, records, columns_of(stacks));
}

const bench::RatioEntry kEncodeRatio{
    {.what = "encode a 32x32 stack of the paper's world / generate it",
     .numerators = {"encode_stacks"},
     .denominator = "generate_stacks",
     .bar = 4.0}};

constexpr std::int32_t kHighVoxels = 256;

/// The 256-high world: `density` of veins and caves in hundredths.
void generate_high(benchmark::State& state) {
    const auto world = bench::high_world(static_cast<double>(state.range(0)) / 100);
    StackGenerator generator(*world);
    Stack stack;
    std::int32_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(
            generator.generate(stack, {.lod = 0, .x = i % 16, .z = i / 16 % 16}));
        ++i;
    }
}

std::vector<Stack> high_stacks(double density) {
    const auto world = bench::high_world(density);
    StackGenerator generator(*world);
    std::vector<Stack> stacks(8);
    for (std::size_t i = 0; i < stacks.size(); ++i) {
        const auto x = static_cast<std::int32_t>(i);
        const bool made = generator.generate(stacks[i], {.lod = 0, .x = x, .z = 3}).has_value();
        TERRANE_ASSERT(made);
    }
    return stacks;
}

/// The whole height as one chunk, as a client of columns gets it.
void encode_high(benchmark::State& state, FlowPlane flow) {
    const std::vector<Stack> stacks = high_stacks(static_cast<double>(state.range(0)) / 100);
    std::vector<Chunk> chunks(stacks.size());
    for (std::size_t i = 0; i < stacks.size(); ++i) {
        cut_chunk(chunks[i], stacks[i], 0, kHighVoxels);
    }
    ChunkEncoder encoder;
    std::vector<Bytes> records(stacks.size());
    std::size_t i = 0;
    for (auto _ : state) {
        encoder.encode(records[i % stacks.size()], chunks[i % stacks.size()], flow);
        ++i;
    }
    for (std::size_t stack = 0; stack < stacks.size(); ++stack) {
        encoder.encode(records[stack], chunks[stack], flow);
    }
    count_sizes(state, records, columns_of(stacks));
    state.counters["zstd1_per_voxel"] =
        state.counters["zstd1"].value / static_cast<double>(kHighVoxels);
}

const bench::RatioEntry kEncodeHighRatio{
    {.what = "encode a 256-high stack as chunk bytes, without flow / generate it",
     .numerators = {"encode_high/without_flow/0"},
     .denominator = "generate_high/0",
     .bar = 0.5}};

BENCHMARK(generate_high)->Arg(0)->Arg(25);
BENCHMARK_CAPTURE(encode_high, with_flow, FlowPlane::with)->Arg(0)->Arg(25);
BENCHMARK_CAPTURE(encode_high, without_flow, FlowPlane::without)->Arg(0)->Arg(25);
BENCHMARK(generate_stacks);
BENCHMARK(encode_stacks);
BENCHMARK(decode_stacks);
BENCHMARK(cut_chunks);
BENCHMARK_CAPTURE(encode_chunks, with_flow, FlowPlane::with);
BENCHMARK_CAPTURE(encode_chunks, without_flow, FlowPlane::without);

}  // namespace
}  // namespace terrane
