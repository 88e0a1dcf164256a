// terrane verify: is this machine's terrain the same as that one's?
#include "server/cli/verify.h"

#include "generator/terrain/generate_stack.h"
#include "generator/terrain/kernels/kernel_choice.h"
#include "generator/terrain/world.h"
#include "generator/volume/chunk.h"
#include "generator/volume/chunk_codec.h"
#include "generator/volume/stack.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/hash.h"
#include "protocol/base/mutex.h"
#include "protocol/base/result.h"
#include "server/cli/area_options.h"
#include "server/cli/interrupt.h"
#include "server/cli/open_world.h"
#include "server/cli/program.h"
#include "server/cli/progress.h"
#include "server/cli/rectangle_work.h"

#include <CLI/CLI.hpp>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

namespace terrane {
namespace {

/// One worker's way from a stack to the sum of its chunks' hashes.
class StackHasher {
  public:
    explicit StackHasher(const World& world)
        : generator_(world),
          chunks_(chunks_in_stack(world)),
          height_(world.definition.grid.height) {}

    Result<void> add(AreaHash& sum, StackPos position) {
        if (auto made = generator_.generate(stack_, position); !made) {
            return made;
        }
        for (std::int32_t y = 0; y < chunks_; ++y) {
            cut_chunk(chunk_, stack_, y, height_);
            encode_chunk(encoded_, chunk_);
            bytes_.clear();
            ByteWriter writer(bytes_);
            writer.fixed(position.lod);
            writer.fixed(position.x);
            writer.fixed(y);
            writer.fixed(position.z);
            writer.raw(encoded_);
            sum.hash = sum_of(sum.hash, hash128(bytes_));
            ++sum.chunks;
        }
        return {};
    }

  private:
    StackGenerator generator_;
    const std::int32_t chunks_;
    const std::int32_t height_;
    Stack stack_;
    Chunk chunk_;
    Bytes encoded_;
    Bytes bytes_;
};

struct VerifyOptions {
    AreaOptions area;
    std::optional<std::uint64_t> shuffle_seed;
    bool as_json = false;
};

int run_verify(const VerifyOptions& options) {
    const auto batches = cut_area(options.area, options.shuffle_seed);
    if (!batches) {
        std::fprintf(stderr, "terrane: --rect: %s\n", batches.error().message.c_str());
        return kExitWrongUse;
    }
    const auto world = open_world(options.area.world_path);
    if (!world) {
        return kExitWrongUse;
    }
    InterruptWatch interrupt;
    Progress progress(batches->stacks(), "stacks", stderr, isatty(STDERR_FILENO) == 1);
    const auto area =
        hash_area(*world, *batches, workers_of(options.area), [&](std::uint64_t done) {
            progress.show(done);
            return !interrupt.interrupted();
        });
    progress.finish();
    if (!area) {
        std::fprintf(stderr, "terrane: %s\n", area.error().message.c_str());
        return kExitFailed;
    }
    if (!area->whole) {
        std::fprintf(stderr, "terrane: interrupted; an area has no hash before its end\n");
        return kExitFailed;
    }
    const auto kernels = kernel_set_from_environment();  // good: run_program looked at it
    const std::string simd(kernels ? kernels->name : available_kernel_sets().back().name);
    std::printf(options.as_json ? "{\"hash\":\"%s\",\"chunks\":%llu,\"simd\":\"%s\"}\n"
                                : "%s  %llu chunks  %s\n",
                to_hex(area->hash).c_str(), static_cast<unsigned long long>(area->chunks),
                simd.c_str());
    return kExitDone;
}

}  // namespace

std::int32_t chunks_in_stack(const World& world) {
    const auto bound = static_cast<std::int64_t>(std::floor(world.stack.height_bound));
    return static_cast<std::int32_t>(floor_div(bound, world.definition.grid.height)) + 1;
}

Result<AreaHash> hash_area(const World& world, const StackBatches& batches, std::size_t workers,
                           std::function<bool(std::uint64_t)> tick) {
    struct Total {
        Mutex mutex;
        AreaHash area TERRANE_GUARDED_BY(mutex);
    };

    Total total;
    const auto done = for_each_batch(
        batches, {.count = workers,
                  .make_step = [&]() -> BatchStep {
                      const auto hasher = std::make_shared<StackHasher>(world);
                      return [&total, hasher](std::span<const StackPos> stacks) -> Result<void> {
                          AreaHash sum;
                          for (const StackPos position : stacks) {
                              if (auto added = hasher->add(sum, position); !added) {
                                  return added;
                              }
                          }
                          const MutexLock lock(total.mutex);
                          total.area.hash = sum_of(total.area.hash, sum.hash);
                          total.area.chunks += sum.chunks;
                          return {};
                      };
                  },
                  .tick = std::move(tick)});
    if (!done) {
        return tl::unexpected(done.error());
    }
    const MutexLock lock(total.mutex);
    total.area.whole = *done == batches.stacks();
    return total.area;
}

void add_verify_command(CLI::App& app, int& exit_code) {
    const auto options = std::make_shared<VerifyOptions>();
    CLI::App* verify = app.add_subcommand("verify", "Print one hash of all chunks of an area");
    add_area_options(*verify, options->area);
    verify->add_option("--shuffle", options->shuffle_seed,
                       "Generate in the random order of this seed; the hash stays the same");
    verify->add_flag("--json", options->as_json, "{\"hash\":\"..\",\"chunks\":..,\"simd\":\"..\"}");
    verify->footer(
        "The hash is the sum mod 2^128, over every chunk of the area, of XXH3-128(key, chunk):\n"
        "the key is lod, x, y, z as little-endian int32, the chunk its bytes before compression.\n"
        "Of each stack all y count from 0 up to the chunk that holds the world's height bound\n"
        "('terrane world show' prints it), uniform chunks too. So the hash depends on the world,\n"
        "the area and the generator's version, never on workers, order or machine.\n"
        "The last word names the inner loops that made it, by default the fastest that this\n"
        "processor has; the environment's TERRANE_SIMD=scalar|sse2|avx2|avx512 forces one set.\n"
        "Example: terrane verify --world generator/worlds/basin.toml --rect -32,-32,32,32");
    verify->callback([options, &exit_code] { exit_code = run_verify(*options); });
}

}  // namespace terrane
