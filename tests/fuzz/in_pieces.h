// A fuzz input as a reader gets it from a socket: its first byte says how large the pieces are, the
// rest are the bytes.
#pragma once

#include "protocol/base/bytes.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

namespace terrane {

/// Hands the bytes to `take` piece by piece, until it gives false.
template <typename Take>
void in_pieces(std::span<const std::byte> bytes, std::size_t piece_bytes, Take take) {
    while (!bytes.empty()) {
        const auto piece = bytes.first(std::min(piece_bytes, bytes.size()));
        if (!take(piece)) {
            return;
        }
        bytes = bytes.subspan(piece.size());
    }
}

/// Reads the input twice, in pieces and at once, and has `compare` look at both outcomes.
template <typename Read, typename Compare>
void read_both_ways(const std::uint8_t* data, std::size_t size, Read read, Compare compare) {
    if (size == 0) {
        return;
    }
    const auto bytes = std::as_bytes(std::span(data, size)).subspan(1);
    compare(read(bytes, std::size_t{1} + data[0]), read(bytes, bytes.size() + 1), bytes.size());
}

}  // namespace terrane
