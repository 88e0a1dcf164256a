// XXH3-128 as a value. Names worlds, chunks and stored records.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace terrane {

struct Hash128 {
    std::uint64_t high = 0;
    std::uint64_t low = 0;

    friend auto operator<=>(const Hash128&, const Hash128&) = default;
};

/// XXH3-128 with seed 0 of the bytes.
Hash128 hash128(std::span<const std::byte> bytes);

/// Sum mod 2^128: combines hashes of a set so that the order does not matter.
Hash128 sum_of(Hash128 a, Hash128 b);

/// 32 lower-case hex digits, high half first; the canonical XXH128 notation.
std::string to_hex(Hash128 hash);

/// Exactly 32 hex digits, or nothing.
std::optional<Hash128> hash_from_hex(std::string_view text);

}  // namespace terrane
