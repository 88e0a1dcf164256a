#include "server/toml_settings.h"

#include "protocol/base/nearest_word.h"
#include "protocol/base/result.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace terrane {

void TomlFaults::add(const toml::source_region& where, std::string_view key,
                     std::string_view message) {
    text_ += text_.empty() ? "" : "\n";
    text_ += file_ + ":" + std::to_string(where.begin.line) + ":" +
             std::to_string(where.begin.column) + ": ";
    text_ += key;
    text_ += key.empty() ? "" : ": ";
    text_ += message;
}

Result<void> TomlFaults::outcome() const {
    if (text_.empty()) {
        return {};
    }
    return fail(ErrorCode::invalid_argument, text_);
}

Result<toml::table> parse_toml(std::string_view text, std::string_view file) {
    try {
        return toml::parse(text, file);
    } catch (const toml::parse_error& error) {
        TomlFaults faults(file);
        faults.add(error.source(), {}, error.description());
        return tl::unexpected(faults.outcome().error());
    }
}

const toml::node* TomlTable::present(std::string_view key) {
    known_.emplace_back(key);
    return table_.get(key);
}

std::optional<std::string> TomlTable::text(std::string_view key) {
    const toml::node* node = present(key);
    if (node == nullptr) {
        return std::nullopt;
    }
    const auto* value = node->as_string();
    if (value == nullptr) {
        fault(key, "it must be a text in quotation marks");
        return std::nullopt;
    }
    const std::string& out = value->get();
    if (std::ranges::any_of(out, [](unsigned char c) { return c < 0x20 || c == 0x7f; })) {
        fault(key, "it must not have control characters in it");
        return std::nullopt;
    }
    return out;
}

std::optional<bool> TomlTable::flag(std::string_view key) {
    const toml::node* node = present(key);
    if (node == nullptr) {
        return std::nullopt;
    }
    if (!node->is_boolean()) {
        fault(key, "it must be true or false");
        return std::nullopt;
    }
    return node->as_boolean()->get();
}

std::optional<std::int64_t> TomlTable::integer(std::string_view key, std::int64_t least,
                                               std::int64_t most) {
    const toml::node* node = present(key);
    if (node == nullptr) {
        return std::nullopt;
    }
    const auto* value = node->as_integer();
    if (value == nullptr || value->get() < least || value->get() > most) {
        fault(key, "it must be an integer within " + std::to_string(least) + ".." +
                       std::to_string(most));
        return std::nullopt;
    }
    return value->get();
}

std::optional<toml::date_time> TomlTable::date_time(std::string_view key) {
    const toml::node* node = present(key);
    if (node == nullptr) {
        return std::nullopt;
    }
    if (!node->is_date_time() || !node->as_date_time()->get().offset) {
        fault(key, "it must be a date and time with its zone, like 2027-01-31T00:00:00Z");
        return std::nullopt;
    }
    return node->as_date_time()->get();
}

const toml::array* TomlTable::array_of_tables(std::string_view key) {
    const toml::node* node = present(key);
    if (node == nullptr) {
        return nullptr;
    }
    if (!node->is_array_of_tables()) {
        fault(key, "it must be tables, each under [[" + full_key(key) + "]]");
        return nullptr;
    }
    return node->as_array();
}

void TomlTable::fault(std::string_view key, std::string_view message) {
    faults_.add(place(key), full_key(key), message);
}

void TomlTable::finish() {
    for (const auto& [key, node] : table_) {
        if (std::ranges::find(known_, key.str()) == known_.end()) {
            faults_.add(key.source(), full_key(key.str()),
                        "is not a known key; the nearest known one is \"" +
                            std::string(nearest_word(key.str(), known_)) + "\"");
        }
    }
}

const toml::source_region& TomlTable::place(std::string_view key) const {
    const toml::node* node = table_.get(key);
    return node == nullptr ? table_.source() : node->source();
}

std::string TomlTable::full_key(std::string_view key) const {
    return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
}

}  // namespace terrane
