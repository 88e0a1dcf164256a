#include "server/cli/program.h"
#include "server/render/render_picture.h"
#include "server/render/trace.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace terrane {
namespace {

int run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "terrane");
    std::vector<char*> pointers;
    for (std::string& argument : arguments) {
        pointers.push_back(argument.data());
    }
    pointers.push_back(nullptr);
    return run_program(static_cast<int>(arguments.size()), pointers.data());
}

PictureView small_view() {
    return {.eye = {0, 70, 0},
            .look = {40, 52, 60},
            .width = 48,
            .height = 32,
            .field_of_view = 60,
            .block = {}};
}

TEST(Picture, SkyIsAboveAndGroundBelow) {
    const auto world = load_test_world("paper-B3-seed42");
    Image image = render_picture(*world, small_view(), 1).value();
    ASSERT_EQ(image.width, 48);
    ASSERT_EQ(image.height, 32);
    for (std::int32_t x = 0; x < image.width; ++x) {
        const Rgb8 sky = image.at(x, 0);
        EXPECT_GT(sky.b, sky.r + 20) << x;
        // None of the world's rocks is blue.
        const Rgb8 ground = image.at(x, image.height - 1);
        EXPECT_LE(ground.b, ground.r + 10) << x;
    }
}

TEST(Picture, HasTheSamePixelsWithOneThreadAndThree) {
    const auto world = load_test_world("dense-seed43");
    const Image one = render_picture(*world, small_view(), 1).value();
    EXPECT_EQ(render_picture(*world, small_view(), 3).value().pixels, one.pixels);
}

TEST(Picture, ARayStraightDownHitsEachColumnAtItsTop) {
    const auto world = load_test_world("dense-seed43");
    const Scene scene(*world, {.x = -7, .z = 11}, std::nullopt);
    SceneReader reader(scene);
    StackGenerator generator(*world);
    ColumnSet set;
    ASSERT_TRUE(generator.generate(set, {.x0 = -47, .z0 = -29, .width = 81, .length = 81}));
    int open_to_the_sky = 0;
    for (std::int32_t x = 0; x < 81; ++x) {
        for (std::int32_t z = 0; z < 81; ++z) {
            const auto limits = set.columns.column(x, z);
            // The limit under the void's first, where the column is not open down to a cave.
            const Limit& top = limits[limits.size() - 1];
            const auto hit =
                trace(reader, {.origin = {x - 40, 1000, z - 40}, .direction = {0, -1, 0}}, 2000);
            ASSERT_TRUE(hit);
            if (set.palette[limits[limits.size() - 2].palette_id].kind == PaletteKind::cave) {
                ++open_to_the_sky;
                EXPECT_LT(hit->point.y, top.y256 / 256.0) << x << ' ' << z;
            } else {
                EXPECT_NEAR(hit->point.y, top.y256 / 256.0, 0.01) << x << ' ' << z;
            }
        }
    }
    EXPECT_LT(open_to_the_sky, 81 * 81 / 2);
}

TEST(Picture, ABlockShowsItsCutSidesAndNothingOutside) {
    const auto world = load_test_world("paper-B3-seed42");
    const Scene scene(*world, {.x = 0, .z = 0},
                      ColumnBlock{.x_first = -20, .z_first = -20, .x_end = 20, .z_end = 20});
    SceneReader reader(scene);
    const auto side = trace(reader, {.origin = {0, 1, -100}, .direction = {0, 0, 1}}, 500);
    ASSERT_TRUE(side);
    EXPECT_TRUE(side->cut);
    EXPECT_EQ(side->normal, glm::dvec3(0, 0, -1));
    EXPECT_NEAR(side->point.z, -20.5, 0.01);
    EXPECT_FALSE(trace(reader, {.origin = {30, 500, 0}, .direction = {0, -1, 0}}, 1000));
}

TEST(Picture, ABuriedEyeOrNoDirectionIsRefused) {
    const auto world = load_test_world("paper-B3-seed42");
    PictureView view = small_view();
    view.eye.y = 1;
    EXPECT_EQ(render_picture(*world, view, 1).error().code, ErrorCode::invalid_argument);
    view.eye = view.look;
    EXPECT_EQ(render_picture(*world, view, 1).error().code, ErrorCode::invalid_argument);
    view = small_view();
    view.eye.x = 9e15;
    EXPECT_EQ(render_picture(*world, view, 1).error().code, ErrorCode::out_of_range);
    view = small_view();
    view.width = 70000;
    EXPECT_EQ(render_picture(*world, view, 1).error().code, ErrorCode::too_large);
}

TEST(Picture, TheProgramWritesAPngOrSaysWrongUse) {
    const auto out = std::filesystem::path(testing::TempDir()) / "terrane_picture.png";
    std::filesystem::remove(out);
    const std::string world = test_data_path("paper-B3-seed42.toml").string();
    EXPECT_EQ(
        run({"picture", "--world", world, "--eye", "0,70", "--look", "9,9,9", "-o", out.string()}),
        kExitWrongUse);
    EXPECT_EQ(
        run({"picture", "--world", world, "--eye", "0,1,0", "--look", "9,9,9", "-o", out.string()}),
        kExitWrongUse);
    for (const char* size : {"16x9", "16", "16,0", "16,9,1"}) {
        EXPECT_EQ(run({"picture", "--world", world, "--eye=-3.5,70,2", "--look", "9,40,9", "--size",
                       size, "-o", out.string()}),
                  kExitWrongUse);
    }
    EXPECT_EQ(run({"picture", "--world", world, "--eye=nan,70,2", "--look", "9,40,9", "-o",
                   out.string()}),
              kExitWrongUse);
    EXPECT_FALSE(std::filesystem::exists(out));
    EXPECT_EQ(run({"picture", "--world", world, "--eye=-3.5,70,2", "--look", "9,40,9", "--size",
                   "16,9", "-o", out.string()}),
              kExitDone);
    std::ifstream file(out, std::ios::binary);
    std::string magic(4, ' ');
    file.read(magic.data(), 4);
    EXPECT_EQ(magic, "\x89PNG");
}

}  // namespace
}  // namespace terrane
