#include "generator/terrain/load_world.h"
#include "server/cli/example_world.h"
#include "server/cli/program.h"
#include "server/cli/world_report.h"
#include "tests/support/small_world_file.h"
#include "tests/support/test_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace terrane {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

struct Outcome {
    int exit_code = 0;
    std::string out;
    std::string error;
};

/// Runs `terrane world` with these arguments in this process.
Outcome run_world(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"terrane", "world"});
    std::vector<char*> argv;
    for (std::string& argument : arguments) {
        argv.push_back(argument.data());
    }
    ::testing::internal::CaptureStdout();
    ::testing::internal::CaptureStderr();
    const int exit_code = run_program(static_cast<int>(argv.size()), argv.data());
    return {.exit_code = exit_code,
            .out = ::testing::internal::GetCapturedStdout(),
            .error = ::testing::internal::GetCapturedStderr()};
}

class WorldCommand : public ::testing::Test {
  protected:
    WorldCommand() {
        std::string name = (std::filesystem::temp_directory_path() / "terraneXXXXXX").string();
        folder_ = ::mkdtemp(name.data());
    }

    ~WorldCommand() override { std::filesystem::remove_all(folder_); }

    std::string path_of(const std::string& name) const { return (folder_ / name).string(); }

    std::string write(const std::string& name, std::string_view text) const {
        std::ofstream(folder_ / name, std::ios::binary) << text;
        return path_of(name);
    }

    std::string read(const std::string& name) const {
        std::ifstream in(folder_ / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }

  private:
    std::filesystem::path folder_;
};

TEST_F(WorldCommand, CheckSaysThatAGoodWorldIsGood) {
    const Outcome outcome =
        run_world({"check", write("w.toml", terrane::testing::small_world_text())});
    EXPECT_EQ(outcome.exit_code, kExitDone);
    EXPECT_THAT(outcome.out, HasSubstr("a good world, 5 materials"));
    EXPECT_EQ(outcome.error, "");
}

TEST_F(WorldCommand, CheckPrintsEveryFaultToStderrAndTheirCount) {
    std::vector<std::string> lines = terrane::testing::small_world_lines();
    lines[4] = "depth = 1";
    lines[5] = "scale = \"28\"";
    const std::string path = write("w.toml", terrane::testing::joined(lines));
    const Outcome outcome = run_world({"check", path});
    EXPECT_EQ(outcome.exit_code, kExitWrongUse);
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(outcome.error,
              path + ":5:9: terrain.depth: is 1; it must be a number from 2 to 4096\n" + path +
                  ":6:9: terrain.scale: is a string; it must be a number from 2 to 1048576\n"
                  "2 faults\n");
}

TEST_F(WorldCommand, CheckAndShowOfAFileThatIsNotThereAreWrongUse) {
    for (const char* verb : {"check", "show"}) {
        const Outcome outcome = run_world({verb, path_of("none.toml")});
        EXPECT_EQ(outcome.exit_code, kExitWrongUse);
        EXPECT_THAT(outcome.error, HasSubstr("none.toml:1:1: file: cannot be opened"));
        EXPECT_THAT(outcome.error, EndsWith("1 fault\n"));
    }
}

TEST_F(WorldCommand, WithoutAFileOrWithAnUnknownFlagIsWrongUse) {
    EXPECT_EQ(run_world({}).exit_code, kExitWrongUse);
    EXPECT_EQ(run_world({"check"}).exit_code, kExitWrongUse);
    EXPECT_EQ(run_world({"show", "--yaml", "x.toml"}).exit_code, kExitWrongUse);
}

TEST_F(WorldCommand, InitWritesAWorldWithoutFaultsThatShowUnderstands) {
    const std::string path = path_of("new.toml");
    EXPECT_EQ(run_world({"init", path}).exit_code, kExitDone);
    EXPECT_EQ(read("new.toml"), example_world());
    const Outcome shown = run_world({"show", path});
    EXPECT_EQ(shown.exit_code, kExitDone);
    EXPECT_EQ(shown.error, "");
    EXPECT_THAT(shown.out, HasSubstr("my world"));
}

TEST_F(WorldCommand, ShowSaysWhatALandscapeLacks) {
    std::string text(example_world());
    for (const std::string kind : {"water", "soil"}) {
        const std::size_t at = text.find("kind = \"" + kind + "\"");
        ASSERT_NE(at, std::string::npos);
        const std::size_t begin = text.rfind("[[material]]", at);
        text.erase(begin, text.find("\n\n", at) + 2 - begin);
    }
    const Outcome shown = run_world({"show", write("dry.toml", text)});
    EXPECT_EQ(shown.exit_code, kExitDone) << shown.error;
    EXPECT_THAT(shown.out, HasSubstr("but dry: no material is of kind water"));
    EXPECT_THAT(shown.out, HasSubstr("no material is of kind soil"));
    EXPECT_THAT(shown.out, HasSubstr("nothing stands above the top of the layers"));
}

TEST_F(WorldCommand, InitLeavesAnExistingFileAlone) {
    const std::string path = write("mine.toml", "my work");
    const Outcome outcome = run_world({"init", path});
    EXPECT_EQ(outcome.exit_code, kExitFailed);
    EXPECT_THAT(outcome.error, HasSubstr("mine.toml cannot be made"));
    EXPECT_EQ(read("mine.toml"), "my work");
}

TEST_F(WorldCommand, ShowPrintsTheLayersAsATableWithTheSurfaceOnTop) {
    const Outcome outcome = run_world({"show", test_data_path("paper-B3-seed42.toml").string()});
    ASSERT_EQ(outcome.exit_code, kExitDone);
    EXPECT_THAT(outcome.out, HasSubstr("origin plot    1 veins, 3 caves"));
    const auto top = outcome.out.find("4.32       4.60       0.500  0.460");
    const auto bottom = outcome.out.find("9.27       2.17       0.500  0.500");
    ASSERT_NE(top, std::string::npos) << outcome.out;
    ASSERT_NE(bottom, std::string::npos) << outcome.out;
    EXPECT_LT(top, bottom);
    EXPECT_THAT(outcome.out, HasSubstr("reg2 0.742, reg5 0.146, reg3 0.112"));
}

TEST_F(WorldCommand, ShowAsJsonHasEveryDigit) {
    const auto world = load_test_world("paper-B3-seed42");
    const Outcome outcome =
        run_world({"show", "--json", test_data_path("paper-B3-seed42.toml").string()});
    ASSERT_EQ(outcome.exit_code, kExitDone);
    const auto report = nlohmann::json::parse(outcome.out);
    EXPECT_EQ(report.at("seed"), 42);
    EXPECT_EQ(report.at("fingerprint"), to_hex(world->fingerprint));
    EXPECT_EQ(report.at("height_bound"), world->stack.height_bound);
    EXPECT_EQ(report.at("origin").at("veins"), 1);
    EXPECT_EQ(report.at("origin").at("caves"), 3);
    ASSERT_EQ(report.at("layers").size(), world->stack.layers.size());
    for (std::size_t i = 0; i < world->stack.layers.size(); ++i) {
        const Layer& layer = world->stack.layers[i];
        const auto& shown = report.at("layers").at(i);
        EXPECT_EQ(shown.at("bottom"), layer.bottom);
        EXPECT_EQ(shown.at("thickness"), layer.thickness);
        EXPECT_EQ(shown.at("similarity"), layer.similarity);
        EXPECT_EQ(shown.at("blend"), layer.blend);
        for (const Share& share : layer.composition.shares()) {
            const std::string& name = world->definition.materials[share.material].name;
            EXPECT_EQ(shown.at("composition").at(name), share.concentration);
        }
    }
}

}  // namespace
}  // namespace terrane
