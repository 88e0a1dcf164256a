// terrane token: makes tokens that let clients into a server, and shows which there are.
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "server/cli/open_world.h"
#include "server/cli/program.h"
#include "server/net/tokens.h"

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

namespace terrane {
namespace {

constexpr std::int64_t kDaysMax = 36'500;

struct TokenArguments {
    std::string file;
    std::string name;
    std::int64_t days = 0;
    std::string world;
};

int failed(const Error& error) {
    std::fprintf(stderr, "terrane: %s\n", error.message.c_str());
    return error.code == ErrorCode::invalid_argument ? kExitWrongUse : kExitFailed;
}

int run_new(const TokenArguments& arguments) {
    TokenEntry entry;
    entry.name = arguments.name;
    if (arguments.days > 0) {
        entry.expires = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now()) +
                        std::chrono::hours(24 * arguments.days);
    }
    if (!arguments.world.empty()) {
        const auto world = open_world(arguments.world);
        if (!world) {
            return kExitWrongUse;
        }
        entry.world = world->fingerprint;
    }
    const auto token = new_token();
    if (!token) {
        return failed(token.error());
    }
    entry.hash = sha256_of(*token);
    if (const auto added = add_token(arguments.file, entry); !added) {
        return failed(added.error());
    }
    std::puts(token->c_str());
    std::fprintf(stderr,
                 "added \"%s\" to %s; this token is shown once, and only its hash is kept\n",
                 arguments.name.c_str(), arguments.file.c_str());
    return kExitDone;
}

int run_list(const TokenArguments& arguments) {
    const auto tokens = read_tokens(arguments.file);
    if (!tokens) {
        return failed(tokens.error());
    }
    const auto now = std::chrono::system_clock::now();
    for (const TokenEntry& entry : *tokens) {
        const std::string expires =
            entry.expires
                ? (now >= *entry.expires ? "expired " : "until ") + utc_text(*entry.expires)
                : "for ever";
        const std::string world = entry.world ? ", world " + to_hex(*entry.world) : "";
        std::printf("%s: %s%s\n", entry.name.c_str(), expires.c_str(), world.c_str());
    }
    return kExitDone;
}

}  // namespace

void add_token_command(CLI::App& app, int& exit_code) {
    const auto arguments = std::make_shared<TokenArguments>();
    CLI::App* token = app.add_subcommand("token", "Make and list the tokens of a server");
    token->require_subcommand(1);
    CLI::App* make = token->add_subcommand("new", "Add a token to the file and print it, once");
    make->add_option("NAME", arguments->name, "Who it is for; stands in logs")->required();
    make->add_option("--days", arguments->days, "Days until it expires; without: never")
        ->check(CLI::Range(std::int64_t{1}, kDaysMax));
    make->add_option("--world", arguments->world, "World file: good for that world only");
    CLI::App* list = token->add_subcommand("list", "Show the names and until when they are good");
    for (CLI::App* command : {make, list}) {
        command->add_option("--file", arguments->file, "File of tokens; made if missing")
            ->required();
    }
    token->footer(
        "Example: terrane token new alice --file tokens.toml --days 30\n"
        "A running server reads the file again at SIGHUP.");
    make->callback([arguments, &exit_code] { exit_code = run_new(*arguments); });
    list->callback([arguments, &exit_code] { exit_code = run_list(*arguments); });
}

}  // namespace terrane
