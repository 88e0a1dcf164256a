#include "server/render/map_tile.h"

#include "generator/terrain/generate_stack.h"
#include "generator/volume/color.h"
#include "server/cli/program.h"
#include "server/render/relief.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace terrane {
namespace {

int difference(Rgb8 a, Rgb8 b) {
    return std::max({std::abs(a.r - b.r), std::abs(a.g - b.g), std::abs(a.b - b.b)});
}

int brightness(Rgb8 color) {
    return color.r + color.g + color.b;
}

/// A relief of one colour whose heights are height(x, y), in pixels of the picture.
template <typename Height>
Image shaded(std::int32_t side, Height height) {
    Relief relief;
    relief.width = side;
    relief.height = side;
    relief.bound_voxels = 100;
    for (std::int32_t y = 0; y < relief.rows(); ++y) {
        for (std::int32_t x = 0; x < relief.columns(); ++x) {
            relief.heights.push_back(height(x - kReliefApron, y - kReliefApron));
            relief.colors.push_back(linear_from_srgb({.r = 120, .g = 140, .b = 90}));
        }
    }
    Image image = make_image(side, side).value();
    shade_relief(image, 0, 0, relief);
    return image;
}

TEST(MapTile, IsNumberedAsSlippyMapsAre) {
    EXPECT_EQ(first_column_of(MapTile{.zoom = 18, .x = 1 << 17, .y = 1 << 17}), (ColumnPos{0, 0}));
    EXPECT_EQ(first_column_of(MapTile{.zoom = 1, .x = 1, .y = 1}), (ColumnPos{0, 0}));
    EXPECT_EQ(first_column_of(MapTile{.zoom = 18, .x = (1 << 17) - 1, .y = (1 << 17) + 2}),
              (ColumnPos{-256, 512}));
    EXPECT_EQ(first_column_of(MapTile{.zoom = 0, .x = 0, .y = 0}),
              (ColumnPos{-(1 << 25), -(1 << 25)}));
    for (const MapTile bad :
         {MapTile{.zoom = 19, .x = 0, .y = 0}, MapTile{.zoom = -1, .x = 0, .y = 0},
          MapTile{.zoom = 1, .x = 2, .y = 0}, MapTile{.zoom = 1, .x = 0, .y = -1}}) {
        const auto checked = check_map_tile(bad);
        ASSERT_FALSE(checked);
        EXPECT_EQ(checked.error().code, ErrorCode::out_of_range);
    }
}

TEST(MapTile, NeighboursFit) {
    const auto world = load_test_world("dense-seed43");
    StackGenerator generator(*world);
    const Drawing drawing{.world = world.get(), .generator = &generator};
    for (const std::int32_t zoom : {18, 15}) {
        const std::int32_t middle = 1 << (zoom - 1);
        Image left = draw_map_tile(drawing, {.zoom = zoom, .x = middle - 1, .y = middle}).value();
        Image right = draw_map_tile(drawing, {.zoom = zoom, .x = middle, .y = middle}).value();
        // A picture that has both tiles' seam in its middle.
        const std::int64_t step = std::int64_t{1} << (kMapZoomMax - zoom);
        Image across = draw_map(drawing, {.first = {.x = -64 * step, .z = 0},
                                          .width = 128,
                                          .height = 200,
                                          .lod = kMapZoomMax - zoom})
                           .value();
        for (std::int32_t y = 0; y < 200; ++y) {
            for (std::int32_t x = 0; x < 128; ++x) {
                const Rgb8 alone = x < 64 ? left.at(192 + x, y) : right.at(x - 64, y);
                // Sums of blurred heights may differ in their last bit.
                EXPECT_LE(difference(across.at(x, y), alone), 1) << zoom << ' ' << x << ' ' << y;
            }
        }
    }
}

TEST(MapTile, EveryZoomCanBeDrawn) {
    const auto world = load_test_world("paper-B3-seed42");
    StackGenerator generator(*world);
    for (std::int32_t zoom = 0; zoom <= kMapZoomMax; zoom += 6) {
        const std::int32_t last = (1 << zoom) - 1;
        const auto image = draw_map_tile({.world = world.get(), .generator = &generator},
                                         {.zoom = zoom, .x = last, .y = 0});
        ASSERT_TRUE(image) << zoom << image.error().message;
        EXPECT_EQ(image->width, kMapTilePixels);
        EXPECT_EQ(image->height, kMapTilePixels);
    }
}

TEST(MapTile, TheSamePixelsWhateverTheNumberOfThreads) {
    const auto world = load_test_world("paper-B3-seed42");
    StackGenerator generator(*world);
    // Six blocks, those at the right and the bottom narrow.
    const MapArea area{.first = {.x = -1000, .z = 70}, .width = 530, .height = 300, .lod = 5};
    const auto alone = draw_map({.world = world.get(), .generator = &generator}, area);
    ASSERT_TRUE(alone);
    for (const std::int32_t threads : {1, 3, 16}) {
        const auto image = draw_map(*world, area, threads);
        ASSERT_TRUE(image);
        EXPECT_EQ(image->pixels, alone->pixels) << threads;
    }
    const auto beyond = draw_map(
        *world, {.first = {.x = kColumnCoordinateLimit - 9, .z = 0}, .width = 600, .height = 600},
        3);
    ASSERT_FALSE(beyond);
    EXPECT_EQ(beyond.error().code, ErrorCode::out_of_range);
}

TEST(MapTile, AStoppedDrawingIsCancelled) {
    const auto world = load_test_world("paper-B3-seed42");
    StackGenerator generator(*world);
    std::stop_source source;
    source.request_stop();
    const auto image = draw_map_tile(
        {.world = world.get(), .generator = &generator, .stop = source.get_token()}, {});
    ASSERT_FALSE(image);
    EXPECT_EQ(image.error().code, ErrorCode::cancelled);
}

TEST(Relief, FlatGroundKeepsItsColor) {
    Image image = shaded(8, [](std::int32_t, std::int32_t) { return 50.0F; });
    for (const Rgb8 pixel : image.pixels) {
        EXPECT_EQ(pixel, image.pixels[0]);
    }
    EXPECT_LE(difference(image.pixels[0], {.r = 120, .g = 140, .b = 90}), 8);
}

TEST(Relief, SlopesToTheNorthWestAreBrightAndThoseAwayDark) {
    constexpr std::int32_t kMiddle = 32;
    Image image = shaded(2 * kMiddle, [](std::int32_t x, std::int32_t y) {
        const auto away = std::max(std::abs(x - kMiddle), std::abs(y - kMiddle));
        return std::max(0.0F, 20.0F - static_cast<float>(away)) * 0.6F;
    });
    const int flat = brightness(image.at(2, 2));
    EXPECT_GT(brightness(image.at(kMiddle, kMiddle - 10)), flat + 20);  // north
    EXPECT_GT(brightness(image.at(kMiddle - 10, kMiddle)), flat + 20);  // west
    EXPECT_LT(brightness(image.at(kMiddle, kMiddle + 10)), flat - 40);  // south
    EXPECT_LT(brightness(image.at(kMiddle + 10, kMiddle)), flat - 40);  // east
}

TEST(Relief, HollowsAreDarkerThanRidges) {
    const auto groove = [](float sign) {
        return shaded(64, [sign](std::int32_t x, std::int32_t) {
            const float away = static_cast<float>(x - 32) / 5;
            return 50 + sign * 6 / (1 + away * away);
        });
    };
    Image hollow = groove(-1);
    Image ridge = groove(1);
    EXPECT_LT(brightness(hollow.at(32, 32)), brightness(hollow.at(2, 32)) - 10);
    EXPECT_GT(brightness(ridge.at(32, 32)), brightness(ridge.at(2, 32)) + 10);
}

int run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "terrane");
    std::vector<char*> pointers;
    for (std::string& argument : arguments) {
        pointers.push_back(argument.data());
    }
    pointers.push_back(nullptr);
    return run_program(static_cast<int>(arguments.size()), pointers.data());
}

TEST(MapCommand, WritesAPngAndRefusesWrongUse) {
    const std::string world = test_data_path("paper-B3-seed42.toml").string();
    const std::string out = (std::filesystem::path(testing::TempDir()) / "map.png").string();
    std::filesystem::remove(out);
    EXPECT_EQ(run({"map", "--world", world, "--rect=-20,-10,44,30", "-o", out}), kExitDone);
    EXPECT_GT(std::filesystem::file_size(out), 1000U);
    EXPECT_EQ(run({"map", "--world", world, "--rect=5,5,5,9", "-o", out}), kExitWrongUse);
    EXPECT_EQ(run({"map", "--world", world, "--rect=5,5", "-o", out}), kExitWrongUse);
    EXPECT_EQ(run({"map", "--world", world, "--rect=0,0,70000,9", "--lod", "0", "-o", out}),
              kExitWrongUse);
    EXPECT_EQ(run({"map", "--world", world, "--rect=0,0,9,9", "--lod", "19", "-o", out}),
              kExitWrongUse);
    EXPECT_EQ(run({"map", "--world", world, "--rect=0,0,9,9", "-o", "/no-such-folder/map.png"}),
              kExitFailed);
}

}  // namespace
}  // namespace terrane
