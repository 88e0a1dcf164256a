#include "server/cli/area_options.h"

#include "protocol/base/result.h"
#include "server/chunks/worker_pool.h"
#include "server/cli/arguments.h"
#include "server/cli/rectangle_work.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <thread>

namespace terrane {

void add_area_options(CLI::App& command, AreaOptions& options) {
    command.add_option("--world", options.world_path, "World file")->required();
    command
        .add_option("--rect", options.rectangle,
                    "X0,Z0,X1,Z1 in chunks; X1 and Z1 are excluded. At most 4096 x 4096 in all")
        ->required();
    command.add_option("--workers", options.workers, "Threads; as many as processors if not given")
        ->check(CLI::Range(std::size_t{1}, kWorkersMax));
}

Result<StackBatches> cut_area(const AreaOptions& options,
                              std::optional<std::uint64_t> shuffle_seed) {
    const auto rectangle = parse_stack_rectangle(options.rectangle);
    if (!rectangle) {
        return tl::unexpected(rectangle.error());
    }
    return StackBatches::cut(*rectangle, shuffle_seed);
}

std::size_t workers_of(const AreaOptions& options) {
    if (options.workers > 0) {
        return options.workers;
    }
    return std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, kWorkersMax);
}

}  // namespace terrane
