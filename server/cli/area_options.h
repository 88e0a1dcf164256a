// The options that every command over an area has: --world, --rect, --workers.
#pragma once

#include "protocol/base/result.h"
#include "server/cli/rectangle_work.h"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace CLI {
class App;
}

namespace terrane {

struct AreaOptions {
    std::string world_path;
    std::string rectangle;    ///< as written
    std::size_t workers = 0;  ///< 0: as many as the machine has
};

/// `options` outlives the parse.
void add_area_options(CLI::App& command, AreaOptions& options);

/// The batches of the written rectangle. Fails with what is wrong with it, for a person.
Result<StackBatches> cut_area(const AreaOptions& options,
                              std::optional<std::uint64_t> shuffle_seed = std::nullopt);

/// 1..kWorkersMax.
std::size_t workers_of(const AreaOptions& options);

}  // namespace terrane
