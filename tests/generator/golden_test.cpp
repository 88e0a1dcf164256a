// The terrain's golden values: limits that two implementations written apart agree on.
#include "generator/terrain/element.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/kernels/kernel_choice.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/random.h"
#include "generator/terrain/world.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <string>

namespace terrane {
namespace {

TEST(Random, StreamsHaveTheirGoldenDraws) {
    RandomStream random(key(42, Tag::layer, 0));
    EXPECT_EQ(random.unit(), 0.9062003018842254);
    EXPECT_EQ(random.unit(), 0.61828364139114877);
    EXPECT_EQ(random.unit(), 0.42197330408462441);
}

struct GoldenNoise {
    std::int64_t x;
    std::int64_t z;
    std::uint32_t one_octave;
    std::uint32_t three_octaves;
};

TEST(Noise, HasItsGoldenBits) {
    const GoldenNoise golden[] = {
        {0, 0, 0xbed9b44eU, 0xbe78a0a0U},
        {-1, 5, 0xbecc4c2eU, 0xbe4c9cb6U},
        {100, -77, 0x3e664c25U, 0x3d300bc4U},
        {1099511640121, -1099511640121, 0xbe4aa55aU, 0xbe92532fU},
    };
    const Noise one = Noise::make(key(42, Tag::noise, 0), 28, 1);
    const Noise three = Noise::make(key(42, Tag::noise, 0), 28, 3);
    for (const GoldenNoise& at : golden) {
        EXPECT_EQ(std::bit_cast<std::uint32_t>(noise_at(one, at.x, at.z)), at.one_octave);
        EXPECT_EQ(std::bit_cast<std::uint32_t>(noise_at(three, at.x, at.z)), at.three_octaves);
    }
}

TEST(Noise, RowsEqualTheScalarTwinOnEveryKernelSet) {
    NoiseBuffers buffers;
    std::size_t compared = 0;
    for (const double period : {2.0, 3.5, 7.9, 8.0, 11.25, 16.0, 28.0, 200.0, 1048576.0}) {
        for (const std::int32_t octaves : {1, 2, 6}) {
            const Noise noise = Noise::make(key(7, Tag::noise, octaves), period, octaves);
            for (const RectangleShape& shape :
                 {RectangleShape{.x0 = -40, .z0 = -3, .width = 66, .length = 9},
                  RectangleShape{.x0 = (std::int64_t{1} << 52),
                                 .z0 = -(std::int64_t{1} << 52) + 5,
                                 .width = 12,
                                 .length = 12},
                  RectangleShape{.x0 = 5, .z0 = 5, .width = 1, .length = 1},
                  RectangleShape{.x0 = -64, .z0 = 7, .width = 128, .length = 3}}) {
                for (const KernelSet& set : available_kernel_sets()) {
                    std::vector<float> rows(shape.padded_size());
                    noise_rectangle(rows.data(), noise, shape, *set.kernels, buffers);
                    for (std::int32_t z = 0; z < shape.length; ++z) {
                        for (std::int32_t x = 0; x < shape.width; ++x) {
                            const float row =
                                rows[static_cast<std::size_t>(z * shape.stride() + x)];
                            const float twin = noise_at(noise, shape.x0 + x, shape.z0 + z);
                            ASSERT_EQ(std::bit_cast<std::uint32_t>(row),
                                      std::bit_cast<std::uint32_t>(twin))
                                << set.name << " period " << period << " octaves " << octaves
                                << " at " << x << "," << z;
                            ASSERT_LE(std::abs(twin), 1.0F);
                            ++compared;
                        }
                    }
                }
            }
        }
    }
    EXPECT_GT(compared, 50000U);
}

TEST(LayerStack, OfThePapersB3IsGolden) {
    const auto world = load_test_world("paper-B3-seed42");
    std::ifstream file(test_data_path("stack-and-elements.txt"));
    ASSERT_TRUE(file);
    std::string line;
    std::size_t layers = 0;
    std::size_t elements = 0;
    while (std::getline(file, line)) {
        std::istringstream words(line);
        std::string word;
        words >> word;
        if (word == "layer:") {
            ASSERT_LT(layers, world->stack.layers.size());
            const Layer& layer = world->stack.layers[layers++];
            double values[5] = {};
            for (double& value : values) {
                words >> word >> value;
            }
            EXPECT_DOUBLE_EQ(layer.bottom, values[0]) << line;
            EXPECT_DOUBLE_EQ(layer.thickness, values[1]) << line;
            EXPECT_DOUBLE_EQ(layer.roughness, values[2]) << line;
            EXPECT_DOUBLE_EQ(layer.similarity, values[3]) << line;
            EXPECT_DOUBLE_EQ(layer.blend, values[4]) << line;
            words >> word;
            for (const Share& share : layer.composition.shares()) {
                double concentration = 0;
                words >> word >> concentration;
                EXPECT_EQ(world->definition.materials[share.material].name, word) << line;
                EXPECT_DOUBLE_EQ(share.concentration, concentration) << line;
            }
        } else if (word == "plot") {
            PlotPos plot;
            char comma = 0;
            int type = 0;
            std::int32_t gap = 0;
            double values[5] = {};
            words >> plot.x >> comma >> plot.z >> word >> type >> word >> gap;
            words >> word >> values[0] >> values[1];
            for (std::size_t i = 2; i < 5; ++i) {
                words >> word >> values[i];
            }
            std::vector<Element> drawn;
            draw_plot(drawn, *world, plot);
            const bool found = std::any_of(drawn.begin(), drawn.end(), [&](const Element& e) {
                return static_cast<int>(e.type) == type && e.gap == gap &&
                       std::abs(e.center_x - values[0]) < 1e-5 &&
                       std::abs(e.center_z - values[1]) < 1e-5 &&
                       std::abs(e.side - values[2]) < 1e-5 &&
                       std::abs(e.thickness - values[3]) < 1e-5 &&
                       std::abs(e.roughness - values[4]) < 1e-6;
            });
            EXPECT_TRUE(found) << line;
            ++elements;
        }
    }
    EXPECT_EQ(layers, world->stack.layers.size());
    EXPECT_EQ(elements, 16U);
}

/// Compares one line of columns.jsonl with the world's own column; true if equal.
void expect_column(const nlohmann::json& golden, const World& world, const ColumnSet& set,
                   std::int32_t x, std::int32_t z) {
    const auto limits = set.columns.column(x, z);
    const auto& expected = golden["limits"];
    ASSERT_EQ(limits.size(), expected.size()) << golden["world"] << golden["x"] << golden["z"];
    for (std::size_t i = 0; i < limits.size(); ++i) {
        const auto& want = expected[i];
        ASSERT_EQ(limits[i].y256, want["y256"].get<std::int32_t>())
            << golden["world"] << golden["x"] << "," << golden["z"] << " limit " << i;
        ASSERT_EQ(limits[i].flow.x, want["flow"][0].get<int>());
        ASSERT_EQ(limits[i].flow.y, want["flow"][1].get<int>());
        ASSERT_EQ(limits[i].flow.z, want["flow"][2].get<int>());
        const Composition& composition = set.palette[limits[i].palette_id].composition;
        ASSERT_EQ(composition.count, want["composition"].size());
        for (const Share& share : composition.shares()) {
            const std::string& name = world.definition.materials[share.material].name;
            ASSERT_TRUE(want["composition"].contains(name)) << name;
            ASSERT_NEAR(share.concentration, want["composition"][name].get<double>(), 1e-12);
        }
    }
}

class GoldenColumns : public testing::TestWithParam<KernelSet> {};

TEST_P(GoldenColumns, AreAllReproduced) {
    std::ifstream file(test_data_path("columns.jsonl"));
    ASSERT_TRUE(file);
    std::map<std::string, std::shared_ptr<const World>> worlds;
    std::string line;
    std::size_t columns = 0;
    ColumnSet set;
    while (std::getline(file, line)) {
        const auto golden = nlohmann::json::parse(line);
        auto& world = worlds[golden["world"]];
        if (!world) {
            world = load_test_world(golden["world"].get<std::string>());
        }
        StackGenerator generator(*world, *GetParam().kernels);
        const auto x = golden["x"].get<std::int64_t>();
        const auto z = golden["z"].get<std::int64_t>();
        // Alone, and inside a rectangle that begins elsewhere: where it is asked from must not
        // matter.
        ASSERT_TRUE(generator.generate(set, {.x0 = x, .z0 = z, .width = 1, .length = 1}));
        expect_column(golden, *world, set, 0, 0);
        ASSERT_TRUE(generator.generate(set, {.x0 = x - 37, .z0 = z - 4, .width = 40, .length = 7}));
        expect_column(golden, *world, set, 37, 4);
        if (HasFatalFailure()) {
            return;
        }
        ++columns;
    }
    EXPECT_EQ(columns, 51U);
    EXPECT_EQ(worlds.size(), 8U);
}

INSTANTIATE_TEST_SUITE_P(EveryKernelSet, GoldenColumns,
                         testing::ValuesIn(available_kernel_sets().begin(),
                                           available_kernel_sets().end()),
                         [](const auto& set) { return std::string(set.param.name); });

}  // namespace
}  // namespace terrane
