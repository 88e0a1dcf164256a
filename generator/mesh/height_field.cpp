#include "generator/mesh/height_field.h"

#include "generator/mesh/mesh.h"
#include "generator/mesh/shade.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

namespace terrane {
namespace {

constexpr std::int32_t kColumn256 = 256;

/// The highest limit that shows something solid; the base always is.
const Limit& top_of(std::span<const Limit> column, const Palette& palette) {
    std::size_t i = column.size() - 1;
    while (i > 0 && !palette[column[i].palette_id].is_solid()) {
        --i;
    }
    return column[i];
}

glm::vec3 normal_of(std::int32_t top256, std::int32_t before_x256, std::int32_t before_z256) {
    constexpr float kScale = 1.0F / 256.0F;
    const float slope_x = static_cast<float>(top256 - before_x256) * kScale;
    const float slope_z = static_cast<float>(top256 - before_z256) * kScale;
    const float length = std::sqrt(slope_x * slope_x + 1.0F + slope_z * slope_z);
    return {-slope_x / length, 1.0F / length, -slope_z / length};
}

/// Two triangles of the cell between four vertices, split along the flatter diagonal. `corner` is
/// the vertex at the cell's (0, 0), `row` the distance to the next row's.
void add_cell(Mesh& mesh, std::uint32_t corner, std::uint32_t row) {
    const auto height = [&mesh](std::uint32_t vertex) { return mesh.positions256[vertex].y; };
    const std::uint32_t a = corner;
    const std::uint32_t b = corner + 1;
    const std::uint32_t c = corner + row;
    const std::uint32_t d = corner + row + 1;
    const bool along_ad = std::abs(height(a) - height(d)) <= std::abs(height(b) - height(c));
    if (along_ad) {
        mesh.indices.insert(mesh.indices.end(), {a, c, d, a, d, b});
    } else {
        mesh.indices.insert(mesh.indices.end(), {a, c, b, b, c, d});
    }
}

/// The vertices of one side, one after the other; the solid lies to the right of the way.
struct Side {
    std::uint32_t first;
    std::int64_t stride;
    glm::vec3 outward;

    std::uint32_t at(std::int32_t i) const {
        return static_cast<std::uint32_t>(first + i * stride);
    }
};

std::int32_t skirt_end256(const Mesh& mesh, std::uint32_t at, std::int64_t depth256) {
    return static_cast<std::int32_t>(std::max<std::int64_t>(0, mesh.positions256[at].y - depth256));
}

/// Hangs a strip under a side.
void add_skirt(Mesh& mesh, const Side& side, std::int32_t count, std::int64_t depth256) {
    auto below = static_cast<std::uint32_t>(mesh.vertex_count());
    for (std::int32_t i = 0; i < count; ++i) {
        const std::uint32_t at = side.at(i);
        glm::i32vec3 position = mesh.positions256[at];
        position.y = skirt_end256(mesh, at, depth256);
        mesh.positions256.push_back(position);
        mesh.normals.push_back(glm::vec3(mesh.normals[at]));
        mesh.colors.push_back(glm::u8vec3(mesh.colors[at]));
        mesh.material_ids.push_back(std::uint8_t{mesh.material_ids[at]});
        if (i > 0) {
            const std::uint32_t before = side.at(i - 1);
            mesh.indices.insert(mesh.indices.end(), {at, before, below, before, below - 1, below});
        }
        ++below;
    }
}

/// Closes what is under a side's skirt, down to y = 0: the ends of level 0's caves. Shows what each
/// column stands on.
void add_cap(Mesh& mesh, const Side& side, std::int32_t count, std::int64_t depth256,
             const ColumnGrid& columns, std::span<const PaletteShade> shades) {
    auto low = static_cast<std::uint32_t>(mesh.vertex_count()) + 1;
    for (std::int32_t i = 0; i < count; ++i) {
        const std::uint32_t at = side.at(i);
        const glm::i32vec3 top = mesh.positions256[at];
        const Limit& base = columns.column(top.x / kColumn256, top.z / kColumn256).front();
        const Shade rock = shades[base.palette_id].shade;
        for (const std::int32_t y256 : {skirt_end256(mesh, at, depth256), 0}) {
            mesh.positions256.emplace_back(top.x, y256, top.z);
            mesh.normals.push_back(side.outward);
            mesh.colors.emplace_back(rock.r, rock.g, rock.b);
            mesh.material_ids.push_back(rock.material);
            mesh.parts.push_back(MeshPart::cave);
        }
        if (i > 0) {
            const std::uint32_t high = low - 1;
            mesh.indices.insert(mesh.indices.end(), {high, high - 2, low, high - 2, low - 2, low});
        }
        low += 2;
    }
}

}  // namespace

HeightFieldMesher::HeightFieldMesher(const WorldDefinition& definition)
    : material_colors_(linear_colors_of(definition)),
      is_landscape_(definition.has_landscape()),
      water_(definition) {}

void HeightFieldMesher::mesh(Mesh& out, const Stack& stack, bool with_skirts) {
    TERRANE_ASSERT(stack.position.lod >= 1);
    out.clear();
    find_palette_shades(shades_, stack.palette, material_colors_);
    const std::int32_t vertices = stack.side + 1;
    const std::size_t row = static_cast<std::size_t>(vertices) + 1;  // of tops, from column -1 on
    tops256_.resize(row * row);
    std::size_t at = 0;
    for (std::int32_t z = -1; z < vertices; ++z) {
        for (std::int32_t x = -1; x < vertices; ++x, ++at) {
            const Limit& top = top_of(stack.columns.column(x, z), stack.palette);
            tops256_[at] = top.y256;
            if (x < 0 || z < 0) {
                continue;
            }
            const Shade shade = shades_[top.palette_id].shade;
            out.positions256.emplace_back(x * kColumn256, top.y256, z * kColumn256);
            out.normals.push_back(normal_of(top.y256, tops256_[at - 1], tops256_[at - row]));
            out.colors.emplace_back(shade.r, shade.g, shade.b);
            out.material_ids.push_back(shade.material);
        }
    }
    const auto side = static_cast<std::uint32_t>(stack.side);
    const std::uint32_t stride = side + 1;
    for (std::uint32_t z = 0; z < side; ++z) {
        for (std::uint32_t x = 0; x < side; ++x) {
            add_cell(out, z * stride + x, stride);
        }
    }
    if (with_skirts) {
        const std::int64_t depth256 = (std::int64_t{kSkirtCells} * kColumn256)
                                      << stack.position.lod;
        const std::uint32_t last = stride * stride - 1;
        const std::array<Side, 4> sides = {{
            {.first = side, .stride = -1, .outward = {0, 0, -1}},       // z = 0
            {.first = last - side, .stride = 1, .outward = {0, 0, 1}},  // z = N
            {.first = 0, .stride = stride, .outward = {-1, 0, 0}},      // x = 0
            {.first = last, .stride = -static_cast<std::int64_t>(stride), .outward = {1, 0, 0}},
        }};
        for (const Side& each : sides) {
            add_skirt(out, each, vertices, depth256);
        }
        if (is_landscape_ && stack.position.lod == 1) {
            out.parts.resize(out.vertex_count(), MeshPart::ground);
            for (const Side& each : sides) {
                add_cap(out, each, vertices, depth256, stack.columns, shades_);
            }
        }
    }
    water_.append_coarse(out, stack);
}

}  // namespace terrane
