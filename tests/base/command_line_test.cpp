#include "protocol/base/command_line.h"

#include <gtest/gtest.h>

namespace terrane {
namespace {

/// As much of a CLI::App as is asked for.
struct Level {
    std::string name;
    std::vector<Level*> below;

    const std::string& get_name() const { return name; }

    struct All {};

    const std::vector<Level*>& get_subcommands(All) const { return below; }
};

TEST(CommandLine, NamesTheSubcommandThatIsNone) {
    Level check{.name = "check", .below = {}};
    Level show{.name = "show", .below = {}};
    Level world{.name = "world", .below = {&check, &show}};
    Level serve{.name = "serve", .below = {}};
    Level app{.name = "", .below = {&world, &serve}};
    EXPECT_EQ(unknown_subcommand(app, {"serv"}),
              "\"serv\" is no subcommand; did you mean \"serve\"?");
    EXPECT_EQ(unknown_subcommand(app, {"world", "chek", "x"}),
              "\"chek\" is no subcommand; did you mean \"check\"?");
    EXPECT_FALSE(unknown_subcommand(app, {"serve", "anything"}));
    EXPECT_FALSE(unknown_subcommand(app, {"world", "check", "file"}));
    EXPECT_FALSE(unknown_subcommand(app, {"--help"}));
    EXPECT_FALSE(unknown_subcommand(app, {}));
}

TEST(NearestWord, CountsEdits) {
    EXPECT_EQ(edit_distance("depth", "depht"), 2U);
    EXPECT_EQ(edit_distance("", "abc"), 3U);
    EXPECT_EQ(nearest_word("sead", {"seed", "name", "scale"}), "seed");
    EXPECT_EQ(nearest_word("x", {}), "");
}

}  // namespace
}  // namespace terrane
