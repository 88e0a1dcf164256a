#include "generator/world/world_file.h"

#include "generator/terrain/load_world.h"
#include "tests/support/small_world_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace terrane {
namespace {

using terrane::testing::faults_of;
using terrane::testing::joined;
using terrane::testing::small_world_lines;
using terrane::testing::small_world_text;
using terrane::testing::small_world_with;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// A folder of its own for a test that needs files; gone with it.
class Folder {
  public:
    Folder() {
        std::string name = (std::filesystem::temp_directory_path() / "terraneXXXXXX").string();
        path_ = ::mkdtemp(name.data());
    }

    ~Folder() { std::filesystem::remove_all(path_); }

    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;

    const std::filesystem::path& path() const { return path_; }

    std::filesystem::path write(const std::string& name, std::string_view text) const {
        std::ofstream(path_ / name, std::ios::binary) << text;
        return path_ / name;
    }

  private:
    std::filesystem::path path_;
};

TEST(WorldFile, SaysTenThingsInOnePassInTheOrderOfTheFile) {
    std::vector<std::string> lines = small_world_lines();
    lines[4] = "deph = 40";
    lines[5] = "scale = 1";
    lines[11] = "cave_area = 400";
    lines[17] = "chunk = [32, 16, 31]";
    lines[28] = "color = \"grey\"";
    lines[30] = "thickness = [0.9, 0.55, 0.8]";
    lines[37] = "colour = \"#c4a470\"";
    lines[48] = "kind = \"vien\"";
    lines[55] = "id = 1";
    lines[66] = "same_layer = [[\"limestone\", \"gold\", -2]]";
    const auto faults = faults_of(joined(lines));
    EXPECT_THAT(faults, ElementsAre(StartsWith("w.toml:5:1: terrain.deph: "),
                                    StartsWith("w.toml:6:9: terrain.scale: "),
                                    StartsWith("w.toml:12:13: terrain.cave_area: "),
                                    StartsWith("w.toml:18:9: grid.chunk: "),
                                    StartsWith("w.toml:29:9: material.color: "),
                                    StartsWith("w.toml:31:13: material.thickness: "),
                                    StartsWith("w.toml:38:1: material.colour: "),
                                    StartsWith("w.toml:49:8: material.kind: "),
                                    StartsWith("w.toml:56:6: material.id: "),
                                    StartsWith("w.toml:67:37: affinity.same_layer: ")));
}

TEST(WorldFile, ReadsEveryValueOfAGoodWorld) {
    const WorldFileResult file = parse_world_file(small_world_text(), "w.toml", "");
    ASSERT_TRUE(file.ok()) << file.faults[0].text();
    const WorldDefinition& world = file.definition;
    EXPECT_EQ(world.name, "small");
    EXPECT_EQ(world.seed, 42U);
    EXPECT_EQ(world.terrain.layer_thickness, 17.5);
    EXPECT_EQ(world.terrain.depth, 40);  // an integer in the file
    EXPECT_EQ(world.grid.side, 32);
    EXPECT_EQ(world.grid.height, 16);
    ASSERT_EQ(world.materials.size(), 5U);
    const Material& gold = world.materials[3];
    EXPECT_EQ(gold.name, "gold");
    EXPECT_EQ(gold.kind, MaterialKind::vein);
    EXPECT_EQ(gold.color,
              (Rgb8{.r = 0xfa, .g = 0xd2, .b = 0x28}));  // upper-case digits in the file
    EXPECT_EQ(gold.roughness, (Range{.least = 0.2, .best = 0.45, .most = 0.7}));
    EXPECT_EQ(world.same_layer_affinity(2, 3), -1);
    EXPECT_EQ(world.same_layer_affinity(3, 2), -1);  // pairs work both ways
    EXPECT_EQ(world.same_layer_affinity(1, 2), 1);
    EXPECT_EQ(world.next_layer_affinity(2, 3), 0.5);
}

TEST(WorldFile, FillsWhatHasADefault) {
    std::vector<std::string> lines = small_world_lines();
    lines.resize(63);   // no [affinity]
    lines[6].clear();   // octaves
    lines[19].clear();  // voxel_size_m
    lines[49].clear();  // the vein's area
    const WorldFileResult file = parse_world_file(joined(lines), "w.toml", "");
    ASSERT_TRUE(file.ok()) << file.faults[0].text();
    EXPECT_EQ(file.definition.terrain.octaves, 1);
    EXPECT_EQ(file.definition.grid.voxel_size_m, 1.0);
    EXPECT_EQ(file.definition.materials[3].area, 0);
    EXPECT_FALSE(file.definition.materials[3].alone);
    EXPECT_EQ(file.definition.next_layer_affinity(2, 3), 1);
}

TEST(WorldFile, TakesANegativeSeedAndNumbersAtTheirBounds) {
    std::vector<std::string> lines = small_world_lines();
    lines[2] = "seed = -3";
    lines[4] = "depth = 4096";
    lines[5] = "scale = 1048576";
    lines[6] = "octaves = 6";
    lines[8] = "layer_similarity = 16";
    lines[10] = "vein_area = 318";
    lines[11] = "cave_area = 0";
    lines[14] = "vein_density = 64";
    lines[17] = "chunk = [64, 4, 64]";
    const WorldFileResult file = parse_world_file(joined(lines), "w.toml", "");
    ASSERT_TRUE(file.ok()) << file.faults[0].text();
    EXPECT_EQ(file.definition.seed, static_cast<std::uint64_t>(-3));
}

TEST(WorldFile, IgnoresKeysThatMeanNothingForAKind) {
    const std::string air =
        "kind = \"void\"\nalone = true\narea = 0.5\nblend = 0.5\n"
        "depth = [0.1, 0.2, 0.3]\nthickness = [0.1, 0.2, 0.3]";
    const WorldFileResult file = parse_world_file(small_world_with(25, air), "w.toml", "");
    ASSERT_TRUE(file.ok()) << file.faults[0].text();
    EXPECT_EQ(file.definition, parse_world_file(small_world_text(), "w.toml", "").definition);
}

TEST(WorldFile, PutsMaterialsInTheOrderOfTheirIds) {
    const WorldFileResult file = parse_world_file(small_world_with(22, "id = 9"), "w.toml", "");
    ASSERT_TRUE(file.ok()) << file.faults[0].text();
    EXPECT_EQ(file.definition.materials.front().name, "granite");
    EXPECT_EQ(file.definition.materials.back().name, "air");
    EXPECT_EQ(file.definition.same_layer_affinity(1, 2), -1);  // limestone and gold, moved
}

TEST(WorldFile, RefusesMoreThan256Materials) {
    std::string text = small_world_text();
    for (int id = 5; id < 257; ++id) {
        text += "[[material]]\nid = " + std::to_string(id) + "\nname = \"m" + std::to_string(id) +
                "\"\ncolor = \"#000000\"\nkind = \"cave\"\narea = 1\ndepth = [0, 0, 1]\n"
                "thickness = [0, 0, 1]\nroughness = [0, 0, 1]\n";
    }
    const int line = 68 + 9 * 251 + 1;
    EXPECT_THAT(faults_of(text),
                ElementsAre("w.toml:" + std::to_string(line) +
                            ":1: material: there are 257 materials; at most 256 are allowed"));
}

TEST(WorldFile, RefusesAFileOverOneMebibyte) {
    std::string text = small_world_text();
    text.resize(kWorldFileBytesMax, '\n');
    EXPECT_THAT(faults_of(text), ElementsAre());
    EXPECT_THAT(faults_of(text + "\n"),
                ElementsAre("w.toml:1:1: file: is too long; at most 1048576 bytes are allowed"));
    const Folder folder;
    const auto path = folder.write("long.toml", text + "\n");
    ASSERT_EQ(load_world_file(path).faults.size(), 1U);
}

TEST(WorldFile, RefusesAFolderAndAFileThatIsNotThere) {
    const Folder folder;
    const auto none = load_world_file(folder.path() / "none.toml");
    ASSERT_EQ(none.faults.size(), 1U);
    EXPECT_THAT(none.faults[0].text(), HasSubstr("none.toml:1:1: file: cannot be opened"));
    const auto itself = load_world_file(folder.path());
    ASSERT_EQ(itself.faults.size(), 1U);
    EXPECT_THAT(itself.faults[0].text(), HasSubstr(":1:1: file: is a folder"));
}

TEST(WorldFile, RefusesAHeightBoundAbove16384AtTheTerrainTable) {
    std::vector<std::string> lines = small_world_lines();
    lines[4] = "depth = 4096";
    lines[7] = "layer_thickness = 1";
    lines[12] = "vein_thickness = 4096";
    lines[13] = "cave_thickness = 4096";
    lines[32] = "similarity = 1";
    lines[42] = "similarity = 1";
    const LoadedWorld loaded = build_world(parse_world_file(joined(lines), "w.toml", ""), "w.toml");
    EXPECT_FALSE(loaded.ok());
    ASSERT_EQ(loaded.faults.size(), 1U);
    EXPECT_THAT(loaded.faults[0].text(), StartsWith("w.toml:4:1: terrain: "));
    EXPECT_THAT(loaded.faults[0].text(), HasSubstr("16384"));
}

TEST(WorldFile, KeepsTheBytesOfEachTextureOnce) {
    const Folder folder;
    folder.write("stone.png", "bytes of stone");
    std::vector<std::string> lines = small_world_lines();
    lines[28] += "\ntexture = \"stone.png\"";
    lines[37] += "\ntexture = \"stone.png\"";
    const auto file = load_world_file(folder.write("w.toml", joined(lines)));
    ASSERT_TRUE(file.ok()) << file.faults[0].text();
    ASSERT_EQ(file.definition.textures.size(), 1U);
    EXPECT_EQ(file.definition.textures[0].name, "stone.png");
    EXPECT_EQ(file.definition.textures[0].bytes.size(), 14U);
}

TEST(WorldFile, RefusesATextureOverFourMebibytes) {
    const Folder folder;
    folder.write("big.png", std::string(kTextureBytesMax + 1, 'x'));
    const auto file = load_world_file(
        folder.write("w.toml", small_world_with(38, "color = \"#c4a470\"\ntexture = \"big.png\"")));
    ASSERT_EQ(file.faults.size(), 1U);
    EXPECT_THAT(
        file.faults[0].text(),
        HasSubstr("w.toml:39:11: material.texture: \"big.png\": is too long; at most 4194304"));
}

TEST(WorldFile, SurvivesBeingCutAtEveryByte) {
    const std::string text = small_world_text();
    for (std::size_t size = 0; size + 1 < text.size(); ++size) {
        const auto file = parse_world_file(std::string_view(text).substr(0, size), "w.toml", "");
        for (const WorldFileFault& fault : file.faults) {
            ASSERT_GE(fault.line, 1);
            ASSERT_GE(fault.column, 1);
        }
        // Up to the blend of limestone everything is needed; veins, caves and affinities are not.
        if (size < text.find("blend = 0.3")) {
            ASSERT_FALSE(file.ok()) << size;
        }
    }
}

TEST(WorldFile, SurvivesEveryFlippedByte) {
    const std::string text = small_world_text();
    for (std::size_t i = 0; i < text.size(); ++i) {
        std::string flipped = text;
        flipped[i] = static_cast<char>(~flipped[i]);  // never UTF-8, wherever it falls
        ASSERT_FALSE(parse_world_file(flipped, "w.toml", "").ok()) << i;
    }
}

}  // namespace
}  // namespace terrane
