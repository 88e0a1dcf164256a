// Reading one TOML table of a world file, key by key, with every fault noted and none thrown.
//
// A `WorldTable` is asked for each key that may stand in its table. Each question gives the value,
// or nothing after noting what is wrong and what is allowed; `finish` then notes the keys nobody
// asked for, with the nearest one that somebody did. Only the world file's reader uses this.
#pragma once

#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "protocol/base/nearest_word.h"

#include <toml++/toml.h>

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

/// Longest piece of a file that a fault quotes, in bytes.
inline constexpr std::size_t kQuotedBytesMax = 64;

/// Shortest decimal text that reads back as the same double.
std::string number_text(double value);

/// The text in quotation marks, cut to kQuotedBytesMax, control characters shown as '?'.
std::string in_quotes(std::string_view text);

/// The faults of one file, in the order in which they were found.
class WorldFaults {
  public:
    explicit WorldFaults(std::string_view file) : file_(file) {}

    void add(const toml::source_region& where, std::string key, std::string message);
    void add(int line, int column, std::string key, std::string message);

    /// The faults in the order of the file.
    std::vector<WorldFileFault> take_sorted();

  private:
    std::string file_;
    std::vector<WorldFileFault> faults_;
};

struct NumberBounds {
    double least = 0;
    double most = 0;
};

struct WholeBounds {
    std::int64_t least = 0;
    std::int64_t most = 0;
};

enum class Need : std::uint8_t {
    required,
    optional,  ///< may be absent; nothing is given then
};

class WorldTable {
  public:
    /// `path` names the table in faults ("terrain"); it is empty for the file's root. All three
    /// arguments outlive the object.
    WorldTable(const toml::table& table, std::string path, WorldFaults& faults)
        : table_(table), path_(std::move(path)), faults_(faults) {}

    std::optional<double> number(std::string_view key, NumberBounds bounds, Need need);
    std::optional<std::int64_t> integer(std::string_view key, WholeBounds bounds, Need need);
    /// 0 to 1, or -1.
    std::optional<double> affinity(std::string_view key);
    std::optional<bool> flag(std::string_view key);
    /// 1 to `bytes_max` bytes without control characters.
    std::optional<std::string> text(std::string_view key, std::size_t bytes_max, Need need);
    std::optional<Range> range(std::string_view key, Need need);
    const toml::table* table(std::string_view key, std::string_view allowed, Need need);
    const toml::array* array(std::string_view key, std::string_view allowed, Need need);

    /// Notes every key that was never asked for and every required one that is not there. A key
    /// that is nearly a missing one is one fault, not two.
    void finish();

    /// Where a key's value stands; the table's own place if it has none.
    const toml::source_region& place(std::string_view key) const;
    std::string full_key(std::string_view key) const;
    void fault(std::string_view key, std::string message) const;

  private:
    /// The key's node if it is there and of type T, else nothing and a fault saying what is
    /// allowed.
    template <typename T>
    const T* node(std::string_view key, std::string_view allowed, Need need);
    const toml::node* present(std::string_view key, std::string_view allowed, Need need);

    const toml::table& table_;
    std::string path_;
    WorldFaults& faults_;
    std::vector<std::string> known_;
    std::map<std::string, std::string, std::less<>> missing_;  ///< what is allowed, by key
};

/// 0 to 1, or -1 for "never together".
constexpr bool is_affinity(double value) {
    return (value >= 0 && value <= 1) || value == -1;
}

inline constexpr std::string_view kAffinityAllowed =
    "it must be a number from 0 to 1, or -1 for never together";

/// "a string", "an integer", ...: what a node is, for a sentence.
std::string_view type_text(const toml::node& node);

/// The node's number if it is an integer or a float, infinities and NaN included; -0 becomes 0.
std::optional<double> number_of(const toml::node& node);

}  // namespace terrane
