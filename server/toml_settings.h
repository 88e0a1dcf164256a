// Reading one table of a small TOML file (configuration, tokens) key by key, with every fault noted
// and none thrown. World files have their own reader, which checks much more.
#pragma once

#include "protocol/base/result.h"

#include <toml++/toml.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

/// Sentences "file:line:column: key: what is wrong", in the order in which they were found.
class TomlFaults {
  public:
    explicit TomlFaults(std::string_view file) : file_(file) {}

    void add(const toml::source_region& where, std::string_view key, std::string_view message);

    /// `invalid_argument` with all of them, or nothing.
    Result<void> outcome() const;

  private:
    std::string file_;
    std::string text_;
};

/// The file's root table. Fails with `invalid_argument` and the place.
Result<toml::table> parse_toml(std::string_view text, std::string_view file);

class TomlTable {
  public:
    /// `path` names the table in faults; empty for the root. All three outlive the object.
    TomlTable(const toml::table& table, std::string_view path, TomlFaults& faults)
        : table_(table), path_(path), faults_(faults) {}

    /// Nothing if the key is not there, or is not what is asked for (a fault).
    std::optional<std::string> text(std::string_view key);
    std::optional<bool> flag(std::string_view key);
    std::optional<std::int64_t> integer(std::string_view key, std::int64_t least,
                                        std::int64_t most);
    std::optional<toml::date_time> date_time(std::string_view key);
    const toml::array* array_of_tables(std::string_view key);

    void fault(std::string_view key, std::string_view message);
    /// Notes every key that was never asked for, with the nearest one that was.
    void finish();

  private:
    const toml::node* present(std::string_view key);
    const toml::source_region& place(std::string_view key) const;
    std::string full_key(std::string_view key) const;

    const toml::table& table_;
    std::string path_;
    TomlFaults& faults_;
    std::vector<std::string> known_;
};

}  // namespace terrane
