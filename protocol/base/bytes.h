// Bytes in and out: little-endian integers and varints over spans, every length checked before use.
#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace terrane {

static_assert(std::endian::native == std::endian::little,
              "stored and sent integers are little endian; a big-endian port must swap here");

using Bytes = std::vector<std::byte>;
/// Encoded once, then shared by cache, store and every session. Null means "no payload".
using SharedBytes = std::shared_ptr<const Bytes>;

inline std::span<const std::byte> bytes_of(std::string_view text) {
    return std::as_bytes(std::span(text.data(), text.size()));
}

inline std::string_view text_of(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

constexpr std::uint64_t zigzag(std::int64_t value) {
    return (static_cast<std::uint64_t>(value) << 1U) ^ static_cast<std::uint64_t>(value >> 63);
}

constexpr std::int64_t unzigzag(std::uint64_t value) {
    return static_cast<std::int64_t>(value >> 1U) ^ -static_cast<std::int64_t>(value & 1U);
}

/// Appends to a growing buffer that the caller owns. One thread.
class ByteWriter {
  public:
    explicit ByteWriter(Bytes& out) : out_(out) {}

    template <std::integral T>
    void fixed(T value) {
        const auto* first = reinterpret_cast<const std::byte*>(&value);
        out_.insert(out_.end(), first, first + sizeof(T));
    }

    void f64(double value) { fixed(std::bit_cast<std::uint64_t>(value)); }

    /// LEB128: 7 bits a byte, least significant first, at most 10 bytes.
    void varint(std::uint64_t value) {
        while (value >= 0x80) {
            out_.push_back(static_cast<std::byte>(value | 0x80U));
            value >>= 7U;
        }
        out_.push_back(static_cast<std::byte>(value));
    }

    void raw(std::span<const std::byte> bytes) {
        out_.insert(out_.end(), bytes.begin(), bytes.end());
    }

  private:
    Bytes& out_;
};

/// Reads from bytes that somebody else owns and keeps alive. Nothing is read past the end: every
/// call gives nothing when the bytes are cut short, and then stays at the end. One thread.
class ByteReader {
  public:
    explicit ByteReader(std::span<const std::byte> bytes) : rest_(bytes) {}

    std::size_t remaining() const { return rest_.size(); }

    std::optional<std::span<const std::byte>> take(std::size_t size_bytes) {
        if (size_bytes > rest_.size()) {
            rest_ = {};
            return std::nullopt;
        }
        const auto taken = rest_.first(size_bytes);
        rest_ = rest_.subspan(size_bytes);
        return taken;
    }

    template <std::integral T>
    std::optional<T> fixed() {
        const auto taken = take(sizeof(T));
        if (!taken) {
            return std::nullopt;
        }
        T value;
        std::memcpy(&value, taken->data(), sizeof(T));
        return value;
    }

    std::optional<double> f64() {
        const auto bits = fixed<std::uint64_t>();
        return bits ? std::optional(std::bit_cast<double>(*bits)) : std::nullopt;
    }

    /// Refuses more than 10 bytes and bits above 2^64.
    std::optional<std::uint64_t> varint() {
        std::uint64_t value = 0;
        for (unsigned shift = 0; shift < 64; shift += 7) {
            const auto byte = fixed<std::uint8_t>();
            if (!byte || (shift == 63 && *byte > 1)) {
                return std::nullopt;
            }
            value |= static_cast<std::uint64_t>(*byte & 0x7FU) << shift;
            if (*byte < 0x80) {
                return value;
            }
        }
        return std::nullopt;
    }

  private:
    std::span<const std::byte> rest_;
};

}  // namespace terrane
