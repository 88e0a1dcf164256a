#include "generator/world/world_affinities.h"

#include "generator/world/world_definition.h"
#include "generator/world/world_table.h"
#include "protocol/base/nearest_word.h"

#include <toml++/toml.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr std::string_view kPairAllowed =
    "it must be [\"material\", \"material\", affinity], the affinity from 0 to 1 or -1";

/// Looking for the nearest of many names is slow: a file full of unknown ones must not take
/// minutes.
constexpr std::size_t kSuggestionsMax = 64;

using MaterialIndex = std::map<std::string, std::size_t, std::less<>>;
using Pair = std::pair<std::size_t, std::size_t>;

/// One of the two kinds of affinity: its default and its list of pairs.
class AffinityList {
  public:
    AffinityList(WorldTable& table, std::string key, const MaterialIndex& index,
                 WorldFaults& faults)
        : table_(table), key_(std::move(key)), index_(index), faults_(faults) {
        for (const auto& [name, position] : index) {
            names_.push_back(name);
        }
    }

    std::vector<double> read() {
        const double default_affinity = table_.affinity(key_ + "_default").value_or(1);
        read_pairs();
        const std::size_t count = index_.size();
        if (count > kMaterialsMax) {
            return {};
        }
        std::vector<double> matrix(count * count, default_affinity);
        for (const auto& [pair, affinity] : pairs_) {
            matrix[pair.first * count + pair.second] = affinity;
            matrix[pair.second * count + pair.first] = affinity;
        }
        return matrix;
    }

  private:
    void read_pairs() {
        const toml::array* list = table_.array(
            key_, "it must be a list of [\"material\", \"material\", affinity]", Need::optional);
        if (list == nullptr) {
            return;
        }
        for (const toml::node& node : *list) {
            read_pair(node);
        }
    }

    void read_pair(const toml::node& node) {
        const toml::array* triple = node.as_array();
        if (triple == nullptr || triple->size() != 3) {
            const std::string what = triple == nullptr
                                         ? "is " + std::string(type_text(node))
                                         : "has " + std::to_string(triple->size()) + " values";
            fault(node, what + "; " + std::string(kPairAllowed));
            return;
        }
        const auto a = read_name((*triple)[0]);
        const auto b = read_name((*triple)[1]);
        const auto value = number_of((*triple)[2]);
        if (!value) {
            fault((*triple)[2], "is " + std::string(type_text((*triple)[2])) + "; " +
                                    std::string(kAffinityAllowed));
        } else if (!is_affinity(*value)) {
            fault((*triple)[2], "is " + number_text(*value) + "; " + std::string(kAffinityAllowed));
        } else if (a && b) {
            add_pair(node, {std::min(*a, *b), std::max(*a, *b)}, *value);
        }
    }

    void add_pair(const toml::node& node, Pair pair, double affinity) {
        const auto [known, is_new] = pairs_.emplace(pair, affinity);
        if (!is_new && known->second != affinity) {
            fault(node, "gives a pair " + number_text(affinity) + " that has " +
                            number_text(known->second) +
                            " already; pairs work both ways and may have one affinity");
        }
    }

    std::optional<std::size_t> read_name(const toml::node& node) {
        const auto* name = node.as_string();
        if (name == nullptr) {
            fault(node, "is " + std::string(type_text(node)) + "; " + std::string(kPairAllowed));
            return std::nullopt;
        }
        const auto found = index_.find(name->get());
        if (found == index_.end()) {
            const bool suggest = ++unknown_names_ <= kSuggestionsMax;
            fault(node,
                  in_quotes(name->get()) + " is no material" +
                      (suggest ? "; the nearest is " + in_quotes(nearest_word(name->get(), names_))
                               : std::string()));
            return std::nullopt;
        }
        return found->second;
    }

    void fault(const toml::node& node, std::string message) {
        faults_.add(node.source(), table_.full_key(key_), std::move(message));
    }

    WorldTable& table_;
    std::string key_;
    const MaterialIndex& index_;
    WorldFaults& faults_;
    std::vector<std::string> names_;
    std::size_t unknown_names_ = 0;
    std::map<Pair, double> pairs_;
};

}  // namespace

void read_affinities(const toml::table* source, WorldFaults& faults, WorldDefinition& world) {
    MaterialIndex index;
    for (std::size_t i = 0; i < world.materials.size(); ++i) {
        index.emplace(world.materials[i].name, i);
    }
    const toml::table none;
    WorldTable table(source == nullptr ? none : *source, "affinity", faults);
    world.same_layer = AffinityList(table, "same_layer", index, faults).read();
    world.next_layer = AffinityList(table, "next_layer", index, faults).read();
    table.finish();
}

}  // namespace terrane
