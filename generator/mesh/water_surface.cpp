#include "generator/mesh/water_surface.h"

#include "generator/mesh/mesh.h"
#include "generator/mesh/shade.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/check.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <span>

namespace terrane {
namespace {

constexpr std::uint32_t kNone = UINT32_MAX;
/// Water of neighbouring columns that stands within half a voxel is one surface.
constexpr std::int32_t kOneLevel256 = kUnitsPerVoxel / 2;
/// How far a surface goes on inside the ground where it ends.
constexpr std::int32_t kInside256 = kUnitsPerVoxel / 4;
/// Of the levels around a corner so many are looked at; more than four stand in caves only.
constexpr std::size_t kLevelsMax = 32;

constexpr glm::vec3 kUp = {0, 1, 0};

/// A side of a column's square, seen from outside: the way there and its ends, as numbers of
/// corners (x + 2 * z).
struct SquareSide {
    std::int32_t dx;
    std::int32_t dz;
    std::size_t left;
    std::size_t right;
};

constexpr std::array<SquareSide, 4> kSides = {{{.dx = 1, .dz = 0, .left = 3, .right = 1},
                                               {.dx = -1, .dz = 0, .left = 0, .right = 2},
                                               {.dx = 0, .dz = 1, .left = 2, .right = 3},
                                               {.dx = 0, .dz = -1, .left = 1, .right = 0}}};

}  // namespace

WaterSurface::WaterSurface(const WorldDefinition& definition) {
    for (std::size_t i = 0; i < definition.materials.size(); ++i) {
        if (definition.materials[i].kind == MaterialKind::water) {
            material_ = static_cast<std::uint16_t>(i);
            shade_ = material_shades_of(definition)[i];
        }
    }
}

bool WaterSurface::find_wet_entries(const Palette& palette) {
    contents_.clear();
    bool is_wet = false;
    for (const PaletteEntry& entry : palette) {
        const bool water = !entry.is_solid() && entry.composition.count > 0 &&
                           entry.composition.storage[0].material == material_;
        is_wet = is_wet || water;
        contents_.push_back(water              ? Content::water
                            : entry.is_solid() ? Content::solid
                                               : Content::air);
    }
    return is_wet;
}

bool WaterSurface::find_levels(const Stack& stack) {
    if (!material_ || !find_wet_entries(stack.palette)) {
        return false;
    }
    const ColumnGrid& grid = stack.columns;
    const std::size_t columns = grid.offsets.size() - 1;
    level_begin_.clear();
    levels256_.clear();
    for (std::size_t column = 0; column < columns; ++column) {
        level_begin_.push_back(static_cast<std::uint32_t>(levels256_.size()));
        Content under = Content::solid;
        for (std::uint32_t i = grid.offsets[column]; i < grid.offsets[column + 1]; ++i) {
            const bool is_last = i + 1 == grid.offsets[column + 1];
            if (!is_last && grid.limits[i + 1].y256 <= grid.limits[i].y256) {
                continue;  // no height between them
            }
            const Content here = is_last ? Content::air : contents_[grid.limits[i].palette_id];
            if (under == Content::water && here == Content::air) {
                levels256_.push_back(grid.limits[i].y256);
            }
            under = here;
        }
    }
    level_begin_.push_back(static_cast<std::uint32_t>(levels256_.size()));
    return !levels256_.empty();
}

std::span<const std::int32_t> WaterSurface::levels_of(const Stack& stack, std::int32_t x,
                                                      std::int32_t z) const {
    const std::size_t column = stack.columns.index_of(x, z);
    return std::span(levels256_)
        .subspan(level_begin_[column], level_begin_[column + 1] - level_begin_[column]);
}

/// The mean of the levels around a corner that are one with `level256`, in the same order for all
/// who ask. A surface that crosses the range's floor or ceiling lies on it there: those under and
/// over it agree.
std::int32_t WaterSurface::corner_height(const Stack& stack, std::int32_t x, std::int32_t z,
                                         std::int32_t level256, HeightRange heights) const {
    std::array<std::int32_t, kLevelsMax> around{};
    std::size_t count = 0;
    for (std::int32_t i = 0; i < 4; ++i) {
        for (const std::int32_t level : levels_of(stack, x - 1 + i % 2, z - 1 + i / 2)) {
            if (count < kLevelsMax) {
                around[count++] = level;
            }
        }
    }
    std::sort(around.begin(), around.begin() + static_cast<std::ptrdiff_t>(count));
    const auto found = std::lower_bound(
        around.begin(), around.begin() + static_cast<std::ptrdiff_t>(count), level256);
    auto low = static_cast<std::size_t>(found - around.begin());
    if (low == count || around[low] != level256) {
        return level256;  // beyond kLevelsMax
    }
    std::size_t high = low;
    while (low > 0 && around[low] - around[low - 1] <= kOneLevel256) {
        --low;
    }
    while (high + 1 < count && around[high + 1] - around[high] <= kOneLevel256) {
        ++high;
    }
    for (const std::int64_t border : {heights.first, heights.last}) {
        const std::int64_t border256 = border * kUnitsPerVoxel;
        if (around[low] < border256 && around[high] >= border256) {
            return static_cast<std::int32_t>(border256);
        }
    }
    std::int64_t sum = 0;
    for (std::size_t i = low; i <= high; ++i) {
        sum += around[i];
    }
    return static_cast<std::int32_t>(sum / static_cast<std::int64_t>(high - low + 1));
}

std::uint32_t WaterSurface::add_vertex(Mesh& out, glm::i32vec3 position, glm::vec3 normal) const {
    const auto at = static_cast<std::uint32_t>(out.vertex_count());
    out.parts.resize(at, MeshPart::ground);
    out.positions256.push_back(position);
    out.normals.push_back(normal);
    out.colors.emplace_back(shade_.r, shade_.g, shade_.b);
    out.material_ids.push_back(shade_.material);
    out.parts.push_back(MeshPart::water);
    return at;
}

/// The vertex at a corner of the lattice; one for each height that is asked for there.
std::uint32_t WaterSurface::corner(Mesh& out, std::int32_t x, std::int32_t z, std::int32_t y256,
                                   std::int32_t side) {
    const std::size_t row = static_cast<std::size_t>(side) + 1;
    std::uint32_t& first =
        first_corner_[static_cast<std::size_t>(z) * row + static_cast<std::size_t>(x)];
    for (std::uint32_t i = first; i != kNone; i = corners_[i].next) {
        if (corners_[i].y256 == y256) {
            return corners_[i].vertex;
        }
    }
    const std::uint32_t vertex =
        add_vertex(out, {x * kUnitsPerVoxel, y256, z * kUnitsPerVoxel}, kUp);
    corners_.push_back({.y256 = y256, .vertex = vertex, .next = first});
    first = static_cast<std::uint32_t>(corners_.size() - 1);
    return vertex;
}

/// Where something that falls from `level256` in a column comes to rest: on solid or on water.
std::int32_t WaterSurface::rest_under(const Stack& stack, std::int32_t x, std::int32_t z,
                                      std::int32_t level256) const {
    std::int32_t rest = 0;
    const std::span<const Limit> limits = stack.columns.column(x, z);
    for (std::size_t i = 0; i + 1 < limits.size() && limits[i].y256 < level256; ++i) {
        if (contents_[limits[i].palette_id] != Content::air) {
            rest = std::min(limits[i + 1].y256, level256);
        }
    }
    return rest;
}

/// `heights256` are those of the square's corners, like `floor256` relative to the range's first.
void WaterSurface::add_strips(Mesh& out, const Stack& stack, std::int32_t x, std::int32_t z,
                              std::int32_t level256, const std::array<std::int32_t, 4>& heights256,
                              std::int32_t floor256) const {
    for (const SquareSide& side : kSides) {
        const auto levels = levels_of(stack, x + side.dx, z + side.dz);
        const bool goes_on = std::any_of(levels.begin(), levels.end(), [&](std::int32_t level) {
            return std::abs(level - level256) <= kOneLevel256;
        });
        const std::int32_t rest =
            goes_on ? level256 : rest_under(stack, x + side.dx, z + side.dz, level256);
        if (rest >= level256) {
            continue;
        }
        const std::int32_t bottom = std::max(rest - kInside256 - floor256, -kUnitsPerVoxel);
        const glm::vec3 normal(side.dx, 0, side.dz);
        std::array<std::uint32_t, 4> strip{};  // tops left and right, then bottoms
        for (std::size_t i = 0; i < 4; ++i) {
            const std::size_t corner = i % 2 == 0 ? side.left : side.right;
            const std::int32_t top = heights256[corner];
            strip[i] = add_vertex(out,
                                  {(x + static_cast<std::int32_t>(corner % 2)) * kUnitsPerVoxel,
                                   i < 2 ? top : std::min(top, bottom),
                                   (z + static_cast<std::int32_t>(corner / 2)) * kUnitsPerVoxel},
                                  normal);
        }
        out.indices.insert(out.indices.end(),
                           {strip[2], strip[3], strip[1], strip[2], strip[1], strip[0]});
    }
}

void WaterSurface::forget_corners(std::int32_t side) {
    const std::size_t row = static_cast<std::size_t>(side) + 1;
    first_corner_.assign(row * row, kNone);
    corners_.clear();
}

void WaterSurface::append(Mesh& out, const Stack& stack, HeightRange heights) {
    if (!find_levels(stack)) {
        return;
    }
    const std::int32_t side = stack.side;
    forget_corners(side);
    const auto floor256 = static_cast<std::int32_t>(heights.first * kUnitsPerVoxel);
    for (std::int32_t z = 0; z < side; ++z) {
        for (std::int32_t x = 0; x < side; ++x) {
            for (const std::int32_t level256 : levels_of(stack, x, z)) {
                if (level256 < heights.first * kUnitsPerVoxel ||
                    level256 >= heights.last * kUnitsPerVoxel) {
                    continue;
                }
                std::array<std::int32_t, 4> heights256{};
                std::array<std::uint32_t, 4> vertices{};
                for (std::int32_t i = 0; i < 4; ++i) {
                    const std::int32_t corner_x = x + i % 2;
                    const std::int32_t corner_z = z + i / 2;
                    const auto at = static_cast<std::size_t>(i);
                    heights256[at] =
                        corner_height(stack, corner_x, corner_z, level256, heights) - floor256;
                    vertices[at] = corner(out, corner_x, corner_z, heights256[at], side);
                }
                out.indices.insert(out.indices.end(), {vertices[0], vertices[2], vertices[3],
                                                       vertices[0], vertices[3], vertices[1]});
                add_strips(out, stack, x, z, level256, heights256, floor256);
            }
        }
    }
}

void WaterSurface::append_coarse(Mesh& out, const Stack& stack) {
    TERRANE_ASSERT(stack.position.lod >= 1);
    if (!find_levels(stack)) {
        return;
    }
    const std::int32_t side = stack.side;
    forget_corners(side);
    // Open water stands under the sky: it is the column's highest.
    const auto open_level = [&](std::int32_t x, std::int32_t z) -> std::optional<std::int32_t> {
        const auto levels = levels_of(stack, x, z);
        const std::int32_t top256 = stack.columns.column(x, z).back().y256;
        return levels.empty() || levels.back() != top256 ? std::nullopt
                                                         : std::optional(levels.back());
    };
    for (std::int32_t z = 0; z < side; ++z) {
        for (std::int32_t x = 0; x < side; ++x) {
            std::array<std::optional<std::int32_t>, 4> levels;
            std::int64_t sum = 0;
            std::int64_t count = 0;
            for (std::int32_t i = 0; i < 4; ++i) {
                auto& level = levels[static_cast<std::size_t>(i)];
                level = open_level(x + i % 2, z + i / 2);
                sum += level.value_or(0);
                count += level ? 1 : 0;
            }
            if (count == 0) {
                continue;
            }
            std::array<std::uint32_t, 4> vertices{};
            for (std::int32_t i = 0; i < 4; ++i) {
                const auto at = static_cast<std::size_t>(i);
                const std::int32_t column_x = x + i % 2;
                const std::int32_t column_z = z + i / 2;
                const auto mean256 = static_cast<std::int32_t>(sum / count);
                const std::int32_t ground256 = stack.columns.column(column_x, column_z).back().y256;
                const std::int32_t y256 =
                    levels[at] ? *levels[at] : std::min(mean256, ground256 - kInside256);
                vertices[at] = corner(out, column_x, column_z, std::max(0, y256), side);
            }
            out.indices.insert(out.indices.end(), {vertices[0], vertices[2], vertices[3],
                                                   vertices[0], vertices[3], vertices[1]});
        }
    }
}

}  // namespace terrane
