// Columns of made-up worlds for tests of what comes after generation: any seed, any coordinate.
#pragma once

#include "tests/support/ascii_cut.h"

#include <array>
#include <cstdint>
#include <vector>

namespace terrane {

/// A number in 0..most - 1 from a seed and a place.
inline std::int32_t drawn(std::uint64_t seed, std::int64_t x, std::int64_t z, std::int32_t most) {
    std::uint64_t bits = seed * 0x9E3779B97F4A7C15U +
                         static_cast<std::uint64_t>(x) * 0xC2B2AE3D27D4EB4FU +
                         static_cast<std::uint64_t>(z) * 0x165667B19E3779F9U;
    bits = (bits ^ (bits >> 29)) * 0xBF58476D1CE4E5B9U;
    bits = (bits ^ (bits >> 32)) * 0x94D049BB133111EBU;
    return static_cast<std::int32_t>((bits >> 33) % static_cast<std::uint64_t>(most));
}

/// The same, but smooth over 8 columns.
inline std::int32_t drawn_smoothly(std::uint64_t seed, ColumnPos at, std::int32_t most) {
    const std::int64_t x = floor_div(at.x, 8);
    const std::int64_t z = floor_div(at.z, 8);
    const auto dx = static_cast<std::int32_t>(floor_mod(at.x, 8));
    const auto dz = static_cast<std::int32_t>(floor_mod(at.z, 8));
    return ((8 - dx) * (8 - dz) * drawn(seed, x, z, most) +
            dx * (8 - dz) * drawn(seed, x + 1, z, most) +
            (8 - dx) * dz * drawn(seed, x, z + 1, most) +
            dx * dz * drawn(seed, x + 1, z + 1, most)) /
           64;
}

/// Layers a, b (blended from below) and c over each other.
inline std::vector<Limit> hills(const Letters& letters, std::uint64_t seed, ColumnPos at) {
    const std::int32_t a = 256 + drawn_smoothly(seed, at, 10 * 256);
    const std::int32_t b = a + 1 + drawn_smoothly(seed + 1, at, 12 * 256);
    const std::int32_t c = b + 1 + drawn_smoothly(seed + 2, at, 8 * 256);
    const auto limit = [&letters](std::int32_t y256, char letter) {
        return Limit{.y256 = y256, .palette_id = letters.id(letter), .flow = {}};
    };
    return {limit(0, 'a'), limit(a, 'a'), limit(a + (b - a + 1) / 2, 'b'),
            limit(b, 'b'), limit(b, 'c'), limit(c, 'c'),
            limit(c, '.')};
}

/// Hills with a cave of changing height and thickness in them, here and there open to the sky.
inline std::vector<Limit> caves(const Letters& letters, std::uint64_t seed, ColumnPos at) {
    const std::int32_t floor = 256 + drawn_smoothly(seed, at, 20 * 256);
    const std::int32_t thickness = drawn_smoothly(seed + 1, at, 10 * 256) - 4 * 256;
    const std::int32_t top = 8 * 256 + drawn_smoothly(seed + 2, at, 14 * 256);
    const auto limit = [&letters](std::int32_t y256, char letter) {
        return Limit{.y256 = y256, .palette_id = letters.id(letter), .flow = {}};
    };
    if (thickness <= 0 || floor >= top) {
        return {limit(0, 'a'), limit(top, 'a'), limit(top, '.')};
    }
    if (floor + thickness >= top) {
        return {limit(0, 'a'), limit(floor, 'a'), limit(floor, '.')};
    }
    const std::int32_t ceiling = floor + thickness;
    return {limit(0, 'a'),       limit(floor, 'a'), limit(floor, 'o'), limit(ceiling, 'o'),
            limit(ceiling, 'b'), limit(top, 'b'),   limit(top, '.')};
}

/// Anything goes: every column a pile of solid and cave spans of its own, many thinner than a
/// voxel.
inline std::vector<Limit> rubble(const Letters& letters, std::uint64_t seed, ColumnPos at) {
    std::vector<Limit> column;
    std::int32_t y256 = 0;
    const std::int32_t spans = 1 + drawn(seed, at.x, at.z, 12);
    for (std::int32_t i = 0; i < spans; ++i) {
        const auto draw = [&](std::int32_t what, std::int32_t most) {
            return drawn(seed + 7 + static_cast<std::uint64_t>(3 * i + what), at.x, at.z, most);
        };
        static constexpr std::array<char, 4> kLetters = {'a', 'o', 'b', 'o'};
        const auto id = letters.id(i == 0 ? 'a' : kLetters[static_cast<std::size_t>(draw(0, 4))]);
        const std::int32_t height = draw(1, 4) == 0 ? draw(2, 60) : 16 * draw(2, 80);
        column.push_back({.y256 = y256, .palette_id = id, .flow = {}});
        y256 += height;
        column.push_back({.y256 = y256, .palette_id = id, .flow = {}});
    }
    column.push_back({.y256 = y256, .palette_id = letters.id('.'), .flow = {}});
    return column;
}

/// High and mostly solid: rough ground far up, a low cave of high walls, and shafts far apart.
inline std::vector<Limit> depths(const Letters& letters, std::uint64_t seed, ColumnPos at) {
    const auto limit = [&letters](std::int32_t y256, char letter) {
        return Limit{.y256 = y256, .palette_id = letters.id(letter), .flow = {}};
    };
    std::vector<Limit> column = {limit(0, 'a')};
    const auto add_cave = [&](std::int32_t floor256, std::int32_t ceiling256) {
        if (floor256 < ceiling256) {
            column.insert(column.end(), {limit(floor256, 'a'), limit(floor256, 'o'),
                                         limit(ceiling256, 'o'), limit(ceiling256, 'a')});
        }
    };
    const std::int32_t low = drawn_smoothly(seed, at, 90 * 256);
    add_cave(30 * 256 + low / 3, 30 * 256 + low);
    const bool is_shaft = drawn(seed, floor_div(at.x, 3), floor_div(at.z, 3), 4) == 0;
    add_cave(400 * 256 + drawn(seed + 1, at.x, at.z, 512), is_shaft ? 500 * 256 + low : 0);
    const std::int32_t top = 900 * 256 + drawn(seed + 2, at.x, at.z, 8 * 256);
    column.insert(column.end(), {limit(top, 'a'), limit(top, '.')});
    return column;
}

}  // namespace terrane
