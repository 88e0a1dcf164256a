// World files of format 2: what they may say, what is refused, their canonical form.
#include "generator/world/world_file.h"
#include "tests/support/test_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

namespace terrane {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// A small world; `format` at its head, `extra` tables and materials at its end.
std::string world_text(int format, std::string_view extra) {
    return "format = " + std::to_string(format) + R"(
name = "small"
seed = 1
[terrain]
depth = 60
scale = 50
layer_thickness = 10
layer_similarity = 1
roughness = 5
vein_area = 0
cave_area = 0
vein_thickness = 0
cave_thickness = 0
vein_density = 0
cave_density = 0
[grid]
chunk = [16, 16, 16]
plot = 32
[[material]]
id = 0
name = "air"
color = "#ffffff"
kind = "void"
[[material]]
id = 1
name = "rock"
color = "#808080"
kind = "base"
thickness = [0.5, 0.5, 0.5]
roughness = [0.5, 0.5, 0.5]
similarity = 0.5
blend = 0
[[material]]
id = 2
name = "clay"
color = "#a08060"
kind = "regular"
depth = [0, 0.5, 1]
thickness = [0.5, 0.5, 0.5]
roughness = [0.5, 0.5, 0.5]
similarity = 0.5
blend = 0
)" + std::string(extra);
}

std::vector<std::string> faults_of(int format, std::string_view extra) {
    std::vector<std::string> texts;
    for (const WorldFileFault& fault :
         parse_world_file(world_text(format, extra), "w.toml", "").faults) {
        texts.push_back(fault.text());
    }
    return texts;
}

TEST(LandscapeWorldFile, DefaultsDoNothing) {
    const auto parsed =
        parse_world_file(world_text(2, "[relief]\n[structure]\n[caves]\n"), "w", "");
    ASSERT_TRUE(parsed.ok());
    EXPECT_FALSE(parsed.definition.has_landscape());
    EXPECT_EQ(parsed.definition.relief, ReliefParameters{});
    EXPECT_EQ(parsed.definition.materials[1].hardness, 0.5);
}

TEST(LandscapeWorldFile, KeepsWhatItSays) {
    const auto parsed = parse_world_file(
        world_text(2,
                   "hardness = 0.8\nsoluble = 1\n[relief]\nheight = 50\nsea_level = 12\n"
                   "[structure]\nlift = false\nfold = 3\n[caves]\ncell = 64\nlevels = 2\n"
                   "[[material]]\nid = 9\nname = \"sea\"\ncolor = \"#0000ff\"\nkind = \"water\"\n"),
        "w", "");
    ASSERT_TRUE(parsed.ok()) << parsed.faults.front().text();
    const WorldDefinition& world = parsed.definition;
    EXPECT_TRUE(world.has_landscape());
    EXPECT_EQ(world.materials[2].hardness, 0.8);
    EXPECT_EQ(world.materials[2].soluble, 1);
    EXPECT_EQ(world.relief.sea_level, 12);
    EXPECT_FALSE(world.structure.lift);
    EXPECT_EQ(world.caves.levels, 2);
    EXPECT_EQ(world.materials[3].kind, MaterialKind::water);
    EXPECT_FALSE(is_solid(world.materials[3].kind));
}

TEST(LandscapeWorldFile, RefusesItsPartsInFormat1) {
    EXPECT_THAT(faults_of(1,
                          "[relief]\nheight = 50\n[[material]]\nid = 9\nname = \"sea\"\n"
                          "color = \"#0000ff\"\nkind = \"water\"\n"),
                ElementsAre("w.toml:43:1: relief: needs format = 2 at the file's head",
                            "w.toml:49:8: material.kind: is \"water\"; such materials need format "
                            "= 2 at the file's head"));
    EXPECT_THAT(faults_of(1, "hardness = 0.5\n"),
                ElementsAre(::testing::HasSubstr("hardness: is not a known key")));
}

TEST(LandscapeWorldFile, RefusesWithPlaceAndReason) {
    EXPECT_THAT(
        faults_of(2, "[relief]\nheigth = 50\ncliffs = 0.9\ngully_octaves = 7\noverhang = 1.5\n"),
        ElementsAre(
            "w.toml:44:1: relief.heigth: is not a known key; the nearest known one is "
            "\"height\"",
            "w.toml:45:10: relief.cliffs: is 0.9; it must be a number from 0 to 0.8",
            "w.toml:46:17: relief.gully_octaves: is 7; it must be an integer from 1 to 6",
            "w.toml:47:12: relief.overhang: is a float; it must be an integer from 0 to 6"));
    EXPECT_THAT(faults_of(2, "[caves]\ncell = 8\nradius = 0\n"),
                ElementsAre("w.toml:44:8: caves.cell: is 8; it must be 0 or from 32 to 512",
                            "w.toml:45:10: caves.radius: is 0; it must be a number from 1 to 24"));
    EXPECT_THAT(faults_of(2, "[structure]\nlift = 1\nfault_dip = nan\n"),
                ElementsAre("w.toml:44:8: structure.lift: is an integer; it must be true or false",
                            "w.toml:45:13: structure.fault_dip: is nan; it must be a number from 1 "
                            "to 8"));
    EXPECT_THAT(faults_of(2, "hardness = 2\n"),
                ElementsAre("w.toml:43:12: material.hardness: is 2; it must be a number from 0 to "
                            "1"));
    EXPECT_THAT(faults_of(2, "[relief]\nheight = 9\nground = 50\nfall = 11\n"),
                ElementsAre("w.toml:45:10: relief.ground: and fall bring rivers to height 61; they "
                            "must run in the layers, whose depth is 60"));
    const std::string soil =
        "[[material]]\nid = 9\nname = \"a\"\ncolor = \"#0000ff\"\nkind = \"soil\"\n"
        "[[material]]\nid = 10\nname = \"b\"\ncolor = \"#0000ff\"\nkind = \"soil\"\n";
    EXPECT_THAT(faults_of(2, soil),
                ElementsAre("w.toml:52:8: material.kind: is \"soil\" a second time; one such "
                            "material is allowed"));
}

TEST(LandscapeWorldFile, IsRefusedAboveTheHeightBound) {
    auto parsed = parse_world_file(
        world_text(2, "[relief]\nheight = 2048\ngullies = 512\nground = 30\nfall = 30\n"), "w", "");
    ASSERT_TRUE(parsed.ok());
    const auto world = World::build(parsed.definition);
    EXPECT_TRUE(world);
    parsed.definition.structure.fold = 1024;
    parsed.definition.terrain.depth = 4096;
    parsed.definition.terrain.roughness = 4096;
    parsed.definition.structure.fault_density = 1;
    parsed.definition.structure.fault_throw = 512;
    parsed.definition.relief.ground = 12000;
    EXPECT_FALSE(World::build(parsed.definition));
}

TEST(LandscapeWorldFile, HasACanonicalFormThatGivesTheSameWorld) {
    for (const char* name : {"canyon", "karst", "fold", "range", "alpine", "coast"}) {
        const auto world = load_shipped_world(name);
        ASSERT_NE(world, nullptr);
        const std::string text = canonical_world_file(world->definition);
        const auto again = parse_world_file(text, "w", "");
        ASSERT_TRUE(again.ok()) << again.faults.front().text();
        EXPECT_EQ(again.definition, world->definition) << name;
        EXPECT_EQ(canonical_world_file(again.definition), text);
    }
}

}  // namespace
}  // namespace terrane
