// A build step that a test lets through one task at a time, so that nothing has to sleep.
#pragma once

#include "server/chunks/chunk_service.h"

#include <atomic>
#include <functional>
#include <memory>
#include <semaphore>
#include <stdexcept>
#include <vector>

namespace terrane {

/// A build step that tells when it has begun and waits to be let through.
struct Gate {
    std::counting_semaphore<> begun{0};
    std::counting_semaphore<> passes{0};
    std::atomic<int> builds{0};
    std::atomic<bool> open{true};
    EncodedChunk chunk;  ///< what every chunk is; set before the first request

    std::function<BuildStep()> maker() {
        return [this] {
            return [this](const Task& task) -> Result<Answer> {
                ++builds;
                if (!open) {
                    begun.release();
                    passes.acquire();
                }
                if (task.stop.stop_requested()) {
                    return fail(ErrorCode::cancelled, "stopped");
                }
                if (const auto* column = std::get_if<ColumnPos>(&task.key)) {
                    return ServedColumn{.column = *column,
                                        .limits = std::make_shared<std::vector<ColumnLimit>>(3),
                                        .source = ChunkSource::generated};
                }
                const auto key = std::get<ChunkKey>(task.key);
                if (key.position.y == 666) {
                    throw std::runtime_error("thrown on purpose");
                }
                return ServedChunk{.key = key,
                                   .chunk = std::make_shared<const EncodedChunk>(chunk),
                                   .source = ChunkSource::generated,
                                   .timings = {}};
            };
        };
    }
};

}  // namespace terrane
