#include "server/render/section.h"

#include "generator/terrain/generate_stack.h"
#include "protocol/base/write_file.h"
#include "server/cli/program.h"
#include "server/render/section_columns.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>
#include <png.h>

#include <filesystem>
#include <fstream>
#include <iterator>
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

std::filesystem::path fresh_folder() {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    const auto folder =
        std::filesystem::path(testing::TempDir()) / ("terrane_slice_" + std::string(test->name()));
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    return folder;
}

std::size_t files_in(const std::filesystem::path& folder) {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

Result<Image> draw(const World& world, const Section& section) {
    StackGenerator generator(world);
    return draw_section({.world = &world, .generator = &generator}, section);
}

TEST(Section, TheLineKeepsBothEndsAndStepsOneColumnAtATime) {
    const auto columns = columns_on({.x = 3, .z = -1}, {.x = -4, .z = 2});
    ASSERT_EQ(columns.size(), 8U);
    EXPECT_EQ(columns.front(), (ColumnPos{.x = 3, .z = -1}));
    EXPECT_EQ(columns[4], (ColumnPos{.x = -1, .z = 1}));
    EXPECT_EQ(columns.back(), (ColumnPos{.x = -4, .z = 2}));
    EXPECT_EQ(columns_on({.x = 5, .z = 6}, {.x = 5, .z = 6}).size(), 1U);
}

TEST(Section, ThePictureIsSkyOnTopAndBaseAtTheBottom) {
    const auto world = load_test_world("paper-B3-seed42");
    const auto image =
        draw(*world, {.from = {.x = -20, .z = -20}, .to = {.x = 20, .z = 9}, .scale = 3});
    ASSERT_TRUE(image) << image.error().message;
    EXPECT_EQ(image->width, 41 * 3);
    EXPECT_EQ(image->height % 3, 0);
    Image copy = *image;
    const Rgb8 sky = copy.at(0, 0);
    EXPECT_GT(sky.b, sky.r);
    const auto base_color = world->definition
                                .materials[static_cast<std::size_t>(
                                    world->base_palette[0].composition.storage[0].material)]
                                .color;
    for (std::int32_t x = 0; x < copy.width; ++x) {
        EXPECT_EQ(copy.at(x, 0), sky);
        EXPECT_EQ(copy.at(x, copy.height - 1), base_color);
    }
}

TEST(Section, EveryColumnOfALineStandsAtItsOwnPlace) {
    // A diagonal line is generated in boxes; each column must be the one that stands there.
    const auto world = load_test_world("dense-seed43");
    const Section line = {.from = {.x = -90, .z = 71}, .to = {.x = 60, .z = -70}, .scale = 1};
    Image whole = draw(*world, line).value();
    const auto columns = columns_on(line.from, line.to);
    for (std::size_t i = 0; i < columns.size(); i += 13) {
        Image one = draw(*world, {.from = columns[i], .to = columns[i], .scale = 1}).value();
        // The terrain's part; the sky, and the pixel where both meet, depend on the picture's
        // height.
        for (std::int32_t up = 0; up + 1 < one.height; ++up) {
            const Rgb8 above = one.at(0, one.height - 2 - up);
            if (above.b > above.r && above.b > 170) {
                break;
            }
            const Rgb8 alone = one.at(0, one.height - 1 - up);
            EXPECT_EQ(whole.at(static_cast<std::int32_t>(i), whole.height - 1 - up), alone)
                << i << ' ' << up;
        }
    }
}

TEST(Section, FrontiersRunSmoothlyFromColumnToColumn) {
    // A step of 4 voxels from one column to the next, and a vein that only the left one has.
    const LinearColor low{.r = 1, .g = 0, .b = 0};
    const LinearColor vein{.r = 0, .g = 1, .b = 0};
    const auto limit = [](float y, PaletteKind kind, std::size_t sort, LinearColor color) {
        return SeenLimit{.y = y, .kind = kind, .sort = sort, .color = color};
    };
    const SeenColumn left = {
        limit(0, PaletteKind::layer, 0, low), limit(10, PaletteKind::layer, 0, low),
        limit(10, PaletteKind::vein, 900, vein), limit(16, PaletteKind::vein, 900, vein),
        limit(16, PaletteKind::void_, 2, {})};
    const SeenColumn right = {limit(0, PaletteKind::layer, 0, low),
                              limit(14, PaletteKind::layer, 0, low),
                              limit(14, PaletteKind::void_, 2, {})};
    std::vector<PairedLimit> paired;
    std::vector<float> scratch;
    pair_limits(paired, left, right, scratch);
    ASSERT_EQ(paired.size(), 5U);
    EXPECT_EQ(paired[1].y_right, 14);
    EXPECT_EQ(paired[2].y_right, 14);  // the vein closes where the right column's top is
    EXPECT_EQ(paired[3].y_right, 14);
    EXPECT_FALSE(paired[3].in_right);
    EXPECT_EQ(paired[4].kind, PaletteKind::void_);
    pair_limits(paired, right, left, scratch);
    for (std::size_t i = 1; i < paired.size(); ++i) {
        EXPECT_GE(paired[i].y_left, paired[i - 1].y_left);
        EXPECT_GE(paired[i].y_right, paired[i - 1].y_right);
    }
}

TEST(Section, AHollowWithinALayerClosesBesideItself) {
    const auto limit = [](float y, PaletteKind kind, std::size_t sort) {
        return SeenLimit{.y = y, .kind = kind, .sort = sort, .color = {}};
    };
    const SeenColumn whole = {limit(0, PaletteKind::layer, 0), limit(10, PaletteKind::layer, 1),
                              limit(70, PaletteKind::layer, 1), limit(70, PaletteKind::void_, 2)};
    const SeenColumn hollow = {limit(0, PaletteKind::layer, 0),   limit(10, PaletteKind::layer, 1),
                               limit(40, PaletteKind::layer, 1),  limit(40, PaletteKind::cave, 900),
                               limit(50, PaletteKind::cave, 900), limit(50, PaletteKind::layer, 1),
                               limit(70, PaletteKind::layer, 1),  limit(70, PaletteKind::void_, 2)};
    std::vector<PairedLimit> paired;
    std::vector<float> scratch;
    pair_limits(paired, whole, hollow, scratch);
    ASSERT_EQ(paired.size(), hollow.size());
    for (const PairedLimit& one : paired) {
        EXPECT_EQ(one.y_left, one.in_left ? one.y_right : 45);
    }
}

TEST(Section, AStoppedDrawingIsCancelled) {
    const auto world = load_test_world("paper-B3-seed42");
    StackGenerator generator(*world);
    std::stop_source source;
    source.request_stop();
    const auto image =
        draw_section({.world = world.get(), .generator = &generator, .stop = source.get_token()},
                     {.from = {}, .to = {.x = 50, .z = 0}});
    ASSERT_FALSE(image);
    EXPECT_EQ(image.error().code, ErrorCode::cancelled);
}

TEST(Section, AHeightCutsThePicture) {
    const auto world = load_test_world("paper-B3-seed42");
    const auto image =
        draw(*world, {.from = {}, .to = {.x = 9, .z = 0}, .height_voxels = 40, .scale = 2});
    ASSERT_TRUE(image);
    EXPECT_EQ(image->width, 20);
    EXPECT_EQ(image->height, 80);
}

TEST(Section, TooLongALineOrTooLargeAPictureIsRefused) {
    const auto world = load_test_world("paper-B3-seed42");
    const Section endless = {.from = {.x = -(std::int64_t{1} << 52), .z = 0},
                             .to = {.x = std::int64_t{1} << 52, .z = 0}};
    EXPECT_EQ(draw(*world, endless).error().code, ErrorCode::too_large);
    EXPECT_EQ(draw(*world, {.from = {}, .to = {.x = 20000, .z = 0}, .scale = 64}).error().code,
              ErrorCode::too_large);
    const Section edge = {.from = {.x = kColumnCoordinateLimit - 1, .z = 0},
                          .to = {.x = kColumnCoordinateLimit - 3, .z = 0}};
    EXPECT_EQ(draw(*world, edge).error().code, ErrorCode::out_of_range);
}

TEST(Section, PngFilesHoldThePixels) {
    Image image = make_image(3, 2).value();
    image.at(2, 1) = {.r = 1, .g = 2, .b = 250};
    const Bytes bytes = encode_png(image).value();
    png_image head{};
    head.version = PNG_IMAGE_VERSION;
    ASSERT_NE(png_image_begin_read_from_memory(&head, bytes.data(), bytes.size()), 0);
    EXPECT_EQ(head.width, 3U);
    EXPECT_EQ(head.height, 2U);
    head.format = PNG_FORMAT_RGB;
    std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(head));
    ASSERT_NE(png_image_finish_read(&head, nullptr, pixels.data(), 0, nullptr), 0);
    EXPECT_EQ((std::vector<std::uint8_t>(pixels.end() - 3, pixels.end())),
              (std::vector<std::uint8_t>{1, 2, 250}));
}

TEST(Section, TheProgramWritesAPngWholeOrNotAtAll) {
    const auto folder = fresh_folder();
    const std::string world = test_data_path("paper-B3-seed42.toml").string();
    const std::string out = (folder / "cut.png").string();
    EXPECT_EQ(run({"slice", "--world", world, "--from", "-5,3", "--to=-1,-9", "-o", out}),
              kExitDone);
    std::ifstream file(out, std::ios::binary);
    std::string magic(4, ' ');
    file.read(magic.data(), 4);
    EXPECT_EQ(magic, "\x89PNG");
    EXPECT_EQ(files_in(folder), 1U);
    const std::string nowhere = (folder / "no" / "cut.png").string();
    EXPECT_EQ(run({"slice", "--world", world, "--from", "0,0", "--to", "9,0", "-o", nowhere}),
              kExitFailed);
    EXPECT_EQ(files_in(folder), 1U);
}

TEST(Section, WrongUseIsExitCodeTwo) {
    const std::string world = test_data_path("paper-B3-seed42.toml").string();
    const std::string out = (fresh_folder() / "cut.png").string();
    const auto code = [&](const std::string& from, const std::string& to,
                          const std::string& scale) {
        return run(
            {"slice", "--world", world, "--from", from, "--to", to, "--scale", scale, "-o", out});
    };
    EXPECT_EQ(code("0,0", "5", "2"), kExitWrongUse);
    EXPECT_EQ(code("0;0", "5,0", "2"), kExitWrongUse);
    EXPECT_EQ(code("0,0", "9007199254740992,0", "2"), kExitWrongUse);
    EXPECT_EQ(code("0,0", "9007199254740000,0", "2"), kExitWrongUse);
    EXPECT_EQ(code("0,0", "5,0", "0"), kExitWrongUse);
    EXPECT_EQ(code("0,0", "5,0", "65"), kExitWrongUse);
    EXPECT_EQ(run({"slice", "--world", "no-such.toml", "--from", "0,0", "--to", "5,0", "-o", out}),
              kExitWrongUse);
    EXPECT_EQ(run({"slice", "--world", world, "--from", "0,0", "--to", "5,0"}), kExitWrongUse);
    EXPECT_FALSE(std::filesystem::exists(out));
}

TEST(WriteFile, AnOlderFileSurvivesAFailure) {
    const auto folder = fresh_folder();
    const auto path = folder / "a";
    ASSERT_TRUE(write_file(path, bytes_of("one")));
    ASSERT_TRUE(write_file(path, bytes_of("two")));
    EXPECT_EQ(std::filesystem::file_size(path), 3U);
    EXPECT_EQ(files_in(folder), 1U);
    const auto refused = write_file(folder, bytes_of("three"));
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::io_error);
    EXPECT_TRUE(write_file("/dev/null", bytes_of("four")));
    EXPECT_FALSE(write_file("/dev/full", bytes_of("five")));
}

}  // namespace
}  // namespace terrane
