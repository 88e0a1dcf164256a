// Coordinate spaces, one type each. Y is up. Crossing from one space to another is a named
// function, and integers floor, never truncate, so that negative coordinates behave like positive
// ones.
#pragma once

#include <compare>
#include <cstdint>

namespace terrane {

/// Columns lie at |x|, |z| < 2^53; anything else is `out_of_range`.
inline constexpr std::int64_t kColumnCoordinateLimit = std::int64_t{1} << 53;
/// Levels of detail 0..kLodMax; a column of level l is every 2^l-th column of level 0.
inline constexpr std::int32_t kLodMax = 17;

constexpr std::int64_t floor_div(std::int64_t a, std::int64_t b) {
    return a / b - ((a % b != 0 && ((a < 0) != (b < 0))) ? 1 : 0);
}

constexpr std::int64_t floor_mod(std::int64_t a, std::int64_t b) {
    return a - floor_div(a, b) * b;
}

/// A point of the plane, in voxels.
struct ColumnPos {
    std::int64_t x = 0;
    std::int64_t z = 0;

    friend auto operator<=>(const ColumnPos&, const ColumnPos&) = default;
};

/// A chunk stack: every height over one N x N square. x and z are in chunk sides of the level.
struct StackPos {
    std::int32_t lod = 0;
    std::int32_t x = 0;
    std::int32_t z = 0;

    friend auto operator<=>(const StackPos&, const StackPos&) = default;
};

/// A chunk; y counts chunk heights and is 0 at levels above 0, where a chunk is the whole height.
struct ChunkPos {
    std::int32_t lod = 0;
    std::int32_t x = 0;
    std::int32_t y = 0;
    std::int32_t z = 0;

    friend auto operator<=>(const ChunkPos&, const ChunkPos&) = default;
};

constexpr StackPos stack_of(ChunkPos chunk) {
    return {.lod = chunk.lod, .x = chunk.x, .z = chunk.z};
}

/// The level-0 stack that holds a column.
constexpr StackPos stack_of(ColumnPos column, std::int32_t side_columns) {
    return {.lod = 0,
            .x = static_cast<std::int32_t>(floor_div(column.x, side_columns)),
            .z = static_cast<std::int32_t>(floor_div(column.z, side_columns))};
}

static_assert(stack_of(ColumnPos{.x = -1, .z = 32}, 32) == StackPos{.lod = 0, .x = -1, .z = 1});

/// The level-0 column at the stack's corner of least x and z. Exact for every int32 and lod <= 17:
/// 2^31 * 64 * 2^17 < 2^55; whether it is within kColumnCoordinateLimit is the caller's check.
constexpr ColumnPos first_column_of(StackPos stack, std::int32_t side_columns) {
    const std::int64_t side = static_cast<std::int64_t>(side_columns) << stack.lod;
    return {.x = stack.x * side, .z = stack.z * side};
}

}  // namespace terrane
