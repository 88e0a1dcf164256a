// Every refusal of a world file that one line can show, with its place and its words.
#include "generator/world/world_file.h"
#include "tests/support/small_world_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <ostream>
#include <string>

namespace terrane {
namespace {

using terrane::testing::faults_of;
using terrane::testing::small_world_with;
using ::testing::ElementsAre;

/// One line of the small world replaced gives exactly one fault, which is this.
struct Refusal {
    const char* name;
    std::size_t line;
    const char* replacement;
    const char* fault;
};

/// The test's name has no address in it, so that it is the same in every run.
void PrintTo(const Refusal& refusal, std::ostream* out) {
    *out << refusal.name;
}

class WorldFileRefuses : public ::testing::TestWithParam<Refusal> {};

TEST_P(WorldFileRefuses, WithPlaceAndReason) {
    const Refusal& refusal = GetParam();
    EXPECT_THAT(faults_of(small_world_with(refusal.line, refusal.replacement)),
                ElementsAre(std::string(refusal.fault)));
}

const Refusal kRefusals[] = {
    {"FormatUnknown", 1, "format = 3",
     "w.toml:1:10: format: is 3; it must be an integer from 1 to 2"},
    {"FormatMissing", 1, "", "w.toml:1:1: format: is missing; it must be an integer from 1 to 2"},
    {"NameMissing", 2, "",
     "w.toml:1:1: name: is missing; it must be a string of 1 to 128 bytes without control "
     "characters"},
    {"NameEmpty", 2, "name = \"\"",
     "w.toml:2:8: name: has 0 bytes; it must be a string of 1 to 128 bytes without control "
     "characters"},
    {"NameWithControlCharacter", 2, "name = \"a\\u0007\"",
     "w.toml:2:8: name: \"a?\" has a control character; it must be a string of 1 to 128 bytes "
     "without control characters"},
    {"SeedMissing", 3, "", "w.toml:1:1: seed: is missing; it must be an integer"},
    {"SeedNotAnInteger", 3, "seed = 4.5", "w.toml:3:8: seed: is a float; it must be an integer"},
    {"UnknownKeyAtTheRoot", 3, "seed = 42\nsed = 1",
     "w.toml:4:1: sed: is not a known key; the nearest known one is \"seed\""},
    {"UnknownKeyInTerrain", 7, "octave = 1",
     "w.toml:7:1: terrain.octave: is not a known key; the nearest known one is \"octaves\""},
    {"MisspeltRequiredKey", 5, "deph = 40",
     "w.toml:5:1: terrain.deph: is not a known key; the nearest known one is \"depth\", which is "
     "missing; it must be a number from 2 to 4096"},
    {"UnknownKeyInGrid", 20, "voxel_size = 1.0",
     "w.toml:20:1: grid.voxel_size: is not a known key; the nearest known one is \"voxel_size_m\""},
    {"UnknownKeyInMaterial", 60, "aera = 0.9",
     "w.toml:60:1: material.aera: is not a known key; the nearest known one is \"area\""},
    {"UnknownKeyInAffinity", 68, "next_layers = []",
     "w.toml:68:1: affinity.next_layers: is not a known key; the nearest known one is "
     "\"next_layer\""},
    {"WrongTypeOfNumber", 5, "depth = \"40\"",
     "w.toml:5:9: terrain.depth: is a string; it must be a number from 2 to 4096"},
    {"WrongTypeOfText", 23, "name = 5",
     "w.toml:23:8: material.name: is an integer; it must be a string of 1 to 128 bytes without "
     "control characters"},
    {"WrongTypeOfFlag", 50, "area = 0.9\nalone = 1",
     "w.toml:51:9: material.alone: is an integer; it must be true or false"},
    {"WrongTypeOfRange", 40, "depth = 0.5",
     "w.toml:40:9: material.depth: is a float; it must be [least, best, most], three numbers with "
     "0 <= least <= best <= most <= 1"},
    {"WrongTypeInRange", 40, "depth = [0, \"0.5\", 1]",
     "w.toml:40:9: material.depth: holds a string; it must be [least, best, most], three numbers "
     "with 0 <= least <= best <= most <= 1"},
    {"RangeOfTwo", 40, "depth = [0, 1]",
     "w.toml:40:9: material.depth: has 2 values; it must be [least, best, most], three numbers "
     "with 0 <= least <= best <= most <= 1"},
    {"NumberMissing", 5, "",
     "w.toml:4:1: terrain.depth: is missing; it must be a number from 2 to 4096"},
    {"RangeMissing", 41, "",
     "w.toml:35:1: material.thickness: is missing; it must be [least, best, most], three numbers "
     "with 0 <= least <= best <= most <= 1"},
    {"NotANumber", 6, "scale = nan",
     "w.toml:6:9: terrain.scale: is nan; it must be a number from 2 to 1048576"},
    {"Infinity", 10, "roughness = inf",
     "w.toml:10:13: terrain.roughness: is inf; it must be a number from 0 to 4096"},
    {"NegativeInfinityInRange", 42, "roughness = [-inf, 0.4, 0.7]",
     "w.toml:42:13: material.roughness: least is -inf; it must be [least, best, most], three "
     "numbers with 0 <= least <= best <= most <= 1"},
    {"DuplicateId", 36, "id = 1",
     "w.toml:36:6: material.id: 1 is taken; every material needs an id of its own"},
    {"DuplicateName", 57, "name = \"granite\"",
     "w.toml:57:8: material.name: \"granite\" is taken; every material needs a name of its own"},
    {"SecondVoid", 59, "kind = \"void\"",
     "w.toml:59:8: material.kind: is \"void\" a second time; exactly one void material is allowed"},
    {"NoVoid", 25,
     "kind = \"base\"\nthickness = [0, 0, 0]\nroughness = [0, 0, 0]\nsimilarity = 0\nblend = 0",
     "w.toml:21:1: material: no material is of kind \"void\"; exactly one is needed"},
    {"NoBase", 30, "kind = \"regular\"\ndepth = [0, 0.5, 1]",
     "w.toml:21:1: material: no material is of kind \"base\"; at least one is needed"},
    {"NoRegular", 39, "kind = \"base\"",
     "w.toml:21:1: material: no material is of kind \"regular\"; at least one is needed"},
    {"UnknownKind", 39, "kind = \"regualr\"",
     "w.toml:39:8: material.kind: is \"regualr\"; it must be void, base, regular, vein or cave, "
     "in format 2 also soil, sand, snow or water; the nearest is \"regular\""},
    {"ColorNotHexadecimal", 38, "color = \"#c4a47g\"",
     "w.toml:38:9: material.color: is \"#c4a47g\"; it must be \"#rrggbb\", two hexadecimal digits "
     "a channel"},
    {"ColorTooShort", 38, "color = \"#fff\"",
     "w.toml:38:9: material.color: is \"#fff\"; it must be \"#rrggbb\", two hexadecimal digits a "
     "channel"},
    {"ColorWithoutHash", 38, "color = \"c4a4700\"",
     "w.toml:38:9: material.color: is \"c4a4700\"; it must be \"#rrggbb\", two hexadecimal digits "
     "a channel"},
    {"RangeLeastAboveBest", 41, "thickness = [0.6, 0.55, 0.8]",
     "w.toml:41:13: material.thickness: least 0.6 is above best 0.55; it must be [least, best, "
     "most], three numbers with 0 <= least <= best <= most <= 1"},
    {"RangeBestAboveMost", 41, "thickness = [0.3, 0.9, 0.8]",
     "w.toml:41:13: material.thickness: best 0.9 is above most 0.8; it must be [least, best, "
     "most], three numbers with 0 <= least <= best <= most <= 1"},
    {"RangeBelowZero", 41, "thickness = [-0.1, 0.55, 0.8]",
     "w.toml:41:13: material.thickness: least is -0.1; it must be [least, best, most], three "
     "numbers with 0 <= least <= best <= most <= 1"},
    {"RangeAboveOne", 41, "thickness = [0.3, 0.55, 1.5]",
     "w.toml:41:13: material.thickness: most is 1.5; it must be [least, best, most], three numbers "
     "with 0 <= least <= best <= most <= 1"},
    {"SimilarityAboveOne", 43, "similarity = 1.1",
     "w.toml:43:14: material.similarity: is 1.1; it must be a number from 0 to 1"},
    {"BlendBelowZero", 44, "blend = -0.1",
     "w.toml:44:9: material.blend: is -0.1; it must be a number from 0 to 1"},
    {"AreaAboveOne", 50, "area = 2",
     "w.toml:50:8: material.area: is 2; it must be a number from 0 to 1"},
    {"AffinityAboveOne", 67, "same_layer = [[\"limestone\", \"gold\", 1.5]]",
     "w.toml:67:37: affinity.same_layer: is 1.5; it must be a number from 0 to 1, or -1 for never "
     "together"},
    {"AffinityBetweenMinusOneAndZero", 67, "same_layer = [[\"limestone\", \"gold\", -0.5]]",
     "w.toml:67:37: affinity.same_layer: is -0.5; it must be a number from 0 to 1, or -1 for never "
     "together"},
    {"AffinityNotANumber", 67, "same_layer = [[\"limestone\", \"gold\", nan]]",
     "w.toml:67:37: affinity.same_layer: is nan; it must be a number from 0 to 1, or -1 for never "
     "together"},
    {"AffinityDefaultOutside", 65, "same_layer_default = -2",
     "w.toml:65:22: affinity.same_layer_default: is -2; it must be a number from 0 to 1, or -1 for "
     "never together"},
    {"AffinityDefaultOfAnotherType", 65, "same_layer_default = \"high\"",
     "w.toml:65:22: affinity.same_layer_default: is a string; it must be a number from 0 to 1, or "
     "-1 for never together"},
    {"PairThatNamesNoMaterial", 67, "same_layer = [[\"limestone\", \"golt\", -1]]",
     "w.toml:67:29: affinity.same_layer: \"golt\" is no material; the nearest is \"gold\""},
    {"PairOfTwo", 67, "same_layer = [[\"limestone\", \"gold\"]]",
     "w.toml:67:15: affinity.same_layer: has 2 values; it must be [\"material\", \"material\", "
     "affinity], the affinity from 0 to 1 or -1"},
    {"PairNotAList", 67, "same_layer = [1]",
     "w.toml:67:15: affinity.same_layer: is an integer; it must be [\"material\", \"material\", "
     "affinity], the affinity from 0 to 1 or -1"},
    {"PairOfNumbers", 67, "same_layer = [[2, \"gold\", 1]]",
     "w.toml:67:16: affinity.same_layer: is an integer; it must be [\"material\", \"material\", "
     "affinity], the affinity from 0 to 1 or -1"},
    {"PairGivenTwoAffinities", 67,
     "same_layer = [[\"limestone\", \"gold\", -1], [\"gold\", \"limestone\", 1]]",
     "w.toml:67:42: affinity.same_layer: gives a pair 1 that has -1 already; pairs work both ways "
     "and may have one affinity"},
    {"VeinAreaBeyondThePlots", 11, "vein_area = 318.5",
     "w.toml:11:13: terrain.vein_area: is 318.5; it must be at most 2 * plot - 2, 318 with plot = "
     "160"},
    {"CaveAreaBeyondThePlots", 12, "cave_area = 319",
     "w.toml:12:13: terrain.cave_area: is 319; it must be at most 2 * plot - 2, 318 with plot = "
     "160"},
    {"ChunkSidesThatDiffer", 18, "chunk = [32, 32, 16]",
     "w.toml:18:9: grid.chunk: has N = 32 and L = 16; it must be [N, M, L], three integers from 4 "
     "to 64 with N = L"},
    {"ChunkSideTooSmall", 18, "chunk = [3, 32, 3]",
     "w.toml:18:9: grid.chunk: has a side of 3; it must be [N, M, L], three integers from 4 to 64 "
     "with N = L"},
    {"ChunkSideTooGreat", 18, "chunk = [32, 65, 32]",
     "w.toml:18:9: grid.chunk: has a side of 65; it must be [N, M, L], three integers from 4 to 64 "
     "with N = L"},
    {"ChunkSideNotAnInteger", 18, "chunk = [32, 32.0, 32]",
     "w.toml:18:9: grid.chunk: holds a float; it must be [N, M, L], three integers from 4 to 64 "
     "with N = L"},
    {"ChunkOfTwoSides", 18, "chunk = [32, 32]",
     "w.toml:18:9: grid.chunk: has 2 values; it must be [N, M, L], three integers from 4 to 64 "
     "with N = L"},
    {"DepthTooSmall", 5, "depth = 1.9",
     "w.toml:5:9: terrain.depth: is 1.9; it must be a number from 2 to 4096"},
    {"DepthTooGreat", 5, "depth = 4097",
     "w.toml:5:9: terrain.depth: is 4097; it must be a number from 2 to 4096"},
    {"ScaleTooSmall", 6, "scale = 1",
     "w.toml:6:9: terrain.scale: is 1; it must be a number from 2 to 1048576"},
    {"ScaleTooGreat", 6, "scale = 1048577",
     "w.toml:6:9: terrain.scale: is 1048577; it must be a number from 2 to 1048576"},
    {"OctavesTooFew", 7, "octaves = 0",
     "w.toml:7:11: terrain.octaves: is 0; it must be an integer from 1 to 6"},
    {"OctavesTooMany", 7, "octaves = 7",
     "w.toml:7:11: terrain.octaves: is 7; it must be an integer from 1 to 6"},
    {"LayerThicknessTooGreat", 8, "layer_thickness = 4096.5",
     "w.toml:8:19: terrain.layer_thickness: is 4096.5; it must be a number from 0 to 4096"},
    {"LayerThicknessNegative", 8, "layer_thickness = -1",
     "w.toml:8:19: terrain.layer_thickness: is -1; it must be a number from 0 to 4096"},
    {"LayerSimilarityTooGreat", 9, "layer_similarity = 17",
     "w.toml:9:20: terrain.layer_similarity: is 17; it must be a number from 0 to 16"},
    {"RoughnessTooGreat", 10, "roughness = 5000",
     "w.toml:10:13: terrain.roughness: is 5000; it must be a number from 0 to 4096"},
    {"VeinAreaNegative", 11, "vein_area = -1",
     "w.toml:11:13: terrain.vein_area: is -1; it must be a number from 0 to 4096"},
    {"CaveAreaTooGreat", 12, "cave_area = 4097",
     "w.toml:12:13: terrain.cave_area: is 4097; it must be a number from 0 to 4096"},
    {"VeinThicknessTooGreat", 13, "vein_thickness = 4097",
     "w.toml:13:18: terrain.vein_thickness: is 4097; it must be a number from 0 to 4096"},
    {"CaveThicknessNegative", 14, "cave_thickness = -0.5",
     "w.toml:14:18: terrain.cave_thickness: is -0.5; it must be a number from 0 to 4096"},
    {"VeinDensityTooGreat", 15, "vein_density = 65",
     "w.toml:15:16: terrain.vein_density: is 65; it must be a number from 0 to 64"},
    {"CaveDensityNegative", 16, "cave_density = -1",
     "w.toml:16:16: terrain.cave_density: is -1; it must be a number from 0 to 64"},
    {"PlotTooSmall", 19, "plot = 3",
     "w.toml:19:8: grid.plot: is 3; it must be an integer from 4 to 4096"},
    {"PlotTooGreat", 19, "plot = 4097",
     "w.toml:19:8: grid.plot: is 4097; it must be an integer from 4 to 4096"},
    {"VoxelSizeZero", 20, "voxel_size_m = 0",
     "w.toml:20:16: grid.voxel_size_m: is 0; it must be a number from 0.001 to 1000"},
    {"TextureAboveTheFolder", 38, "color = \"#c4a470\"\ntexture = \"../x.png\"",
     "w.toml:39:11: material.texture: \"../x.png\" leaves the world file's folder; it must be a "
     "file beside it, without a leading slash or \"..\""},
    {"TextureWithLeadingSlash", 38, "color = \"#c4a470\"\ntexture = \"/etc/hostname\"",
     "w.toml:39:11: material.texture: \"/etc/hostname\" leaves the world file's folder; it must be "
     "a file beside it, without a leading slash or \"..\""},
    {"TextureMissing", 38, "color = \"#c4a470\"\ntexture = \"none.png\"",
     "w.toml:39:11: material.texture: \"none.png\": there is no such file beside the world file"},
    {"SyntaxError", 5, "depth = = 40",
     "w.toml:5:9: syntax: Error while parsing value: could not determine value type"},
};

INSTANTIATE_TEST_SUITE_P(Each, WorldFileRefuses, ::testing::ValuesIn(kRefusals),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

}  // namespace
}  // namespace terrane
