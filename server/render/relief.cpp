#include "server/render/relief.h"

#include "generator/volume/color.h"
#include "generator/world/composition.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {
namespace {

// Towards the lights: x is east, y up, z south. The first is the sun, in the north west as on maps.
constexpr glm::vec3 kSun = {-0.543F, 0.640F, -0.543F};
constexpr std::array<glm::vec3, 3> kFill = {
    {{-0.819F, 0.574F, 0.0F}, {0.0F, 0.574F, -0.819F}, {-0.45F, 0.77F, 0.45F}}};
constexpr glm::vec3 kSunColor = {1.05F, 1.0F, 0.91F};
constexpr glm::vec3 kSkyColor = {0.90F, 0.98F, 1.14F};
constexpr float kSunShare = 0.60F;
constexpr float kFillShare = 0.16F;
constexpr float kSkyShare = 0.24F;
/// The sun's height as a slope, and over how much of a slope its shadow fades.
constexpr float kSunSlope = 0.833F;
constexpr float kPenumbra = 0.35F;
constexpr std::array<std::int32_t, 8> kShadowReach = {1, 2, 3, 5, 8, 11, 15, 20};  // pixels
/// Hollows and ridges of these sizes show, in pixels.
constexpr std::array<std::int32_t, 2> kHollowSizes = {3, 11};

/// Far away, a pixel is wider than the hills are long: slopes are drawn steeper so that they show.
/// 2^(lod / 2) would keep fractal terrain as rough at all scales.
float exaggeration_of(const Relief& relief) {
    float times = 1.35F;
    float step = relief.step_voxels;
    while (step > 1.5F) {
        times *= 1.32F;
        step /= 2;
    }
    return times;
}

/// A running mean over 2 * radius + 1 samples along lines of `count` samples `stride` apart.
void blur_lines(std::vector<float>& values, std::vector<double>& sums, std::int32_t lines,
                std::size_t line_stride, std::int32_t count, std::size_t stride,
                std::int32_t radius) {
    sums.resize(static_cast<std::size_t>(count) + 1);
    for (std::int32_t line = 0; line < lines; ++line) {
        float* const first = &values[static_cast<std::size_t>(line) * line_stride];
        sums[0] = 0;
        for (std::int32_t i = 0; i < count; ++i) {
            const auto at = static_cast<std::size_t>(i);
            sums[at + 1] = sums[at] + static_cast<double>(first[at * stride]);
        }
        for (std::int32_t i = 0; i < count; ++i) {
            const std::int32_t low = std::max(0, i - radius);
            const std::int32_t high = std::min(count, i + radius + 1);
            first[static_cast<std::size_t>(i) * stride] = static_cast<float>(
                (sums[static_cast<std::size_t>(high)] - sums[static_cast<std::size_t>(low)]) /
                (high - low));
        }
    }
}

/// Twice a box in each direction, nearly a bell.
std::vector<float> blurred(const Relief& relief, std::int32_t radius) {
    std::vector<float> values = relief.heights;
    std::vector<double> sums;
    const std::int32_t columns = relief.columns();
    const std::int32_t rows = relief.rows();
    const auto row = static_cast<std::size_t>(columns);
    for (int pass = 0; pass < 2; ++pass) {
        blur_lines(values, sums, rows, row, columns, 1, radius);
        blur_lines(values, sums, columns, 1, rows, row, radius);
    }
    return values;
}

/// From -1 to 1, straight near 0.
float soft(float value) {
    return value / std::sqrt(1 + value * value);
}

float smooth(float value) {
    const float t = std::clamp(value, 0.0F, 1.0F);
    return t * t * (3 - 2 * t);
}

class Shader {
  public:
    explicit Shader(const Relief& relief) : relief_(relief), times_(exaggeration_of(relief)) {
        for (std::size_t i = 0; i < kHollowSizes.size(); ++i) {
            blurred_[i] = blurred(relief, kHollowSizes[i] << relief.detail);
        }
    }

    /// Linear light of the sample, not above 1.
    glm::vec3 light_at(std::int32_t x, std::int32_t y) const {
        const std::size_t at = relief_.index_of(x, y);
        const glm::vec3 normal = normal_at(x, y);
        const float sun = std::max(0.0F, glm::dot(normal, kSun)) / kSun.y * sun_seen(x, y);
        float fill = 0;
        for (const glm::vec3& light : kFill) {
            fill += (0.4F + 0.6F * glm::dot(normal, light)) / (0.4F + 0.6F * light.y);
        }
        const float open = openness_at(at);
        const glm::vec3 light = kSunColor * (kSunShare * sun * (0.75F + 0.25F * open)) +
                                glm::vec3(kFillShare / 3 * fill * open) +
                                kSkyColor * (kSkyShare * (0.5F + 0.5F * normal.y) * open);
        return rolled_off(tinted(at, normal) * light);
    }

  private:
    float height(std::int32_t x, std::int32_t y) const {
        return relief_.heights[relief_.index_of(x, y)];
    }

    /// Horn's gradient over the eight samples around.
    glm::vec3 normal_at(std::int32_t x, std::int32_t y) const {
        const float east = height(x + 1, y - 1) + 2 * height(x + 1, y) + height(x + 1, y + 1);
        const float west = height(x - 1, y - 1) + 2 * height(x - 1, y) + height(x - 1, y + 1);
        const float south = height(x - 1, y + 1) + 2 * height(x, y + 1) + height(x + 1, y + 1);
        const float north = height(x - 1, y - 1) + 2 * height(x, y - 1) + height(x + 1, y - 1);
        const float per_voxel = times_ / (8 * relief_.step_voxels);
        return glm::normalize(
            glm::vec3((west - east) * per_voxel, 1.0F, (north - south) * per_voxel));
    }

    float sun_seen(std::int32_t x, std::int32_t y) const {
        const float here = height(x, y);
        const float diagonal = 1.41421356F * relief_.step_voxels;
        float steepest = 0;
        for (const std::int32_t pixels : kShadowReach) {
            const std::int32_t away = pixels << relief_.detail;
            const float rise = (height(x - away, y - away) - here) * times_;
            steepest = std::max(steepest, rise / (diagonal * static_cast<float>(away)));
        }
        return 0.25F + 0.75F * smooth((kSunSlope + 0.5F * kPenumbra - steepest) / kPenumbra);
    }

    /// About 1; less in hollows, more on ridges.
    float openness_at(std::size_t at) const {
        float open = 1;
        for (std::size_t i = 0; i < kHollowSizes.size(); ++i) {
            const float size =
                static_cast<float>(kHollowSizes[i] << relief_.detail) * relief_.step_voxels;
            open += 0.26F * soft((relief_.heights[at] - blurred_[i][at]) * times_ * 5 / size);
        }
        return open;
    }

    /// The ground's own colour, greyer and darker where it is steep, brighter and a little warmer
    /// the higher it lies.
    glm::vec3 tinted(std::size_t at, glm::vec3 normal) const {
        const LinearColor& own = relief_.colors[at];
        glm::vec3 color(own.r, own.g, own.b);
        const float grey = glm::dot(color, glm::vec3(0.2126F, 0.7152F, 0.0722F));
        const float steep = std::clamp((0.92F - normal.y) * 1.6F, 0.0F, 1.0F);
        color = glm::mix(color, glm::vec3(grey * 0.82F), 0.35F * steep);
        const float up = std::clamp(relief_.heights[at] / relief_.bound_voxels, 0.0F, 1.0F);
        return color * (glm::vec3(0.80F, 0.82F, 0.86F) + up * glm::vec3(0.42F, 0.38F, 0.29F));
    }

    static glm::vec3 rolled_off(glm::vec3 light) {
        const auto one = [](float v) {
            constexpr float kKnee = 0.7F;
            return v < kKnee ? v : 1 - (1 - kKnee) * (1 - kKnee) / (v - kKnee + 1 - kKnee);
        };
        return {one(light.x), one(light.y), one(light.z)};
    }

    const Relief& relief_;
    float times_;
    std::array<std::vector<float>, kHollowSizes.size()> blurred_;
};

}  // namespace

void shade_relief(Image& out, std::int32_t x0, std::int32_t y0, const Relief& relief) {
    const Shader shader(relief);
    const std::int32_t side = 1 << relief.detail;
    const auto samples = static_cast<float>(side * side);
    for (std::int32_t y = 0; y < relief.height; ++y) {
        for (std::int32_t x = 0; x < relief.width; ++x) {
            glm::vec3 sum(0.0F);
            for (std::int32_t i = 0; i < side * side; ++i) {
                sum += shader.light_at(((x + kReliefApron) << relief.detail) + i % side,
                                       ((y + kReliefApron) << relief.detail) + i / side);
            }
            sum /= samples;
            out.at(x0 + x, y0 + y) = srgb_from_linear({.r = sum.x, .g = sum.y, .b = sum.z});
        }
    }
}

}  // namespace terrane
