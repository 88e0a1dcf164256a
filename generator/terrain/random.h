// Hashes and random streams: the only source of chance in Terrane. A value depends on what it is
// for (a tag) and where it is, never on what was drawn before it elsewhere.
//
// `mix` is the finaliser of SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number
// generators", 2014, with Stafford's constants); a stream is SplitMix64 itself.
#pragma once

#include <concepts>
#include <cstdint>

namespace terrane {

/// What a hash is for. Two things never share a stream, so adding a draw to one never moves
/// another.
enum class Tag : std::uint8_t { layer = 1, origin, plot, element, shape, noise, flow };

constexpr std::uint64_t mix(std::uint64_t z) {
    z ^= z >> 30U;
    z *= 0xbf58476d1ce4e5b9U;
    z ^= z >> 27U;
    z *= 0x94d049bb133111ebU;
    return z ^ (z >> 31U);
}

/// What `combine` folds in for a value.
constexpr std::uint64_t combine_value(std::uint64_t value) {
    return value * 0x9E3779B97F4A7C15U + 0xD1B54A32D192ED03U;
}

constexpr std::uint64_t combine(std::uint64_t hash, std::uint64_t value) {
    return mix(hash ^ combine_value(value));
}

constexpr std::uint64_t as_key_part(Tag tag) {
    return static_cast<std::uint64_t>(tag);
}

constexpr std::uint64_t as_key_part(std::integral auto value) {
    return static_cast<std::uint64_t>(value);
}

/// Folds the parts into `hash`, one after the other; signed values are cast.
constexpr std::uint64_t key(std::uint64_t hash, auto... parts) {
    ((hash = combine(hash, as_key_part(parts))), ...);
    return hash;
}

static_assert(mix(1) == 0x5692161d100b05e5U && combine(0, 0) == 0x8209b480faed1b10U &&
              key(7, 1, 2) == 0x52e3cdc28bd73f77U);

/// A sequence of draws from one key.
class RandomStream {
  public:
    explicit constexpr RandomStream(std::uint64_t key) : state_(key) {}

    constexpr std::uint64_t next() {
        state_ += 0x9E3779B97F4A7C15U;
        return mix(state_);
    }

    /// Uniform in [0, 1), a multiple of 2^-53.
    constexpr double unit() { return static_cast<double>(next() >> 11U) * 0x1p-53; }

  private:
    std::uint64_t state_;
};

}  // namespace terrane
