#include "server/cli/column.h"

#include "server/cli/program.h"
#include "tests/support/drawn_stack.h"
#include "tests/support/test_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

namespace terrane {
namespace {

std::vector<Material> drawn_materials() {
    std::vector<Material> materials(6);
    for (std::size_t i = 0; i < materials.size(); ++i) {
        materials[i].name = std::string(1, "abc.A#"[i]);
    }
    return materials;
}

TEST(Column, JsonHasTheNamesInTheirOrder) {
    const auto limits = drawn_column("b");
    const Palette palette = drawn_palette();
    const auto materials = drawn_materials();
    EXPECT_EQ(column_json({.position = {.x = -5, .z = 3},
                           .limits = limits,
                           .palette = palette,
                           .materials = materials}),
              R"({"x":-5,"z":3,"limits":[)"
              R"({"y256":0,"flow":[100,-6,78],"composition":{"b":0.75,"a":0.25}},)"
              R"({"y256":256,"flow":[100,-6,78],"composition":{"b":0.75,"a":0.25}},)"
              R"({"y256":256,"flow":[0,0,0],"composition":{".":1.0}}]})");
}

TEST(Column, TheTableHasALineALimit) {
    const auto limits = drawn_column("aab#");
    const Palette palette = drawn_palette();
    const auto materials = drawn_materials();
    const std::string text = column_text({.position = {.x = -5, .z = 3},
                                          .limits = limits,
                                          .palette = palette,
                                          .materials = materials});
    EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(text, '\n')), limits.size() + 1);
    EXPECT_THAT(text, testing::HasSubstr("3.000    100   -6   78   layer  75.0 % b, 25.0 % a"));
    EXPECT_THAT(text, testing::HasSubstr("cave   #"));
}

TEST(Column, TheTableCallsWhatLiesOnTheGroundAndWaterByTheirKinds) {
    const auto limits = drawn_column("aA#.");
    const Palette palette = drawn_palette();
    auto materials = drawn_materials();
    materials[4].kind = MaterialKind::soil;
    materials[5].kind = MaterialKind::water;
    const std::string text =
        column_text({.position = {}, .limits = limits, .palette = palette, .materials = materials});
    EXPECT_THAT(text, testing::HasSubstr("layer  a"));
    EXPECT_THAT(text, testing::HasSubstr("soil   A"));
    EXPECT_THAT(text, testing::HasSubstr("water  #"));
    EXPECT_THAT(text, testing::HasSubstr("void   ."));
}

struct Outcome {
    int exit_code = 0;
    std::string out;
};

Outcome run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"terrane", "column", "--world",
                                         test_data_path("paper-B3-seed42.toml").string()});
    std::vector<char*> pointers;
    for (std::string& argument : arguments) {
        pointers.push_back(argument.data());
    }
    pointers.push_back(nullptr);
    testing::internal::CaptureStdout();
    const int exit_code = run_program(static_cast<int>(arguments.size()), pointers.data());
    return {.exit_code = exit_code, .out = testing::internal::GetCapturedStdout()};
}

TEST(Column, TheProgramPrintsTheGoldenColumn) {
    std::ifstream golden(test_data_path("columns.jsonl"));
    std::string line;
    std::getline(golden, line);
    auto expected = nlohmann::json::parse(line);
    ASSERT_EQ(expected["world"], "paper-B3-seed42");
    const std::string at = std::to_string(expected["x"].get<std::int64_t>()) + "," +
                           std::to_string(expected["z"].get<std::int64_t>());
    ASSERT_EQ(at[0], '-');
    for (const auto& arguments :
         {std::vector<std::string>{"--at", at, "--json"}, {"--json", "--at=" + at}}) {
        const Outcome outcome = run(arguments);
        ASSERT_EQ(outcome.exit_code, kExitDone);
        const auto printed = nlohmann::json::parse(outcome.out);
        ASSERT_EQ(printed["limits"].size(), expected["limits"].size());
        for (std::size_t i = 0; i < printed["limits"].size(); ++i) {
            EXPECT_EQ(printed["limits"][i]["y256"], expected["limits"][i]["y256"]);
            EXPECT_EQ(printed["limits"][i]["flow"], expected["limits"][i]["flow"]);
            for (const auto& [name, share] : expected["limits"][i]["composition"].items()) {
                EXPECT_NEAR(printed["limits"][i]["composition"][name].get<double>(),
                            share.get<double>(), 1e-12);
            }
        }
    }
}

TEST(Column, FarColumnsAreThereUpToTheEdge) {
    EXPECT_EQ(run({"--at", "9007199254740000,-9007199254740000"}).exit_code, kExitDone);
    for (const char* beyond : {"9007199254740992,0", "0,-9007199254740992",
                               "99999999999999999999,0", "9007199254740991,0"}) {
        EXPECT_EQ(run({"--at", beyond}).exit_code, kExitWrongUse) << beyond;
    }
    for (const char* bad : {"1", "1,2,3", "x,y", ""}) {
        EXPECT_EQ(run({"--at", bad}).exit_code, kExitWrongUse) << bad;
    }
    EXPECT_EQ(run({}).exit_code, kExitWrongUse);
}

}  // namespace
}  // namespace terrane
