// Suggestions: what somebody who misspelt a word may have meant.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

/// Words are compared up to this length; longer ones are nobody's slip.
inline constexpr std::size_t kComparedBytesMax = 64;

/// Insertions, removals and replacements that turn one into the other.
std::size_t edit_distance(std::string_view a, std::string_view b);

/// Of `known`, the one with the least edit distance to `word`; empty if `known` is.
std::string_view nearest_word(std::string_view word, const std::vector<std::string>& known);

}  // namespace terrane
