#include "server/render/section.h"

#include "generator/volume/color.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/render/drawing.h"
#include "server/render/picture_keys.h"
#include "server/render/section_columns.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

namespace terrane {
namespace {

// What a picture is to fit in when nobody says: most of a full-HD screen.
constexpr std::int64_t kGoodWidth = 1600;
constexpr std::int64_t kGoodHeight = 900;
constexpr std::int64_t kGoodScaleMax = 12;

constexpr Rgb8 kSkyAtTop = {.r = 118, .g = 170, .b = 222};
constexpr Rgb8 kSkyAtGround = {.r = 226, .g = 238, .b = 246};
// Caves are dark but for a glimmer on the floor, which tells them from black rock.
constexpr Rgb8 kCaveFloor = {.r = 74, .g = 62, .b = 80};
constexpr Rgb8 kCaveDark = {.r = 13, .g = 10, .b = 17};
/// Heights that are looked at in a pixel.
constexpr std::int32_t kSamples = 4;

LinearColor mix(LinearColor a, LinearColor b, float share) {
    return {.r = a.r + (b.r - a.r) * share,
            .g = a.g + (b.g - a.g) * share,
            .b = a.b + (b.b - a.b) * share};
}

std::int64_t highest_voxel(std::span<const SeenColumn> columns) {
    float highest = 0;
    for (const SeenColumn& column : columns) {
        highest = std::max(highest, column.back().y);
    }
    return static_cast<std::int64_t>(highest) + 1;
}

/// Height of the picture in voxels: a sixth of the terrain's is sky.
std::int64_t picture_voxels(std::span<const SeenColumn> columns) {
    const std::int64_t terrain = highest_voxel(columns);
    return terrain + std::max<std::int64_t>(3, terrain / 6);
}

std::int64_t good_scale(std::int64_t columns, std::int64_t voxels) {
    return std::clamp<std::int64_t>(std::min(kGoodWidth / columns, kGoodHeight / voxels), 1,
                                    kGoodScaleMax);
}

/// The void, from light above the ground to blue at the picture's top.
std::vector<LinearColor> sky_rows(std::int32_t height) {
    std::vector<LinearColor> rows;
    for (std::int32_t row = 0; row < height; ++row) {
        // The terrain takes most of the height, so the gradient runs over the upper third.
        const float down = std::min(1.0F, static_cast<float>(row) * 3 / static_cast<float>(height));
        rows.push_back(mix(linear_from_srgb(kSkyAtTop), linear_from_srgb(kSkyAtGround), down));
    }
    return rows;
}

/// A limit where a pixel's column of samples meets it.
struct CutLimit {
    float y = 0;
    PaletteKind kind = PaletteKind::layer;
    LinearColor color;
};

/// The limits at `share` of the way from the left column to the right one.
void cut_limits(std::vector<CutLimit>& out, std::span<const PairedLimit> paired, float share) {
    out.clear();
    for (const PairedLimit& limit : paired) {
        if ((share <= 0 && !limit.in_left) || (share >= 1 && !limit.in_right)) {
            continue;
        }
        out.push_back({.y = limit.y_left + (limit.y_right - limit.y_left) * share,
                       .kind = limit.kind,
                       .color = mix(limit.color_left, limit.color_right, share)});
    }
}

LinearColor color_between(const CutLimit& lo, const CutLimit& hi, float y) {
    const float share = hi.y > lo.y ? std::min(1.0F, (y - lo.y) / (hi.y - lo.y)) : 0.0F;
    if (lo.kind == PaletteKind::cave) {
        return mix(linear_from_srgb(kCaveFloor), linear_from_srgb(kCaveDark),
                   std::min(1.0F, 2 * share));
    }
    return mix(lo.color, hi.color, share);
}

/// Adds what a pixel column shows, bottom up, to `sums`.
void add_samples(std::span<LinearColor> sums, std::span<const CutLimit> limits, std::int32_t scale,
                 std::span<const LinearColor> sky) {
    std::size_t i = 0;
    for (std::size_t up = 0; up < sums.size(); ++up) {
        LinearColor sum;
        for (std::int32_t sample = 0; sample < kSamples; ++sample) {
            const float y =
                (static_cast<float>(up) + (static_cast<float>(sample) + 0.5F) / kSamples) /
                static_cast<float>(scale);
            while (i + 1 < limits.size() && limits[i + 1].y <= y) {
                ++i;
            }
            const CutLimit& lo = limits[i];
            const LinearColor color =
                lo.kind == PaletteKind::void_
                    ? sky[sums.size() - 1 - up]
                    : color_between(lo, limits[std::min(i + 1, limits.size() - 1)], y);
            sum = {.r = sum.r + color.r, .g = sum.g + color.g, .b = sum.b + color.b};
        }
        sums[up].r += sum.r / kSamples;
        sums[up].g += sum.g / kSamples;
        sums[up].b += sum.b / kSamples;
    }
}

/// Draws one pixel column after the other.
class SectionPainter {
  public:
    SectionPainter(Image& image, std::span<const SeenColumn> columns, std::int32_t scale)
        : image_(image),
          columns_(columns),
          scale_(scale),
          sky_(sky_rows(image.height)),
          sums_(static_cast<std::size_t>(image.height)) {}

    void draw(std::int32_t x) {
        // A pixel that is a column shows that column; wider ones are looked at twice a pixel.
        const std::int32_t looks = scale_ > 1 ? 2 : 1;
        std::fill(sums_.begin(), sums_.end(), LinearColor{});
        for (std::int32_t look = 0; look < looks; ++look) {
            const float within = (static_cast<float>(look) + 0.5F) / static_cast<float>(looks);
            cut_at((static_cast<float>(x % scale_) + within) / static_cast<float>(scale_) - 0.5F,
                   x / scale_);
            add_samples(sums_, limits_, scale_, sky_);
        }
        const auto count = static_cast<float>(looks);
        for (std::int32_t up = 0; up < image_.height; ++up) {
            const LinearColor& sum = sums_[static_cast<std::size_t>(up)];
            image_.at(x, image_.height - 1 - up) =
                srgb_from_linear({.r = sum.r / count, .g = sum.g / count, .b = sum.b / count});
        }
    }

  private:
    /// The limits `away` columns from the middle of column `index`; half a column at the most.
    void cut_at(float away, std::int32_t index) {
        const std::int32_t left = std::clamp(away < 0 ? index - 1 : index, 0, last());
        const std::int32_t right = std::clamp(away < 0 ? index : index + 1, 0, last());
        if (left != left_ || right != right_) {
            pair_limits(paired_, columns_[static_cast<std::size_t>(left)],
                        columns_[static_cast<std::size_t>(right)], scratch_);
            left_ = left;
            right_ = right;
        }
        cut_limits(limits_, paired_, away < 0 ? 1 + away : away);
    }

    std::int32_t last() const { return static_cast<std::int32_t>(columns_.size()) - 1; }

    Image& image_;
    std::span<const SeenColumn> columns_;
    std::int32_t scale_;
    std::vector<LinearColor> sky_;
    std::vector<LinearColor> sums_;
    std::int32_t left_ = -1;
    std::int32_t right_ = -1;
    std::vector<PairedLimit> paired_;
    std::vector<float> scratch_;
    std::vector<CutLimit> limits_;
};

std::int64_t steps_of(const Section& section) {
    return std::max(std::abs(section.to.x - section.from.x),
                    std::abs(section.to.z - section.from.z));
}

}  // namespace

Result<void> check_section(const Section& section) {
    const auto inside = [](std::int64_t at) {
        return at > -kColumnCoordinateLimit && at < kColumnCoordinateLimit;
    };
    if (!inside(section.from.x) || !inside(section.from.z) || !inside(section.to.x) ||
        !inside(section.to.z)) {
        return fail(ErrorCode::out_of_range, "columns end at 2^53");
    }
    if (steps_of(section) >= kImageSideMax) {
        return fail(ErrorCode::too_large, "a line of " + std::to_string(steps_of(section) + 1) +
                                              " columns is too long: at most " +
                                              std::to_string(kImageSideMax));
    }
    if (section.scale < 0 || section.scale > kSectionScaleMax) {
        return fail(ErrorCode::out_of_range, "scale " + std::to_string(section.scale) + ": 1 to " +
                                                 std::to_string(kSectionScaleMax) +
                                                 " pixels a voxel");
    }
    if (section.height_voxels < 0 || section.height_voxels > kSectionHeightMax) {
        return fail(ErrorCode::out_of_range, "height " + std::to_string(section.height_voxels) +
                                                 ": 1 to " + std::to_string(kSectionHeightMax) +
                                                 " voxels");
    }
    return {};
}

Result<Image> draw_section(const Drawing& drawing, const Section& section) {
    if (auto checked = check_section(section); !checked) {
        return tl::unexpected(checked.error());
    }
    const auto columns = see_columns(drawing, columns_on(section.from, section.to));
    if (!columns) {
        return tl::unexpected(columns.error());
    }
    const auto count = static_cast<std::int64_t>(columns->size());
    const std::int64_t voxels =
        section.height_voxels > 0 ? section.height_voxels : picture_voxels(*columns);
    const std::int64_t scale = section.scale > 0 ? section.scale : good_scale(count, voxels);
    auto image = make_image(count * scale, voxels * scale);
    if (!image) {
        return image;
    }
    SectionPainter painter(*image, *columns, static_cast<std::int32_t>(scale));
    for (std::int32_t x = 0; x < image->width; ++x) {
        if (auto on = go_on(drawing); !on) {
            return tl::unexpected(on.error());
        }
        painter.draw(x);
    }
    return image;
}

}  // namespace terrane
