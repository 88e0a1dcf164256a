#include "server/cli/arguments.h"

#include "protocol/base/coords.h"
#include "protocol/base/result.h"

#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

namespace terrane {
namespace {

std::string quoted(std::string_view text) {
    constexpr std::size_t kShownMax = 80;
    const bool whole = text.size() <= kShownMax;
    return "\"" + std::string(text.substr(0, kShownMax)) + (whole ? "\"" : "...\"");
}

Result<std::int64_t> parse_integer(std::string_view text, IntegerBounds bounds) {
    // from_chars knows no plus sign, people do.
    const bool plus = text.size() > 1 && text[0] == '+' && text[1] != '-';
    const std::string_view digits = plus ? text.substr(1) : text;
    std::int64_t value = 0;
    const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error == std::errc::invalid_argument || stop != digits.data() + digits.size()) {
        return fail(ErrorCode::invalid_argument, quoted(text) + " is not an integer");
    }
    if (error == std::errc::result_out_of_range || value < bounds.least || value > bounds.most) {
        return fail(ErrorCode::out_of_range, quoted(text) + " is not within " +
                                                 std::to_string(bounds.least) + ".." +
                                                 std::to_string(bounds.most));
    }
    return value;
}

Result<double> parse_number(std::string_view text, double least, double most) {
    const bool plus = text.size() > 1 && text[0] == '+' && text[1] != '-';
    const std::string_view digits = plus ? text.substr(1) : text;
    double value = 0;
    const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error == std::errc::invalid_argument || stop != digits.data() + digits.size()) {
        return fail(ErrorCode::invalid_argument, quoted(text) + " is not a number");
    }
    // "nan" is within no bounds.
    if (error != std::errc() || !(value >= least && value <= most)) {
        std::array<char, 64> bounds{};
        std::snprintf(bounds.data(), bounds.size(), "%.15g..%.15g", least, most);
        return fail(ErrorCode::out_of_range, quoted(text) + " is not within " + bounds.data());
    }
    return value;
}

/// Fills `out` from as many parts with commas between.
template <typename T, typename Parse>
Result<void> parse_list(std::span<T> out, std::string_view text, std::string_view what,
                        Parse parse) {
    std::string_view rest = text;
    for (std::size_t i = 0; i < out.size(); ++i) {
        const std::size_t comma = rest.find(',');
        const bool last = i + 1 == out.size();
        if (last != (comma == rest.npos)) {
            return fail(ErrorCode::invalid_argument,
                        quoted(text) + " is not " + std::to_string(out.size()) + " " +
                            std::string(what) + " with commas between");
        }
        const auto value = parse(rest.substr(0, comma));
        if (!value) {
            return tl::unexpected(value.error());
        }
        out[i] = *value;
        rest = last ? std::string_view() : rest.substr(comma + 1);
    }
    return {};
}

}  // namespace

Result<void> parse_integers(std::span<std::int64_t> out, std::string_view text,
                            IntegerBounds bounds) {
    return parse_list(out, text, "integers",
                      [&](std::string_view one) { return parse_integer(one, bounds); });
}

Result<void> parse_numbers(std::span<double> out, std::string_view text, double least,
                           double most) {
    return parse_list(out, text, "numbers",
                      [&](std::string_view one) { return parse_number(one, least, most); });
}

Result<ColumnPos> parse_column(std::string_view text) {
    std::array<std::int64_t, 2> numbers{};
    if (const auto parsed = parse_integers(numbers, text, kColumnBounds); !parsed) {
        return tl::unexpected(parsed.error());
    }
    return ColumnPos{.x = numbers[0], .z = numbers[1]};
}

Result<StackRectangle> parse_stack_rectangle(std::string_view text) {
    // The last is excluded, so it may stand one beyond the greatest chunk.
    std::array<std::int64_t, 4> numbers{};
    const IntegerBounds bounds = {.least = kChunkBounds.least, .most = kChunkBounds.most + 1};
    if (const auto parsed = parse_integers(numbers, text, bounds); !parsed) {
        return tl::unexpected(parsed.error());
    }
    const StackRectangle rectangle = {
        .x_first = numbers[0], .z_first = numbers[1], .x_end = numbers[2], .z_end = numbers[3]};
    if (rectangle.x_first >= rectangle.x_end || rectangle.z_first >= rectangle.z_end) {
        return fail(
            ErrorCode::invalid_argument,
            quoted(text) + " holds no chunk: X1 and Z1 are excluded, so X0 < X1 and Z0 < Z1");
    }
    return rectangle;
}

}  // namespace terrane
