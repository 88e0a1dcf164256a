#include "server/render/render_picture.h"

#include "generator/terrain/world.h"
#include "generator/volume/color.h"
#include "generator/world/composition.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/render/draw_pieces.h"
#include "server/render/light.h"
#include "server/render/scene.h"
#include "server/render/trace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <string>

namespace terrane {
namespace {

// Four rays a pixel, on a turned grid: edges in any direction get four shades.
constexpr std::array<std::array<double, 2>, 4> kSamples = {
    {{0.375, 0.125}, {0.875, 0.375}, {0.125, 0.625}, {0.625, 0.875}}};
constexpr double kHaze = 5200;  // voxels

struct Camera {
    glm::dvec3 eye{};
    glm::dvec3 forward{};
    glm::dvec3 right{};  ///< half the picture's width at distance 1
    glm::dvec3 down{};   ///< half its height
};

Camera camera_of(const PictureView& view, glm::dvec3 eye) {
    const glm::dvec3 forward = glm::normalize(view.look - view.eye);
    // Straight up or down, north (-z) is at the picture's top or bottom.
    const glm::dvec3 side = std::abs(forward.y) < 0.9999
                                ? glm::normalize(glm::cross(forward, {0, 1, 0}))
                                : glm::dvec3(1, 0, 0);
    const glm::dvec3 down = glm::cross(forward, side);
    const double longer = std::tan(view.field_of_view / 360 * std::numbers::pi);
    const double width = view.width;
    const double height = view.height;
    return {.eye = eye,
            .forward = forward,
            .right = side * (longer * width / std::max(width, height)),
            .down = down * (longer * height / std::max(width, height))};
}

/// The sun stands behind the viewer's left shoulder: light and shadow show every shape.
Light light_of(const PictureView& view, const Camera& camera) {
    const double ahead = std::atan2(camera.forward.z, camera.forward.x);
    const double azimuth = ahead - 115 * std::numbers::pi / 180;
    const double height = (view.block ? 40 : 24) * std::numbers::pi / 180;
    return {.to_sun = {std::cos(height) * std::cos(azimuth), std::sin(height),
                       std::cos(height) * std::sin(azimuth)},
            .haze_voxels = view.block ? 0 : kHaze};
}

/// Behind a cut-out block there is no sky but a sheet of paper, lighter towards the bottom.
glm::dvec3 backdrop(double down) {
    return glm::mix(glm::dvec3(0.52, 0.63, 0.76), glm::dvec3(0.90, 0.93, 0.96),
                    std::clamp(down, 0.0, 1.0));
}

void draw_row(Image& image, std::int32_t row, SceneReader& reader, const Camera& camera,
              const Light& light) {
    for (std::int32_t x = 0; x < image.width; ++x) {
        LinearColor sum;
        SkyMemory memory;  // each pixel's own, so that it does not matter who draws its neighbour
        for (const auto& sample : kSamples) {
            const double right = 2 * (x + sample[0]) / image.width - 1;
            const double down = 2 * (row + sample[1]) / image.height - 1;
            const Ray ray{.origin = camera.eye,
                          .direction = glm::normalize(camera.forward + camera.right * right +
                                                      camera.down * down)};
            const auto hit = trace(reader, ray, kSightMax, Sight::solid_and_water);
            const LinearColor one =
                develop(hit                    ? surface_light(reader, light, ray, *hit, memory)
                        : reader.scene().box() ? backdrop(0.5 + 0.5 * down)
                                               : sky_light(light, ray.direction));
            sum.r += one.r / static_cast<float>(kSamples.size());
            sum.g += one.g / static_cast<float>(kSamples.size());
            sum.b += one.b / static_cast<float>(kSamples.size());
        }
        image.at(x, row) = srgb_from_linear(sum);
    }
}

Result<void> check(const PictureView& view) {
    constexpr double kEdge = static_cast<double>(kColumnCoordinateLimit) / 2;
    const auto inside = [](double v) { return std::abs(v) < kEdge; };
    if (!inside(view.eye.x) || !inside(view.eye.z) || !inside(view.eye.y) || !inside(view.look.x) ||
        !inside(view.look.y) || !inside(view.look.z)) {
        return fail(ErrorCode::out_of_range, "eye and look must be within 2^52 of the origin");
    }
    if (!(glm::length(view.look - view.eye) > 1e-6)) {
        return fail(ErrorCode::invalid_argument, "eye and look are the same place");
    }
    if (view.block) {
        const std::int64_t width = view.block->x_end - view.block->x_first;
        const std::int64_t length = view.block->z_end - view.block->z_first;
        if (width < 1 || length < 1 || width > kBlockSideMax || length > kBlockSideMax) {
            return fail(ErrorCode::invalid_argument,
                        "a block has 1 to " + std::to_string(kBlockSideMax) + " columns a side");
        }
    }
    return {};
}

}  // namespace

Result<Image> render_picture(const World& world, const PictureView& view, std::int32_t threads,
                             const TellDrawn& tell) {
    if (auto checked = check(view); !checked) {
        return tl::unexpected(checked.error());
    }
    auto image = make_image(view.width, view.height);
    if (!image) {
        return image;
    }
    // A column's centre is half a voxel behind its number.
    const ColumnPos origin{.x = static_cast<std::int64_t>(std::floor(view.eye.x)),
                           .z = static_cast<std::int64_t>(std::floor(view.eye.z))};
    const glm::dvec3 eye(view.eye.x - static_cast<double>(origin.x) - 0.5, view.eye.y,
                         view.eye.z - static_cast<double>(origin.z) - 0.5);
    const Scene scene(world, origin, view.block);
    if (SceneReader reader(scene); !view.block && reader.density_at(eye) > 0) {
        return fail(ErrorCode::invalid_argument,
                    "the eye is inside the ground, whose top there is at " +
                        std::to_string(static_cast<std::int64_t>(reader.top_at(eye.x, eye.z))));
    }
    const Camera camera = camera_of(view, eye);
    const Light light = light_of(view, camera);
    const auto drawn = draw_pieces(view.height, threads, tell, [&]() -> DrawPiece {
        const auto reader = std::make_shared<SceneReader>(scene);
        return [&, reader](std::int32_t row) -> Result<void> {
            draw_row(*image, row, *reader, camera, light);
            return {};
        };
    });
    if (!drawn) {
        return tl::unexpected(drawn.error());
    }
    return image;
}

}  // namespace terrane
