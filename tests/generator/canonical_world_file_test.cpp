#include "generator/world/world_file.h"
#include "tests/support/small_world_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace terrane {
namespace {

using terrane::testing::joined;
using terrane::testing::small_world_lines;
using terrane::testing::small_world_text;
using terrane::testing::small_world_with;

WorldDefinition read(std::string_view text) {
    WorldFileResult file = parse_world_file(text, "w.toml", "");
    for (const WorldFileFault& fault : file.faults) {
        ADD_FAILURE() << fault.text();
    }
    return file.definition;
}

Hash128 fingerprint(std::string_view text) {
    return world_fingerprint(read(text));
}

/// The world files of tests/data and generator/worlds.
std::vector<std::filesystem::path> all_worlds() {
    std::vector<std::filesystem::path> worlds;
    for (const char* folder : {"tests/data", "generator/worlds"}) {
        for (const auto& entry : std::filesystem::directory_iterator(
                 std::filesystem::path(TERRANE_SOURCE_DIR) / folder)) {
            if (entry.path().extension() == ".toml") {
                worlds.push_back(entry.path());
            }
        }
    }
    std::sort(worlds.begin(), worlds.end());
    return worlds;
}

TEST(CanonicalWorldFile, IsAWorldFileOfTheSameDefinition) {
    const auto worlds = all_worlds();
    EXPECT_GE(worlds.size(), 8U + 11U);
    for (const auto& path : worlds) {
        const WorldFileResult file = load_world_file(path);
        ASSERT_TRUE(file.ok()) << file.faults[0].text();
        const std::string canonical = canonical_world_file(file.definition);
        const WorldDefinition again = read(canonical);
        EXPECT_EQ(again, file.definition) << path;
        EXPECT_EQ(canonical_world_file(again), canonical) << path;
    }
}

TEST(CanonicalWorldFile, KeepsEveryBitOfANumberAndEveryByteOfAName) {
    std::vector<std::string> lines = small_world_lines();
    lines[7] = "layer_thickness = 5e-324";
    lines[8] = "layer_similarity = 0.1234567890123456789";
    lines[9] = "roughness = 4095.9999999999995";
    lines[1] = "name = 'a \"quoted\\\" näme'";
    const WorldDefinition world = read(joined(lines));
    EXPECT_EQ(read(canonical_world_file(world)), world);
}

TEST(CanonicalWorldFile, WritesOnlyThePairsThatAreUnusual) {
    const std::string canonical = canonical_world_file(read(small_world_text()));
    EXPECT_NE(canonical.find("same_layer_default = 1\nsame_layer = [\n"
                             "[\"limestone\",\"gold\",-1],\n]\n"
                             "next_layer_default = 0.5\nnext_layer = [\n]\n"),
              std::string::npos)
        << canonical;
}

TEST(Fingerprint, DoesNotSeeCommentsSpacingOrOrder) {
    const std::string text = small_world_text();
    const Hash128 plain = fingerprint(text);

    std::string commented;
    for (const std::string& line : small_world_lines()) {
        commented += "  " + line + "   # a remark\n\n";
    }
    EXPECT_EQ(fingerprint(commented), plain);

    std::vector<std::string> lines = small_world_lines();
    std::swap(lines[0], lines[2]);    // keys of the root
    std::swap(lines[4], lines[15]);   // keys of a table
    std::swap(lines[36], lines[43]);  // keys of a material
    EXPECT_EQ(fingerprint(joined(lines)), plain);

    lines = small_world_lines();
    std::rotate(lines.begin() + 34, lines.begin() + 44, lines.begin() + 63);  // whole materials
    EXPECT_EQ(fingerprint(joined(lines)), plain);

    EXPECT_EQ(fingerprint(small_world_with(5, "depth = 40.000")), plain);
    EXPECT_EQ(fingerprint(small_world_with(10, "roughness = 1e1")), plain);
    EXPECT_EQ(fingerprint(small_world_with(67, "same_layer = [[\"gold\", \"limestone\", -1.0]]")),
              plain);
    EXPECT_EQ(fingerprint(small_world_with(16, "cave_density = -0.0")),
              fingerprint(small_world_with(16, "cave_density = 0")));
}

TEST(Fingerprint, SeesEveryValue) {
    const std::vector<std::pair<std::size_t, std::string>> changes = {
        {2, "name = \"smalls\""},
        {3, "seed = 43"},
        {3, "seed = -42"},
        {5, "depth = 40.00000000000001"},
        {7, "octaves = 2"},
        {15, "vein_density = 0.26"},
        {16, "cave_density = 0.26"},
        {18, "chunk = [32, 32, 32]"},
        {19, "plot = 161"},
        {20, "voxel_size_m = 2"},
        {27, "id = 5"},
        {28, "name = \"gneiss\""},
        {38, "color = \"#c4a471\""},
        {40, "depth = [0, 0.6, 1]"},
        {42, "roughness = [0.2, 0.4, 0.8]"},
        {43, "similarity = 0.41"},
        {44, "blend = 0.31"},
        {44, "blend = 0.3\nalone = true"},
        {50, "area = 0.8"},
        {66, "next_layer_default = 0.6"},
        {67, "same_layer = []"},
        {68, "next_layer = [[\"gold\", \"gold\", 0.1]]"}};
    std::set<Hash128> seen = {fingerprint(small_world_text())};
    for (const auto& [line, text] : changes) {
        EXPECT_TRUE(seen.insert(fingerprint(small_world_with(line, text))).second) << text;
    }
}

TEST(Fingerprint, SeesTheBytesOfTextures) {
    WorldDefinition world = read(small_world_text());
    const Hash128 without = world_fingerprint(world);
    world.textures.push_back({.name = "a.png", .bytes = {std::byte{1}}});
    const Hash128 with = world_fingerprint(world);
    world.textures[0].bytes[0] = std::byte{2};
    EXPECT_NE(with, without);
    EXPECT_NE(world_fingerprint(world), with);
}

TEST(Fingerprint, StaysWhatItWas) {
    // Data directories are named by it: it may change only with the generator version or the
    // format.
    EXPECT_EQ(to_hex(fingerprint(small_world_text())), "88b85375b7be2428f9b54b41e67bc918");
}

}  // namespace
}  // namespace terrane
