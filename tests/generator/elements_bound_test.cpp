// How many veins and caves a world may have.
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/load_world.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <utility>

namespace terrane {
namespace {

WorldDefinition crowded() {
    const auto path = std::filesystem::path(TERRANE_SOURCE_DIR) / "tests/data/edge-dense.toml";
    WorldFileResult file = load_world_file(path);
    EXPECT_TRUE(file.ok());
    WorldDefinition definition = std::move(file.definition);
    definition.grid.side = definition.grid.height = 64;
    definition.grid.plot = 4;
    definition.terrain.vein_area = definition.terrain.cave_area = 6;
    definition.terrain.vein_density = definition.terrain.cave_density = 64;
    return definition;
}

TEST(ElementsBound, ACrowdedWorldIsRefusedWithWhatToLower) {
    const auto world = World::build(crowded());
    ASSERT_FALSE(world);
    EXPECT_EQ(world.error().code, ErrorCode::invalid_argument);
    EXPECT_NE(world.error().message.find("at most 16384"), std::string::npos);
    EXPECT_NE(world.error().message.find("lower vein_density"), std::string::npos);
}

TEST(ElementsBound, TheFaultStandsAtTerrain) {
    WorldFileResult file;
    file.definition = crowded();
    file.terrain_line = 5;
    file.terrain_column = 1;
    const LoadedWorld loaded = build_world(std::move(file), "w.toml");
    ASSERT_EQ(loaded.faults.size(), 1U);
    EXPECT_EQ(loaded.faults[0].key, "terrain");
    EXPECT_EQ(loaded.faults[0].line, 5);
}

TEST(ElementsBound, AStackOfMoreElementsThanIdsIsRefusedNotWrong) {
    WorldDefinition definition = crowded();
    definition.terrain.vein_density = definition.terrain.cave_density = 0.5;
    auto world = World::build(std::move(definition));
    ASSERT_TRUE(world) << world.error().message;
    StackGenerator sparse(*world);
    Stack stack;
    EXPECT_TRUE(sparse.generate(stack, {.lod = 0, .x = 3, .z = 3}));
    world->stack.reference_veins = 400;  // as no world file can say
    StackGenerator dense(*world);
    const auto made = dense.generate(stack, {.lod = 0, .x = 3, .z = 3});
    ASSERT_FALSE(made);
    EXPECT_EQ(made.error().code, ErrorCode::too_large);
}

}  // namespace
}  // namespace terrane
