// The rules of the house that no compiler knows: who may include whom, how long a file may be.
//
// The checker is a function from sources to sentences, so that the cases below can feed it sources
// made to be wrong; the first case feeds it the project.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {
namespace {

namespace fs = std::filesystem;

/// A file of the project. `path` is relative to the root, with forward slashes.
struct SourceFile {
    std::string path;
    std::string text;
};

constexpr std::size_t kFileLinesMax = 800;
/// A file with Beast in it takes 12 s to compile and 67 s with sanitizers.
constexpr std::size_t kBeastFilesMax = 6;

struct Include {
    std::size_t line = 0;
    std::string name;
    bool quoted = false;
};

constexpr std::array<std::string_view, 7> kModules = {
    "protocol/base", "protocol/wire", "generator", "storage", "server", "client-sample", "tests"};

/// The architecture's star: which modules a module may include, besides itself.
const std::map<std::string_view, std::set<std::string_view>>& arrows() {
    static const std::map<std::string_view, std::set<std::string_view>> kArrows = {
        {"protocol/base", {}},
        {"protocol/wire", {"protocol/base"}},
        {"generator", {"protocol/base"}},
        {"storage", {"protocol/base"}},
        {"server", {"protocol/base", "protocol/wire", "generator", "storage"}},
        {"client-sample", {"protocol/base", "protocol/wire", "generator"}},
        {"tests",
         {"protocol/base", "protocol/wire", "generator", "storage", "server", "client-sample"}}};
    return kArrows;
}

/// What the rooms that WebAssembly is to run may not have: threads and files.
constexpr std::array<std::string_view, 14> kNotInPureRooms = {
    "thread",     "mutex",      "shared_mutex",          "condition_variable", "future", "atomic",
    "fstream",    "filesystem", "protocol/base/mutex.h", "iostream",           "cstdio", "stdio.h",
    "stop_token", "semaphore"};

std::optional<std::string_view> module_of(std::string_view path) {
    if (path == "terrane_generated.h") {
        return "protocol/wire";
    }
    for (const std::string_view module : kModules) {
        if (path.starts_with(std::string(module) + "/")) {
            return module;
        }
    }
    return std::nullopt;
}

bool is_header(std::string_view path) {
    return path.ends_with(".h");
}

bool is_source(std::string_view path) {
    return is_header(path) || path.ends_with(".cpp");
}

bool is_beast(const Include& include) {
    return include.name.starts_with("boost/beast") || include.name.starts_with("boost/asio");
}

std::string at(const SourceFile& file, std::size_t line) {
    return file.path + ":" + std::to_string(line) + ": ";
}

/// The #include lines of a source, lines counted from 1.
std::vector<Include> includes_of(std::string_view text) {
    std::vector<Include> out;
    std::size_t line = 0;
    while (!text.empty()) {
        ++line;
        const std::size_t end = text.find('\n');
        std::string_view rest = text.substr(0, end);
        text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
        const auto skip = [&rest](std::string_view word) {
            rest.remove_prefix(std::min(rest.find_first_not_of(" \t"), rest.size()));
            const bool found = rest.starts_with(word);
            rest.remove_prefix(found ? word.size() : 0);
            return found;
        };
        if (!skip("#") || !skip("include") || skip("_")) {
            continue;
        }
        const bool quoted = skip("\"");
        if (!quoted && !skip("<")) {
            continue;
        }
        const std::size_t close = rest.find(quoted ? '"' : '>');
        out.push_back({.line = line, .name = std::string(rest.substr(0, close)), .quoted = quoted});
    }
    return out;
}

void check_include(std::vector<std::string>& faults, const SourceFile& file,
                   std::string_view module, const Include& include) {
    const auto included = module_of(include.name);
    if (include.quoted && !included) {
        faults.push_back(at(file, include.line) + "\"" + include.name +
                         "\" is not written from the root");
    }
    if (include.quoted && included && *included != module &&
        !arrows().at(module).contains(*included)) {
        faults.push_back(at(file, include.line) + std::string(module) + " may not include " +
                         include.name);
    }
    if (include.name.starts_with("tl/expected") && file.path != "protocol/base/result.h") {
        faults.push_back(at(file, include.line) + "results come from protocol/base/result.h");
    }
    if (is_beast(include) && is_header(file.path)) {
        faults.push_back(at(file, include.line) + "no header includes Beast or Asio");
    }
    const bool pure =
        file.path.starts_with("generator/volume/") || file.path.starts_with("generator/mesh/");
    if (pure && std::ranges::find(kNotInPureRooms, include.name) != kNotInPureRooms.end()) {
        faults.push_back(at(file, include.line) + "no threads and no files here: " + include.name);
    }
}

bool is_word_at(std::string_view text, std::size_t at, std::size_t size) {
    const auto is_letter = [&](std::size_t i) {
        return i < text.size() &&
               (std::isalnum(static_cast<unsigned char>(text[i])) != 0 || text[i] == '_');
    };
    return (at == 0 || !is_letter(at - 1)) && !is_letter(at + size);
}

// The words are put together here so that this file passes its own check.
void check_words(std::vector<std::string>& faults, const SourceFile& file) {
    for (const std::string& word :
         {std::string("TO") + "DO", std::string("FIX") + "ME", std::string("XX") + "X"}) {
        for (std::size_t i = file.text.find(word); i != std::string::npos;
             i = file.text.find(word, i + 1)) {
            if (is_word_at(file.text, i, word.size())) {
                faults.push_back(file.path + ": says " + word + "; do it or leave it out");
            }
        }
    }
    for (const std::string& place : {std::string("../sh") + "ared", std::string("/work") + "/"}) {
        if (file.text.find(place) != std::string::npos) {
            faults.push_back(file.path + ": points outside the project, at " + place);
        }
    }
}

void check_beast_files(std::vector<std::string>& faults, const std::vector<SourceFile>& files) {
    std::size_t count = 0;
    for (const SourceFile& file : files) {
        const bool ours = is_source(file.path) && !file.path.starts_with("tests/");
        const auto includes = ours ? includes_of(file.text) : std::vector<Include>();
        if (!std::ranges::any_of(includes, is_beast)) {
            continue;
        }
        ++count;
        if (!file.path.starts_with("server/net/") && !file.path.starts_with("client-sample/")) {
            faults.push_back(file.path + ": Beast and Asio live in server/net and client-sample");
        }
    }
    if (count > kBeastFilesMax) {
        faults.push_back(std::to_string(count) + " files include Beast or Asio; at most " +
                         std::to_string(kBeastFilesMax) + " may");
    }
}

std::vector<SourceFile> read_project() {
    static const std::set<std::string> kSkipped = {"build", ".git", ".cache", "node_modules"};
    static const std::set<std::string> kExtensions = {".h",   ".cpp", ".md",   ".txt", ".toml",
                                                      ".fbs", ".sh",  ".json", ".ts",  ""};
    const fs::path root(TERRANE_SOURCE_DIR);
    std::vector<SourceFile> files;
    for (auto entry = fs::recursive_directory_iterator(root); entry != fs::end(entry); ++entry) {
        if (kSkipped.contains(entry->path().filename().string())) {
            entry.disable_recursion_pending();
        } else if (entry->is_regular_file() &&
                   kExtensions.contains(entry->path().extension().string())) {
            std::ifstream in(entry->path(), std::ios::binary);
            files.push_back({.path = entry->path().lexically_relative(root).generic_string(),
                             .text = {std::istreambuf_iterator<char>(in), {}}});
        }
    }
    return files;
}

/// One sentence a fault, "path:line: what"; empty if all is well.
std::vector<std::string> faults_of(const std::vector<SourceFile>& files) {
    std::vector<std::string> faults;
    for (const SourceFile& file : files) {
        check_words(faults, file);
        const auto module = module_of(file.path);
        if (!is_source(file.path)) {
            continue;
        }
        if (!module) {
            faults.push_back(file.path + ": lies in no module");
            continue;
        }
        const auto lines = std::ranges::count(file.text, '\n');
        if (static_cast<std::size_t>(lines) > kFileLinesMax) {
            faults.push_back(file.path + ": has " + std::to_string(lines) + " lines, at most " +
                             std::to_string(kFileLinesMax));
        }
        if (is_header(file.path) && file.text.find("#pragma once\n") == std::string::npos) {
            faults.push_back(file.path + ": lacks #pragma once");
        }
        for (const Include& include : includes_of(file.text)) {
            check_include(faults, file, *module, include);
        }
    }
    check_beast_files(faults, files);
    return faults;
}

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<std::string> faults_of_one(std::string path, std::string text) {
    return faults_of({{.path = std::move(path), .text = std::move(text)}});
}

TEST(Tidy, ProjectKeepsTheRulesOfTheHouse) {
    const std::vector<SourceFile> files = read_project();
    EXPECT_GT(files.size(), 40U) << "the project was not found at " << TERRANE_SOURCE_DIR;
    EXPECT_THAT(faults_of(files), IsEmpty());
}

TEST(Tidy, FindsIncludesHoweverTheyAreSpaced) {
    const auto includes =
        includes_of("#pragma once\n#include \"a/b.h\"\n  #  include <c>\n// #include <d>\nint x;");
    ASSERT_EQ(includes.size(), 2U);
    EXPECT_EQ(includes[0].name, "a/b.h");
    EXPECT_TRUE(includes[0].quoted);
    EXPECT_EQ(includes[0].line, 2U);
    EXPECT_EQ(includes[1].name, "c");
    EXPECT_FALSE(includes[1].quoted);
    EXPECT_EQ(includes[1].line, 3U);
}

TEST(Tidy, AllowsExactlyTheArrowsOfTheStar) {
    const std::string_view base = "protocol/base";
    const std::string_view wire = "protocol/wire";
    const std::set<std::pair<std::string_view, std::string_view>> drawn = {
        {wire, base},
        {"generator", base},
        {"storage", base},
        {"server", base},
        {"server", wire},
        {"server", "generator"},
        {"server", "storage"},
        {"client-sample", base},
        {"client-sample", wire},
        {"client-sample", "generator"}};
    for (const std::string_view from : kModules) {
        for (const std::string_view to : kModules) {
            const auto faults = faults_of_one(std::string(from) + "/room/a.cpp",
                                              "#include \"" + std::string(to) + "/b.h\"\n");
            const bool allowed = from == to || from == "tests" || drawn.contains({from, to});
            EXPECT_EQ(faults.empty(), allowed) << from << " -> " << to;
        }
    }
}

TEST(Tidy, CountsTheGeneratedSchemaAsWire) {
    const std::string text = "#include \"terrane_generated.h\"\n";
    EXPECT_THAT(faults_of_one("server/net/a.cpp", text), IsEmpty());
    EXPECT_THAT(faults_of_one("storage/a.cpp", text),
                ElementsAre(HasSubstr("storage may not include terrane_generated.h")));
}

TEST(Tidy, RefusesIncludesNotWrittenFromTheRoot) {
    EXPECT_THAT(faults_of_one("storage/a.cpp", "#include \"record.h\"\n"),
                ElementsAre("storage/a.cpp:1: \"record.h\" is not written from the root"));
}

TEST(Tidy, RefusesBeastInHeadersElsewhereAndInTooManyFiles) {
    const std::string beast = "#include <boost/beast/core.hpp>\n";
    const std::string asio = "#include <boost/asio.hpp>\n";
    EXPECT_THAT(faults_of_one("server/net/a.h", "#pragma once\n" + asio),
                ElementsAre(HasSubstr("no header includes Beast or Asio")));
    EXPECT_THAT(faults_of_one("server/chunks/a.cpp", beast),
                ElementsAre(HasSubstr("live in server/net and client-sample")));
    std::vector<SourceFile> files;
    for (char name = 'a'; name < 'a' + 6; ++name) {
        files.push_back({.path = std::string("server/net/") + name + ".cpp", .text = asio});
    }
    EXPECT_THAT(faults_of(files), IsEmpty());
    files.push_back({.path = "client-sample/cpp/client.cpp", .text = asio});
    EXPECT_THAT(faults_of(files), ElementsAre(HasSubstr("7 files include Beast or Asio")));
}

TEST(Tidy, RefusesExpectedOutsideResult) {
    const std::string text = "#pragma once\n#include <tl/expected.hpp>\n";
    EXPECT_THAT(faults_of_one("protocol/base/result.h", text), IsEmpty());
    EXPECT_THAT(faults_of_one("storage/result.h", text),
                ElementsAre(HasSubstr("results come from protocol/base/result.h")));
}

TEST(Tidy, RefusesThreadsAndFilesInTheRoomsForWebAssembly) {
    for (const std::string name : {"<thread>", "<mutex>", "<fstream>", "<atomic>"}) {
        const std::string text = "#include " + name + "\n";
        EXPECT_THAT(faults_of_one("generator/volume/a.cpp", text),
                    ElementsAre(HasSubstr("no threads and no files")));
        EXPECT_THAT(faults_of_one("generator/mesh/a.cpp", text),
                    ElementsAre(HasSubstr("no threads and no files")));
        EXPECT_THAT(faults_of_one("server/chunks/a.cpp", text), IsEmpty());
    }
}

TEST(Tidy, RefusesLongFilesAndUnguardedHeaders) {
    const std::string longest(kFileLinesMax, '\n');
    EXPECT_THAT(faults_of_one("storage/a.cpp", longest), IsEmpty());
    EXPECT_THAT(faults_of_one("storage/a.cpp", longest + "\n"),
                ElementsAre(HasSubstr("801 lines")));
    EXPECT_THAT(faults_of_one("storage/a.h", "int x;\n"),
                ElementsAre("storage/a.h: lacks #pragma once"));
    EXPECT_THAT(faults_of_one("stray/a.cpp", "int x;\n"),
                ElementsAre("stray/a.cpp: lies in no module"));
}

TEST(Tidy, RefusesUnfinishedWorkAndPathsOutOfTheProject) {
    const std::string later = std::string("TO") + "DO";
    EXPECT_THAT(faults_of_one("storage/a.cpp", "// " + later + ": later\n"),
                ElementsAre(HasSubstr("says " + later)));
    EXPECT_THAT(faults_of_one("README.md", later + "\n"), ElementsAre(HasSubstr("says " + later)));
    EXPECT_THAT(faults_of_one("storage/a.cpp", "int a" + later + "b;\n"), IsEmpty());
    EXPECT_THAT(faults_of_one("README.md", std::string("see ../sh") + "ared/README\n"),
                ElementsAre(HasSubstr("points outside the project")));
}

}  // namespace
}  // namespace terrane
