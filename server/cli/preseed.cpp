// terrane preseed: generates an area ahead of time.
#include "server/cli/preseed.h"

#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "generator/volume/chunk_codec.h"
#include "generator/volume/stack.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/chunks/store_identity.h"
#include "server/cli/area_options.h"
#include "server/cli/interrupt.h"
#include "server/cli/open_world.h"
#include "server/cli/program.h"
#include "server/cli/progress.h"
#include "server/cli/rectangle_work.h"
#include "storage/chunk_store.h"
#include "storage/rocksdb_store.h"

#include <CLI/CLI.hpp>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace terrane {
namespace {

/// One worker's way from stacks to records.
class StackFiller {
  public:
    StackFiller(const World& world, ChunkStore& store) : generator_(world), store_(store) {}

    /// How many of the stacks had to be made.
    Result<std::uint64_t> fill(std::span<const StackPos> stacks) {
        std::vector<RecordKey> keys;
        for (const StackPos position : stacks) {
            keys.push_back(stack_record_key(position));
        }
        const auto present = store_.get_many(keys);
        if (!present) {
            return tl::unexpected(present.error());
        }
        std::vector<Bytes> values(stacks.size());
        std::vector<RecordToPut> records;
        for (std::size_t i = 0; i < stacks.size(); ++i) {
            if ((*present)[i]) {
                continue;
            }
            if (const auto made = generator_.generate(stack_, stacks[i]); !made) {
                return tl::unexpected(made.error());
            }
            encode_stack(values[i], stack_);
            records.push_back({.key = keys[i], .value = values[i]});
        }
        if (records.empty()) {
            return 0;
        }
        if (const auto put = store_.put(records); !put) {
            return tl::unexpected(put.error());
        }
        return records.size();
    }

  private:
    StackGenerator generator_;
    ChunkStore& store_;
    Stack stack_;
};

struct PreseedOptions {
    AreaOptions area;
    std::string data_path;
    bool as_json = false;
};

void print_outcome(const PreseedOptions& options, const Preseeded& outcome, double seconds) {
    const auto generated = static_cast<unsigned long long>(outcome.stacks_generated);
    const auto present = static_cast<unsigned long long>(outcome.stacks_present);
    const double per_second = seconds > 0 ? static_cast<double>(generated) / seconds : 0;
    if (options.as_json) {
        std::printf(
            "{\"generated\":%llu,\"present\":%llu,\"seconds\":%.3f,\"stacks_per_second\":%.1f,"
            "\"whole\":%s}\n",
            generated, present, seconds, per_second, outcome.whole ? "true" : "false");
    } else {
        std::printf("%llu stacks generated, %llu were there, %s, %.1f stacks/s\n", generated,
                    present, format_duration(seconds).c_str(), per_second);
    }
}

int run_preseed(const PreseedOptions& options) {
    const auto batches = cut_area(options.area);
    if (!batches) {
        std::fprintf(stderr, "terrane: --rect: %s\n", batches.error().message.c_str());
        return kExitWrongUse;
    }
    const auto world = open_world(options.area.world_path);
    if (!world) {
        return kExitWrongUse;
    }
    InterruptWatch interrupt;  // before the store, which has threads of its own
    const auto store = open_rocksdb_store(options.data_path, store_identity_of(*world));
    if (!store) {
        std::fprintf(stderr, "terrane: %s\n", store.error().message.c_str());
        return kExitFailed;
    }
    const auto begin = std::chrono::steady_clock::now();
    Progress progress(batches->stacks(), "stacks", stderr, isatty(STDERR_FILENO) == 1);
    const auto outcome =
        preseed_area(*world, **store, *batches, workers_of(options.area), [&](std::uint64_t done) {
            progress.show(done);
            return !interrupt.interrupted();
        });
    progress.finish();
    if (!outcome) {
        std::fprintf(
            stderr,
            "terrane: %s\nterrane: what was stored stays; run the same command again to go "
            "on from there\n",
            outcome.error().message.c_str());
        return kExitFailed;
    }
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
    print_outcome(options, *outcome, taken.count());
    if (!outcome->whole) {
        const unsigned long long present = outcome->stacks_generated + outcome->stacks_present;
        std::fprintf(
            stderr,
            "terrane: interrupted after %llu of %llu stacks; run the same command again to "
            "go on from there\n",
            present, static_cast<unsigned long long>(batches->stacks()));
        return kExitFailed;
    }
    return kExitDone;
}

}  // namespace

Result<Preseeded> preseed_area(const World& world, ChunkStore& store, const StackBatches& batches,
                               std::size_t workers, std::function<bool(std::uint64_t)> tick) {
    std::atomic<std::uint64_t> generated = 0;
    const auto done = for_each_batch(
        batches, {.count = workers,
                  .make_step = [&]() -> BatchStep {
                      const auto filler = std::make_shared<StackFiller>(world, store);
                      return
                          [&generated, filler](std::span<const StackPos> stacks) -> Result<void> {
                              const auto made = filler->fill(stacks);
                              if (!made) {
                                  return tl::unexpected(made.error());
                              }
                              generated += *made;
                              return {};
                          };
                  },
                  .tick = std::move(tick)});
    const auto flushed = store.flush();
    if (!done) {
        return tl::unexpected(done.error());
    }
    if (!flushed) {
        return tl::unexpected(flushed.error());
    }
    return Preseeded{.stacks_generated = generated,
                     .stacks_present = *done - generated,
                     .whole = *done == batches.stacks()};
}

void add_preseed_command(CLI::App& app, int& exit_code) {
    const auto options = std::make_shared<PreseedOptions>();
    CLI::App* preseed = app.add_subcommand("preseed", "Generate an area into a data directory");
    add_area_options(*preseed, options->area);
    preseed->add_option("--data", options->data_path, "Data directory; made if it is not there")
        ->required();
    preseed->add_flag("--json", options->as_json, "One JSON object when it ends");
    preseed->footer(
        "Stacks that are stored already are left as they are: after Ctrl-C, a failure or a power\n"
        "cut the same command goes on where it ended. Exit code: 0 all is stored, 1 not all, 2 a\n"
        "bad flag or world file.\n"
        "Example: terrane preseed --world generator/worlds/basin.toml --data data --rect "
        "-16,-16,16,16");
    preseed->callback([options, &exit_code] { exit_code = run_preseed(*options); });
}

}  // namespace terrane
