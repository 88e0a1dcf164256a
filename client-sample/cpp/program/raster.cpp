#include "client-sample/cpp/program/raster.h"

#include "generator/volume/color.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/result.h"

#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <span>
#include <string>
#include <vector>

namespace terrane {

namespace {

constexpr std::int32_t kSamples = 2;  ///< along each side of a pixel
constexpr float kNearVoxels = 0.25F;
const glm::vec3 kToSun = glm::normalize(glm::vec3(0.55F, 0.62F, -0.45F));
const glm::vec3 kSunLight(1.35F, 1.24F, 1.06F);
const glm::vec3 kSkyLight(0.26F, 0.33F, 0.44F);
const glm::vec3 kGroundLight(0.10F, 0.09F, 0.08F);

/// Highlights rolled off as film does.
LinearColor developed(glm::vec3 light) {
    const glm::vec3 shown = light / (light + 0.75F) * 1.45F;
    return {
        .r = std::min(shown.r, 1.0F), .g = std::min(shown.g, 1.0F), .b = std::min(shown.b, 1.0F)};
}

}  // namespace

Result<Bytes> png_of(const Picture& picture) {
    static_assert(sizeof(Rgb8) == 3);
    png_image head{};
    head.version = PNG_IMAGE_VERSION;
    head.width = static_cast<png_uint_32>(picture.width);
    head.height = static_cast<png_uint_32>(picture.height);
    head.format = PNG_FORMAT_RGB;
    Bytes bytes(PNG_IMAGE_PNG_SIZE_MAX(head));
    png_alloc_size_t size_bytes = bytes.size();
    if (png_image_write_to_memory(&head, bytes.data(), &size_bytes, 0, picture.pixels.data(), 0,
                                  nullptr) == 0) {
        return fail(ErrorCode::internal, std::string("png: ") + head.message);
    }
    bytes.resize(size_bytes);
    return bytes;
}

Raster::Raster(const Camera& camera)
    : camera_(camera), width_(camera.width * kSamples), height_(camera.height * kSamples) {
    TERRANE_ASSERT(camera.eye != camera.look && camera.width > 0 && camera.height > 0 &&
                   camera.width <= kPictureSideMax && camera.height <= kPictureSideMax);
    ahead_ = glm::normalize(camera.look - camera.eye);
    const bool is_upright = std::abs(ahead_.y) > 0.9999;
    right_ =
        glm::normalize(glm::cross(ahead_, is_upright ? glm::dvec3(0, 0, -1) : glm::dvec3(0, 1, 0)));
    up_ = glm::cross(right_, ahead_);
    focal_ = std::max(width_, height_) / 2.0 / std::tan(camera.field_of_view / 2);
    const auto pixels = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
    nearness_.resize(pixels);
    light_.resize(pixels);
}

glm::vec3 Raster::sky(glm::vec3 direction) const {
    const float height = std::clamp(direction.y, 0.0F, 1.0F);
    const glm::vec3 horizon(0.78F, 0.83F, 0.9F);
    const glm::vec3 zenith(0.16F, 0.33F, 0.68F);
    const float glow = std::pow(std::max(glm::dot(direction, kToSun), 0.0F), 24.0F);
    return glm::mix(horizon, zenith, std::sqrt(height)) + glow * 0.35F * kSunLight;
}

/// Light is found at the corners: triangles are small where one can see it.
Raster::Seen Raster::seen(const RasterVertex& vertex) const {
    const glm::dvec3 place(vertex.from_eye);
    const float sun = std::max(glm::dot(vertex.normal, kToSun), 0.0F);
    const float open = 0.5F + 0.5F * vertex.normal.y;
    const glm::vec3 light = kSunLight * sun + glm::mix(kGroundLight, kSkyLight, open);
    const glm::vec3 color(vertex.color.r, vertex.color.g, vertex.color.b);
    const float share = glm::length(glm::vec2(vertex.from_eye.x, vertex.from_eye.z)) /
                        static_cast<float>(camera_.horizon_voxels);
    // Clear over most of the way, so that a small radius is no fog.
    const float haze = 1 - std::exp(-4 * share * share * share * share);
    const glm::vec3 direction = glm::normalize(vertex.from_eye);
    return {
        .place = glm::vec3(glm::dot(place, right_), glm::dot(place, up_), glm::dot(place, ahead_)),
        .light = glm::mix(color * light, sky({direction.x, 0, direction.z}), haze)};
}

Raster::Corner Raster::corner(const Seen& seen) const {
    const double nearness = 1 / static_cast<double>(seen.place.z);
    return {.x = width_ / 2.0 + focal_ * seen.place.x * nearness,
            .y = height_ / 2.0 - focal_ * seen.place.y * nearness,
            .nearness = nearness,
            .light = seen.light * static_cast<float>(nearness)};
}

void Raster::draw(std::span<const RasterVertex> vertices, std::span<const std::uint32_t> indices) {
    std::vector<Seen> placed;
    placed.reserve(vertices.size());
    std::ranges::transform(vertices, std::back_inserter(placed),
                           [this](const RasterVertex& vertex) { return seen(vertex); });
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
        // Cut at the near plane: a triangle becomes up to four corners.
        std::array<Corner, 4> corners;
        std::size_t count = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            const Seen& from = placed[indices[i + k]];
            const Seen& to = placed[indices[i + (k + 1) % 3]];
            if (from.place.z >= kNearVoxels) {
                corners[count++] = corner(from);
            }
            if ((from.place.z >= kNearVoxels) != (to.place.z >= kNearVoxels)) {
                const float share = (kNearVoxels - from.place.z) / (to.place.z - from.place.z);
                Seen cut{.place = glm::mix(from.place, to.place, share),
                         .light = glm::mix(from.light, to.light, share)};
                cut.place.z = kNearVoxels;
                corners[count++] = corner(cut);
            }
        }
        for (std::size_t k = 2; k < count; ++k) {
            fill(corners[0], corners[k - 1], corners[k]);
        }
    }
}

void Raster::fill(const Corner& a, const Corner& b, const Corner& c) {
    // Counter-clockwise in space is clockwise on a screen whose y goes down.
    const double area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if (!(area < 0)) {
        return;
    }
    const auto [x_low, x_high] = std::minmax({a.x, b.x, c.x});
    const auto [y_low, y_high] = std::minmax({a.y, b.y, c.y});
    const auto x_first =
        static_cast<std::int32_t>(std::clamp(std::floor(x_low), 0.0, width_ - 1.0));
    const auto x_last = static_cast<std::int32_t>(std::clamp(std::ceil(x_high), 0.0, width_ - 1.0));
    const auto y_first =
        static_cast<std::int32_t>(std::clamp(std::floor(y_low), 0.0, height_ - 1.0));
    const auto y_last =
        static_cast<std::int32_t>(std::clamp(std::ceil(y_high), 0.0, height_ - 1.0));
    for (std::int32_t y = y_first; y <= y_last; ++y) {
        for (std::int32_t x = x_first; x <= x_last; ++x) {
            const double px = x + 0.5;
            const double py = y + 0.5;
            const double share_a = ((b.x - px) * (c.y - py) - (b.y - py) * (c.x - px)) / area;
            const double share_b = ((c.x - px) * (a.y - py) - (c.y - py) * (a.x - px)) / area;
            const double share_c = 1 - share_a - share_b;
            if (share_a < 0 || share_b < 0 || share_c < 0) {
                continue;
            }
            const auto nearness = static_cast<float>(share_a * a.nearness + share_b * b.nearness +
                                                     share_c * c.nearness);
            const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                                   static_cast<std::size_t>(x);
            if (nearness <= nearness_[at]) {
                continue;
            }
            nearness_[at] = nearness;
            light_[at] =
                (a.light * static_cast<float>(share_a) + b.light * static_cast<float>(share_b) +
                 c.light * static_cast<float>(share_c)) /
                nearness;
        }
    }
}

double Raster::covered() const {
    const auto covered = std::ranges::count_if(nearness_, [](float n) { return n > 0; });
    return static_cast<double>(covered) / static_cast<double>(nearness_.size());
}

Picture Raster::picture() const {
    Picture picture{.width = camera_.width, .height = camera_.height, .pixels = {}};
    picture.pixels.reserve(static_cast<std::size_t>(camera_.width) *
                           static_cast<std::size_t>(camera_.height));
    for (std::int32_t y = 0; y < camera_.height; ++y) {
        for (std::int32_t x = 0; x < camera_.width; ++x) {
            glm::vec3 sum{};
            for (std::int32_t sample = 0; sample < kSamples * kSamples; ++sample) {
                const std::int32_t sx = x * kSamples + sample % kSamples;
                const std::int32_t sy = y * kSamples + sample / kSamples;
                const std::size_t at =
                    static_cast<std::size_t>(sy) * static_cast<std::size_t>(width_) +
                    static_cast<std::size_t>(sx);
                if (nearness_[at] > 0) {
                    sum += light_[at];
                } else {
                    const glm::dvec3 ray = ahead_ * focal_ + right_ * (sx + 0.5 - width_ / 2.0) +
                                           up_ * (height_ / 2.0 - sy - 0.5);
                    sum += sky(glm::vec3(glm::normalize(ray)));
                }
            }
            picture.pixels.push_back(
                srgb_from_linear(developed(sum / static_cast<float>(kSamples * kSamples))));
        }
    }
    return picture;
}

}  // namespace terrane
