// What both programs do about their command line beside CLI11.
#pragma once

#include "protocol/base/nearest_word.h"

#include <optional>
#include <string>
#include <vector>

namespace terrane {

/// Whether all that was printed to standard output arrived; says so on stderr if not. A full disk
/// behind a pipe or a redirection must not look like success.
bool output_is_whole();

/// A word that stands where a subcommand of `app` (a CLI::App) must and is none: "serv" is no
/// subcommand; did you mean "serve"? CLI11 itself would only say that one is required.
template <typename App>
std::optional<std::string> unknown_subcommand(App& app, const std::vector<std::string>& arguments) {
    App* level = &app;
    for (const std::string& argument : arguments) {
        std::vector<std::string> names;
        App* next = nullptr;
        for (App* const subcommand : level->get_subcommands({})) {
            names.push_back(subcommand->get_name());
            next = names.back() == argument ? subcommand : next;
        }
        if (names.empty() || argument.empty() || argument[0] == '-') {
            return std::nullopt;
        }
        if (next == nullptr) {
            return '"' + argument + "\" is no subcommand; did you mean \"" +
                   std::string(nearest_word(argument, names)) + "\"?";
        }
        level = next;
    }
    return std::nullopt;
}

}  // namespace terrane
