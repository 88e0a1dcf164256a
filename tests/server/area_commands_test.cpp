// terrane verify and terrane preseed as they are called.
#include "server/cli/program.h"
#include "tests/storage/temporary_folder.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <vector>

namespace terrane {
namespace {

struct Outcome {
    int exit_code = -1;
    std::string out;
    std::string err;
};

Outcome run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "terrane");
    std::vector<char*> argv;
    for (std::string& argument : arguments) {
        argv.push_back(argument.data());
    }
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    Outcome outcome;
    outcome.exit_code = run_program(static_cast<int>(argv.size()), argv.data());
    std::fflush(stdout);
    outcome.out = testing::internal::GetCapturedStdout();
    outcome.err = testing::internal::GetCapturedStderr();
    return outcome;
}

const std::string& world_path() {
    static const std::string kPath =
        std::string(TERRANE_SOURCE_DIR) + "/generator/worlds/paper-B1.toml";
    return kPath;
}

Outcome verify(std::vector<std::string> more) {
    more.insert(more.begin(), {"verify", "--world", world_path()});
    return run(std::move(more));
}

TEST(VerifyCommand, TakesNegativeRectanglesInBothSpellings) {
    const Outcome apart = verify({"--rect", "-1,-2,1,0", "--json"});
    const Outcome joined = verify({"--rect=-1,-2,1,0", "--json", "--workers", "2"});
    EXPECT_EQ(apart.exit_code, kExitDone) << apart.err;
    EXPECT_EQ(joined.exit_code, kExitDone) << joined.err;
    EXPECT_EQ(apart.out, joined.out);
    EXPECT_TRUE(apart.out.starts_with("{\"hash\":\"")) << apart.out;
    EXPECT_TRUE(apart.out.ends_with("}\n")) << apart.out;
    EXPECT_EQ(verify({"--rect=-1,-2,1,0", "--json", "--shuffle", "9"}).out, apart.out);
}

TEST(VerifyCommand, NamesItsInnerLoopsAndRefusesUnknownOnes) {
    ::setenv("TERRANE_SIMD", "scalar", 1);
    const Outcome text = verify({"--rect", "0,0,1,1"});
    ::setenv("TERRANE_SIMD", "mmx", 1);
    const Outcome unknown = verify({"--rect", "0,0,1,1"});
    ::setenv("TERRANE_SIMD", "", 1);
    const Outcome json = verify({"--rect", "0,0,1,1", "--json"});
    ::unsetenv("TERRANE_SIMD");
    EXPECT_TRUE(text.out.ends_with(" chunks  scalar\n")) << text.out;
    EXPECT_EQ(unknown.exit_code, kExitWrongUse);
    EXPECT_NE(unknown.err.find("TERRANE_SIMD=mmx"), std::string::npos) << unknown.err;
    EXPECT_EQ(json.exit_code, kExitDone);
    EXPECT_NE(json.out.find("\"simd\":\""), std::string::npos) << json.out;
    EXPECT_TRUE(json.out.starts_with("{\"hash\":\"" + text.out.substr(0, 32))) << json.out;
}

TEST(VerifyCommand, RefusesBadAreasAndWorkersAsWrongUse) {
    for (const std::vector<std::string>& bad : std::vector<std::vector<std::string>>{
             {},
             {"--rect", "0,0,0,1"},
             {"--rect", "2,0,1,1"},
             {"--rect", "0,0,1"},
             {"--rect", "0,0,4097,4097"},
             {"--rect", "0,0,x,1"},
             {"--rect", "0,0,9999999999,1"},
             {"--rect", "0,0,1,1", "--workers", "0"},
             {"--rect", "0,0,1,1", "--workers", "257"},
             {"--rect", "0,0,1,1", "--workers", "-1"},
             {"--rect", "0,0,1,1", "--shuffle", "often"},
         }) {
        const Outcome outcome = verify(bad);
        EXPECT_EQ(outcome.exit_code, kExitWrongUse) << (bad.empty() ? "" : bad.back());
        EXPECT_EQ(outcome.out, "");
        EXPECT_NE(outcome.err, "");
    }
    EXPECT_EQ(run({"verify", "--world", "/nowhere.toml", "--rect", "0,0,1,1"}).exit_code,
              kExitWrongUse);
}

TEST(PreseedCommand, StoresAnAreaAndResumes) {
    const TemporaryFolder folder;
    const std::string data = folder.path() / "data";
    const std::vector<std::string> command = {"preseed", "--world", world_path(), "--data",
                                              data,      "--rect",  "-2,-2,1,1",  "--json"};
    const Outcome first = run(command);
    EXPECT_EQ(first.exit_code, kExitDone) << first.err;
    EXPECT_TRUE(first.out.starts_with("{\"generated\":9,\"present\":0,")) << first.out;
    const Outcome second = run(command);
    EXPECT_EQ(second.exit_code, kExitDone) << second.err;
    EXPECT_TRUE(second.out.starts_with("{\"generated\":0,\"present\":9,")) << second.out;

    std::vector<std::string> other_world = command;
    other_world[2] = std::string(TERRANE_SOURCE_DIR) + "/generator/worlds/paper-B3.toml";
    const Outcome refused = run(other_world);
    EXPECT_EQ(refused.exit_code, kExitFailed);
    EXPECT_NE(refused.err.find("'paper-B1'"), std::string::npos) << refused.err;
    EXPECT_NE(refused.err.find("'paper-B3'"), std::string::npos) << refused.err;
}

TEST(PreseedCommand, FailsOnADirectoryThatCannotBeMade) {
    const Outcome outcome = run({"preseed", "--world", world_path(), "--data",
                                 world_path() + "/data", "--rect", "0,0,1,1"});
    EXPECT_EQ(outcome.exit_code, kExitFailed);
    EXPECT_NE(outcome.err.find("use another --data directory"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace terrane
