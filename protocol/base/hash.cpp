#include "protocol/base/hash.h"

#include <xxhash.h>

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace terrane {
namespace {

/// Of 16 hexadecimal digits.
std::uint64_t number_of(std::string_view digits) {
    std::uint64_t number = 0;
    std::from_chars(digits.data(), digits.data() + digits.size(), number, 16);
    return number;
}

}  // namespace

Hash128 hash128(std::span<const std::byte> bytes) {
    const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
    return {.high = hash.high64, .low = hash.low64};
}

Hash128 sum_of(Hash128 a, Hash128 b) {
    const std::uint64_t low = a.low + b.low;
    return {.high = a.high + b.high + (low < a.low ? 1U : 0U), .low = low};
}

std::string to_hex(Hash128 hash) {
    constexpr std::string_view kDigits = "0123456789abcdef";
    std::string text(32, '0');
    for (std::size_t i = 0; i < 16; ++i) {
        text[15 - i] = kDigits[(hash.high >> (4 * i)) & 15U];
        text[31 - i] = kDigits[(hash.low >> (4 * i)) & 15U];
    }
    return text;
}

std::optional<Hash128> hash_from_hex(std::string_view text) {
    if (text.size() != 32 || text.find_first_not_of("0123456789abcdefABCDEF") != text.npos) {
        return std::nullopt;
    }
    return Hash128{.high = number_of(text.substr(0, 16)), .low = number_of(text.substr(16))};
}

}  // namespace terrane
