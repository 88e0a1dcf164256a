#include "generator/world/world_table.h"

#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "protocol/base/nearest_word.h"

#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr std::string_view kRangeAllowed =
    "it must be [least, best, most], three numbers with 0 <= least <= best <= most <= 1";

/// A key this near to a missing one is taken for a slip of the pen.
constexpr std::size_t kSlipEditsMax = 3;

bool is_control(char c) {
    return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
}

/// What is wrong with a range's values, or nothing.
std::optional<std::string> range_fault(const Range& range) {
    const std::array<std::pair<std::string_view, double>, 3> named = {
        std::pair("least", range.least), std::pair("best", range.best),
        std::pair("most", range.most)};
    for (const auto& [name, value] : named) {
        if (!(value >= 0 && value <= 1)) {
            return std::string(name) + " is " + number_text(value);
        }
    }
    for (std::size_t i = 0; i + 1 < named.size(); ++i) {
        if (named[i].second > named[i + 1].second) {
            return std::string(named[i].first) + " " + number_text(named[i].second) + " is above " +
                   std::string(named[i + 1].first) + " " + number_text(named[i + 1].second);
        }
    }
    return std::nullopt;
}

}  // namespace

std::string number_text(double value) {
    std::array<char, 32> buffer{};
    const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
    return {buffer.data(), end};
}

std::string in_quotes(std::string_view text) {
    const bool cut = text.size() > kQuotedBytesMax;
    std::string result = "\"";
    for (const char c : text.substr(0, kQuotedBytesMax)) {
        result += is_control(c) ? '?' : c;
    }
    return result + (cut ? "...\"" : "\"");
}

void WorldFaults::add(const toml::source_region& where, std::string key, std::string message) {
    add(static_cast<int>(where.begin.line), static_cast<int>(where.begin.column), std::move(key),
        std::move(message));
}

void WorldFaults::add(int line, int column, std::string key, std::string message) {
    faults_.push_back({.file = file_,
                       .line = std::max(line, 1),
                       .column = std::max(column, 1),
                       .key = std::move(key),
                       .message = std::move(message)});
}

std::vector<WorldFileFault> WorldFaults::take_sorted() {
    std::stable_sort(faults_.begin(), faults_.end(), [](const auto& a, const auto& b) {
        return std::tie(a.line, a.column) < std::tie(b.line, b.column);
    });
    return std::exchange(faults_, {});
}

std::string_view type_text(const toml::node& node) {
    switch (node.type()) {
        case toml::node_type::table:
            return "a table";
        case toml::node_type::array:
            return "an array";
        case toml::node_type::string:
            return "a string";
        case toml::node_type::integer:
            return "an integer";
        case toml::node_type::floating_point:
            return "a float";
        case toml::node_type::boolean:
            return "a boolean";
        case toml::node_type::date:
            return "a date";
        case toml::node_type::time:
            return "a time";
        case toml::node_type::date_time:
            return "a date and time";
        case toml::node_type::none:
            break;
    }
    return "nothing";
}

std::optional<double> number_of(const toml::node& node) {
    if (const auto* integer = node.as_integer()) {
        return static_cast<double>(integer->get());
    }
    if (const auto* number = node.as_floating_point()) {
        return number->get() + 0.0;  // -0 + 0 is 0: one world must not have two canonical forms
    }
    return std::nullopt;
}

std::string WorldTable::full_key(std::string_view key) const {
    std::string shown(key.substr(0, kQuotedBytesMax));
    std::replace_if(shown.begin(), shown.end(), is_control, '?');
    return path_.empty() ? shown : path_ + "." + shown;
}

const toml::source_region& WorldTable::place(std::string_view key) const {
    const toml::node* node = table_.get(key);
    return node == nullptr ? table_.source() : node->source();
}

void WorldTable::fault(std::string_view key, std::string message) const {
    faults_.add(place(key), full_key(key), std::move(message));
}

const toml::node* WorldTable::present(std::string_view key, std::string_view allowed, Need need) {
    known_.emplace_back(key);
    const toml::node* node = table_.get(key);
    if (node == nullptr && need == Need::required) {
        missing_.emplace(key, allowed);
    }
    return node;
}

template <typename T>
const T* WorldTable::node(std::string_view key, std::string_view allowed, Need need) {
    const toml::node* node = present(key, allowed, need);
    if (node == nullptr) {
        return nullptr;
    }
    const T* typed = node->as<T>();
    if (typed == nullptr) {
        fault(key, "is " + std::string(type_text(*node)) + "; " + std::string(allowed));
    }
    return typed;
}

std::optional<double> WorldTable::affinity(std::string_view key) {
    const std::string allowed(kAffinityAllowed);
    const toml::node* node = present(key, allowed, Need::optional);
    const std::optional<double> value = node == nullptr ? std::nullopt : number_of(*node);
    if (node != nullptr && !value) {
        fault(key, "is " + std::string(type_text(*node)) + "; " + allowed);
    }
    if (value && !is_affinity(*value)) {
        fault(key, "is " + number_text(*value) + "; " + allowed);
    }
    return value;
}

std::optional<double> WorldTable::number(std::string_view key, NumberBounds bounds, Need need) {
    const std::string allowed =
        "it must be a number from " + number_text(bounds.least) + " to " + number_text(bounds.most);
    const toml::node* node = present(key, allowed, need);
    if (node == nullptr) {
        return std::nullopt;
    }
    const std::optional<double> value = number_of(*node);
    if (!value) {
        fault(key, "is " + std::string(type_text(*node)) + "; " + allowed);
        return std::nullopt;
    }
    if (!(*value >= bounds.least && *value <= bounds.most)) {  // a NaN is in no bounds
        fault(key, "is " + number_text(*value) + "; " + allowed);
        return std::nullopt;
    }
    return value;
}

std::optional<std::int64_t> WorldTable::integer(std::string_view key, WholeBounds bounds,
                                                Need need) {
    constexpr auto kAnyLeast = std::numeric_limits<std::int64_t>::min();
    constexpr auto kAnyMost = std::numeric_limits<std::int64_t>::max();
    std::string allowed = "it must be an integer";
    if (bounds.least == bounds.most) {
        allowed = "it must be " + std::to_string(bounds.least);
    } else if (bounds.least != kAnyLeast || bounds.most != kAnyMost) {
        allowed += " from " + std::to_string(bounds.least) + " to " + std::to_string(bounds.most);
    }
    const auto* value = node<toml::value<std::int64_t>>(key, allowed, need);
    if (value == nullptr) {
        return std::nullopt;
    }
    if (value->get() < bounds.least || value->get() > bounds.most) {
        fault(key, "is " + std::to_string(value->get()) + "; " + allowed);
        return std::nullopt;
    }
    return value->get();
}

std::optional<bool> WorldTable::flag(std::string_view key) {
    const auto* value = node<toml::value<bool>>(key, "it must be true or false", Need::optional);
    return value == nullptr ? std::nullopt : std::optional(value->get());
}

std::optional<std::string> WorldTable::text(std::string_view key, std::size_t bytes_max,
                                            Need need) {
    const std::string allowed = "it must be a string of 1 to " + std::to_string(bytes_max) +
                                " bytes without control characters";
    const auto* value = node<toml::value<std::string>>(key, allowed, need);
    if (value == nullptr) {
        return std::nullopt;
    }
    const std::string& text = value->get();
    if (text.empty() || text.size() > bytes_max) {
        fault(key, "has " + std::to_string(text.size()) + " bytes; " + allowed);
        return std::nullopt;
    }
    if (std::any_of(text.begin(), text.end(), is_control)) {
        fault(key, in_quotes(text) + " has a control character; " + allowed);
        return std::nullopt;
    }
    return text;
}

std::optional<Range> WorldTable::range(std::string_view key, Need need) {
    const auto* values = node<toml::array>(key, kRangeAllowed, need);
    if (values == nullptr) {
        return std::nullopt;
    }
    const auto refuse = [&](const std::string& what) {
        fault(key, what + "; " + std::string(kRangeAllowed));
        return std::nullopt;
    };
    if (values->size() != 3) {
        return refuse("has " + std::to_string(values->size()) + " values");
    }
    std::array<double, 3> numbers{};
    for (std::size_t i = 0; i < numbers.size(); ++i) {
        const std::optional<double> value = number_of((*values)[i]);
        if (!value) {
            return refuse("holds " + std::string(type_text((*values)[i])));
        }
        numbers[i] = *value;
    }
    const Range range{.least = numbers[0], .best = numbers[1], .most = numbers[2]};
    if (const auto wrong = range_fault(range)) {
        return refuse(*wrong);
    }
    return range;
}

const toml::table* WorldTable::table(std::string_view key, std::string_view allowed, Need need) {
    return node<toml::table>(key, allowed, need);
}

const toml::array* WorldTable::array(std::string_view key, std::string_view allowed, Need need) {
    return node<toml::array>(key, allowed, need);
}

void WorldTable::finish() {
    for (const auto& [key, value] : table_) {
        if (std::find(known_.begin(), known_.end(), key.str()) != known_.end()) {
            continue;
        }
        const std::string_view nearest = nearest_word(key.str(), known_);
        std::string message = "is not a known key; the nearest known one is " + in_quotes(nearest);
        const auto missing = missing_.find(nearest);
        if (missing != missing_.end() && edit_distance(key.str(), nearest) <= kSlipEditsMax) {
            message += ", which is missing; " + missing->second;
            missing_.erase(missing);
        }
        faults_.add(key.source(), full_key(key.str()), std::move(message));
    }
    for (const auto& [key, allowed] : missing_) {
        fault(key, "is missing; " + allowed);
    }
}

}  // namespace terrane
