// Numbers on the command line: "X,Z" and the like, with their ranges checked.
#pragma once

#include "protocol/base/coords.h"
#include "protocol/base/result.h"

#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

namespace terrane {

/// Both ends included.
struct IntegerBounds {
    std::int64_t least = std::numeric_limits<std::int64_t>::min();
    std::int64_t most = std::numeric_limits<std::int64_t>::max();
};

/// What a column's x or z may be on a command line: inside kColumnCoordinateLimit.
inline constexpr IntegerBounds kColumnBounds = {.least = -(kColumnCoordinateLimit - 1),
                                                .most = kColumnCoordinateLimit - 1};
inline constexpr IntegerBounds kChunkBounds = {.least = std::numeric_limits<std::int32_t>::min(),
                                               .most = std::numeric_limits<std::int32_t>::max()};

/// Chunk stacks with x_first <= x < x_end, likewise z. Never empty when parsed.
struct StackRectangle {
    std::int64_t x_first = 0;
    std::int64_t z_first = 0;
    std::int64_t x_end = 0;
    std::int64_t z_end = 0;

    friend bool operator==(const StackRectangle&, const StackRectangle&) = default;
};

/// Fills `out` with exactly out.size() integers from "1,-2,+3": decimal, comma between, no spaces.
/// Fails with `invalid_argument` when the text is not that, `out_of_range` when a number is not
/// within `bounds`. The message quotes the text.
Result<void> parse_integers(std::span<std::int64_t> out, std::string_view text,
                            IntegerBounds bounds);

/// Likewise numbers from "1.5,-2,3e2", both bounds included.
Result<void> parse_numbers(std::span<double> out, std::string_view text, double least, double most);

/// "X,Z" as a column, |x| and |z| below 2^53.
Result<ColumnPos> parse_column(std::string_view text);

/// "X0,Z0,X1,Z1" in chunk coordinates (int32), last excluded; an empty one is `invalid_argument`.
Result<StackRectangle> parse_stack_rectangle(std::string_view text);

}  // namespace terrane
