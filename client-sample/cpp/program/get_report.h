// What `terrane-client get` prints: a table for people, JSON for programs.
#pragma once

#include "protocol/base/hash.h"
#include "protocol/wire/messages.h"

#include <chrono>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace terrane {

/// One chunk that was asked for.
struct GetRow {
    ChunkPos key;
    std::optional<ChunkAnswer> answer;  ///< nothing until it has come
    std::optional<Error> error;         ///< refused, undecodable, unwritable, or never came
    std::size_t triangle_count = 0;
    Hash128 payload_hash;  ///< XXH3-128 of the payload as received
    std::chrono::microseconds waited{};
};

/// One line a chunk, columns aligned, times in milliseconds.
std::string report_table(std::span<const GetRow> rows);

/// {"chunks":[..]} with those that came well; {"failures":[..]} beside it if any did not.
std::string report_json(std::span<const GetRow> rows, const ServerHello& world);

}  // namespace terrane
