// Works in bands of up to 62 voxel layers, so that a column of a band with one layer below and one
// above is one word:
//
//   columns -> intervals (solid_mask) -> bits of solid voxels
//           -> bits of faces: m & ~(m shifted by one), m & ~(m of the column next door)
//           -> materials of voxels that have a face, read from their limits
//           -> for each plane of a direction, lines of face bits, merged into rectangles
//
// Merging is greedy: the first face of a plane grows along its line while the material is the same,
// then whole lines while they are full. Sources: the slices of M. Lysenko, "Meshing in a Minecraft
// game", 2012, on bits instead of cells. Rectangles do not reach over a band's end.
#include "generator/mesh/blocky.h"

#include "generator/mesh/mesh.h"
#include "generator/mesh/shade.h"
#include "generator/mesh/solid_mask.h"
#include "generator/mesh/water_surface.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/check.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace terrane {
namespace {

using Word = std::uint64_t;

constexpr std::int64_t kRangeVoxelsMax = std::int64_t{1} << 22;
constexpr std::int32_t kBandVoxels = 62;  ///< owned bits of a word: 1..62
constexpr std::size_t kBits = 64;

/// A direction faces look in. Lines of a plane run along axis `u` and lie along axis `v`.
struct Direction {
    int axis;
    int u;
    int v;
    bool is_positive;
};

constexpr int kX = 0;
constexpr int kY = 1;
constexpr int kZ = 2;
constexpr std::array<Direction, 6> kDirections = {
    {{.axis = kX, .u = kY, .v = kZ, .is_positive = false},
     {.axis = kX, .u = kY, .v = kZ, .is_positive = true},
     {.axis = kY, .u = kX, .v = kZ, .is_positive = false},
     {.axis = kY, .u = kX, .v = kZ, .is_positive = true},
     {.axis = kZ, .u = kY, .v = kX, .is_positive = false},
     {.axis = kZ, .u = kY, .v = kX, .is_positive = true}}};

/// Bits 0..count-1, for any count.
Word lowest_bits(std::int32_t count) {
    return count <= 0 ? 0 : ~Word{0} >> (64 - std::min(count, 64));
}

/// How many voxels from 0 up have their centre under a height: a voxel whose centre is at a
/// frontier belongs to what is above it, as voxel_at has it.
std::int32_t voxels_under(std::int32_t y256) {
    return (y256 + kUnitsPerVoxel / 2 - 1) >> 8;
}

/// The ground's tops at y = 0 belong to the range that begins there.
std::int64_t owned_from(std::int64_t y) {
    return y == 0 ? -1 : y;
}

/// A rectangle of faces in a plane: [u, u_end) x [v, v_end).
struct Rectangle {
    std::size_t u;
    std::size_t u_end;
    std::size_t v;
    std::size_t v_end;
    std::uint8_t material;
};

/// The materials of a plane's voxels.
struct PlaneMaterials {
    const std::uint8_t* first;
    std::size_t u_stride;
    std::size_t v_stride;

    std::uint8_t at(std::size_t u, std::size_t v) const {
        return first[u * u_stride + v * v_stride];
    }

    /// Whether [u, u_end) of line v is all of one material.
    bool is_all(std::size_t u, std::size_t u_end, std::size_t v, std::uint8_t material) const {
        while (u < u_end && at(u, v) == material) {
            ++u;
        }
        return u == u_end;
    }
};

/// Calls emit(rectangle) until every bit of the lines is covered, and clears them.
template <typename Emit>
void merge_plane(std::span<Word> lines, const PlaneMaterials& materials, Emit emit) {
    for (std::size_t v = 0; v < lines.size(); ++v) {
        while (lines[v] != 0) {
            const auto u = static_cast<std::size_t>(std::countr_zero(lines[v]));
            const std::size_t run_end =
                u + static_cast<std::size_t>(std::countr_one(lines[v] >> u));
            const std::uint8_t material = materials.at(u, v);
            std::size_t u_end = u + 1;
            while (u_end < run_end && materials.at(u_end, v) == material) {
                ++u_end;
            }
            const Word run = (~Word{0} >> (kBits - (u_end - u))) << u;
            lines[v] &= ~run;
            std::size_t v_end = v + 1;
            while (v_end < lines.size() && (lines[v_end] & run) == run &&
                   materials.is_all(u, u_end, v_end, material)) {
                lines[v_end++] &= ~run;
            }
            emit(Rectangle{.u = u, .u_end = u_end, .v = v, .v_end = v_end, .material = material});
        }
    }
}

/// Appends two triangles of four new vertices.
void add_rectangle(Mesh& out, const Direction& direction, std::int32_t plane256,
                   const Rectangle& at, std::array<std::int32_t, 3> origin256, Shade shade) {
    const auto place = [](std::size_t i) { return static_cast<std::int32_t>(i) * kUnitsPerVoxel; };
    glm::i32vec3 corner(origin256[0], origin256[1], origin256[2]);
    corner[direction.axis] += plane256;
    corner[direction.u] += place(at.u);
    corner[direction.v] += place(at.v);
    const std::int32_t along_u = place(at.u_end - at.u);
    const std::int32_t along_v = place(at.v_end - at.v);
    // u, v and the axis are a right-handed frame for x only.
    const bool u_is_first = (direction.axis == kX) == direction.is_positive;
    const auto first = static_cast<std::uint32_t>(out.vertex_count());
    const std::size_t count = first + 4;
    out.positions256.resize(count, corner);
    out.positions256[first + (u_is_first ? 1 : 3)][direction.u] += along_u;
    out.positions256[first + 2][direction.u] += along_u;
    out.positions256[first + 2][direction.v] += along_v;
    out.positions256[first + (u_is_first ? 3 : 1)][direction.v] += along_v;
    glm::vec3 normal(0.0F);
    normal[direction.axis] = direction.is_positive ? 1.0F : -1.0F;
    out.normals.resize(count, normal);
    out.colors.resize(count, glm::u8vec3(shade.r, shade.g, shade.b));
    out.material_ids.resize(count, shade.material);
    out.indices.insert(out.indices.end(),
                       {first, first + 1, first + 2, first, first + 2, first + 3});
}

}  // namespace

struct BlockyMesher::Buffers {
    using Columns = std::array<Word, static_cast<std::size_t>(kChunkSideMax) * kChunkSideMax>;

    explicit Buffers(const WorldDefinition& definition)
        : material_shades(material_shades_of(definition)), water(definition) {}

    std::vector<Shade> material_shades;
    WaterSurface water;
    std::vector<std::uint8_t> palette_materials;
    SolidColumns columns;
    std::size_t side = 0;
    // Of one band. Bit b of a word is layer first - 1 + b.
    std::int32_t first = 0;
    std::vector<Word> solid;  ///< (N + 2) x (N + 2), as the columns
    std::array<Columns, 6> faces{};
    /// Tops or bottoms by layer: a bit is x, an index is z; zero between uses.
    std::array<std::array<Word, kChunkSideMax>, kBits> layers{};
    std::vector<std::uint8_t> materials;  ///< [z][x][bit], where there is a face

    std::vector<std::uint8_t> has_faces;  ///< by band: 0 where all is solid

    /// Appends the faces of the ground to `out`, which is empty.
    void mesh_solid(Mesh& out, const Stack& stack, HeightRange heights);
    void start(const Stack& stack);
    void find_bands(std::int32_t first_layer, std::int32_t layer_count);
    void fill_solid();
    Word find_faces(std::int32_t layer_count);
    void find_materials(const Stack& stack);
    void mesh_sides(Mesh& out, std::size_t direction, std::int32_t y256) const;
    void mesh_layers(Mesh& out, std::size_t direction, std::int32_t y256);
    void emit(Mesh& out, const Direction& direction, std::size_t plane, const Rectangle& at,
              std::int32_t y256) const;
};

void BlockyMesher::Buffers::start(const Stack& stack) {
    side = static_cast<std::size_t>(stack.side);
    palette_materials.clear();
    for (const PaletteEntry& entry : stack.palette) {
        palette_materials.push_back(main_material(entry.composition));
    }
    solid.resize(columns.column_count());
    materials.resize(side * side * kBits);
}

/// Finds the bands that a hollow span of a column reaches or touches; the others are solid
/// throughout and have no face.
void BlockyMesher::Buffers::find_bands(std::int32_t first_layer, std::int32_t layer_count) {
    has_faces.assign(static_cast<std::size_t>((layer_count + kBandVoxels - 1) / kBandVoxels), 0);
    const auto mark = [&](std::int32_t bottom256, std::int32_t top256) {
        const std::int32_t from = std::max(voxels_under(bottom256) - 1 - first_layer, 0);
        const std::int32_t to = std::min(voxels_under(top256) - first_layer, layer_count - 1);
        for (std::int32_t band = from / kBandVoxels; band <= to / kBandVoxels && from <= to;
             ++band) {
            has_faces[static_cast<std::size_t>(band)] = 1;
        }
    };
    mark(columns.lowest_top256, columns.highest256);
    const SolidEnd* end = columns.many_ends.data();
    for (std::size_t i = 1; i < columns.many.size(); i += 2) {
        const SolidEnd* const top = end + columns.many[i] - 1;
        for (; end < top; end += 2) {
            mark(end->y256, end[1].y256);
        }
        ++end;
    }
}

void BlockyMesher::Buffers::fill_solid() {
    const std::int32_t base = first - 1;
    for (std::size_t i = 0; i < solid.size(); ++i) {
        solid[i] = lowest_bits(voxels_under(columns.planes256[i]) - base);
    }
    for (std::size_t plane = 1; plane < columns.plane_count; ++plane) {
        const std::int32_t* const ends256 = columns.plane256(plane);
        for (std::size_t i = 0; i < solid.size(); ++i) {
            solid[i] ^= lowest_bits(voxels_under(ends256[i]) - base);
        }
    }
}

/// Fills `faces`; returns all of their bits together.
Word BlockyMesher::Buffers::find_faces(std::int32_t layer_count) {
    const Word owned = lowest_bits(layer_count) << 1U;
    const std::size_t width = side + 2;
    Word all = 0;
    for (std::size_t z = 0; z < side; ++z) {
        const Word* const row = solid.data() + (z + 1) * width + 1;
        for (std::size_t x = 0; x < side; ++x) {
            const Word* const here = row + x;
            const Word own = *here & owned;
            const std::size_t at = z * side + x;
            faces[0][at] = own & ~here[-1];
            faces[1][at] = own & ~here[1];
            faces[2][at] = own & ~(*here << 1U);
            faces[3][at] = own & ~(*here >> 1U);
            faces[4][at] = own & ~*(here - width);
            faces[5][at] = own & ~here[width];
            all |= faces[0][at] | faces[1][at] | faces[2][at] | faces[3][at] | faces[4][at] |
                   faces[5][at];
        }
    }
    return all;
}

/// The main materials of voxels that have a face: of the mix of the last limit at or below the
/// centre and the one after it, as voxel_at has it.
void BlockyMesher::Buffers::find_materials(const Stack& stack) {
    for (std::size_t at = 0; at < side * side; ++at) {
        Word bits =
            faces[0][at] | faces[1][at] | faces[2][at] | faces[3][at] | faces[4][at] | faces[5][at];
        if (bits == 0) {
            continue;
        }
        const std::span<const Limit> limits = stack.columns.column(
            static_cast<std::int32_t>(at % side), static_cast<std::int32_t>(at / side));
        const auto center256_of = [this](int bit) {
            return (first - 1 + bit) * kUnitsPerVoxel + kUnitsPerVoxel / 2;
        };
        auto high = std::ranges::upper_bound(limits, center256_of(std::countr_zero(bits)), {},
                                             &Limit::y256);
        for (; bits != 0; bits &= bits - 1) {
            const int bit = std::countr_zero(bits);
            const std::int32_t center256 = center256_of(bit);
            while (high != limits.end() && high->y256 <= center256) {
                ++high;
            }
            const Limit& low = high == limits.begin() ? *high : high[-1];
            std::uint8_t material = palette_materials[low.palette_id];
            if (high != limits.end() && palette_materials[high->palette_id] != material &&
                center256 > low.y256) {
                const double t = static_cast<double>(center256 - low.y256) /
                                 static_cast<double>(high->y256 - low.y256);
                material = main_material(stack.palette[low.palette_id].composition,
                                         stack.palette[high->palette_id].composition, t);
            }
            materials[at * kBits + static_cast<std::size_t>(bit)] = material;
        }
    }
}

/// `y256`: where the layer of bit 0 begins, in the mesh.
void BlockyMesher::Buffers::emit(Mesh& out, const Direction& direction, std::size_t plane,
                                 const Rectangle& at, std::int32_t y256) const {
    const std::size_t frontier = plane + (direction.is_positive ? 1 : 0);
    add_rectangle(out, direction, static_cast<std::int32_t>(frontier) * kUnitsPerVoxel, at,
                  {0, y256, 0}, material_shades[at.material]);
}

void BlockyMesher::Buffers::mesh_sides(Mesh& out, std::size_t direction, std::int32_t y256) const {
    const bool looks_along_x = kDirections[direction].axis == kX;
    const std::size_t plane_stride = looks_along_x ? 1 : side;
    const std::size_t line_stride = looks_along_x ? side : 1;
    std::array<Word, kChunkSideMax> lines;
    for (std::size_t plane = 0; plane < side; ++plane) {
        Word all = 0;
        for (std::size_t v = 0; v < side; ++v) {
            lines[v] = faces[direction][plane * plane_stride + v * line_stride];
            all |= lines[v];
        }
        if (all == 0) {
            continue;
        }
        merge_plane(
            std::span(lines).first(side),
            {.first = materials.data() + plane * plane_stride * kBits,
             .u_stride = 1,
             .v_stride = line_stride * kBits},
            [&](const Rectangle& at) { emit(out, kDirections[direction], plane, at, y256); });
    }
}

void BlockyMesher::Buffers::mesh_layers(Mesh& out, std::size_t direction, std::int32_t y256) {
    Word all = 0;
    for (std::size_t z = 0; z < side; ++z) {
        for (std::size_t x = 0; x < side; ++x) {
            const Word column = faces[direction][z * side + x];
            all |= column;
            for (Word bits = column; bits != 0; bits &= bits - 1) {
                layers[static_cast<std::size_t>(std::countr_zero(bits))][z] |= Word{1} << x;
            }
        }
    }
    for (; all != 0; all &= all - 1) {
        const auto layer = static_cast<std::size_t>(std::countr_zero(all));
        merge_plane(
            std::span(layers[layer]).first(side),
            {.first = materials.data() + layer, .u_stride = kBits, .v_stride = side * kBits},
            [&](const Rectangle& at) { emit(out, kDirections[direction], layer, at, y256); });
    }
}

BlockyMesher::BlockyMesher(const WorldDefinition& definition)
    : buffers_(std::make_unique<Buffers>(definition)) {}

BlockyMesher::~BlockyMesher() = default;
BlockyMesher::BlockyMesher(BlockyMesher&&) noexcept = default;
BlockyMesher& BlockyMesher::operator=(BlockyMesher&&) noexcept = default;

void BlockyMesher::mesh(Mesh& out, const Stack& stack, std::int32_t y, std::int32_t height) {
    const std::int64_t first = std::int64_t{y} * height;
    mesh(out, stack, HeightRange{.first = first, .last = first + height});
}

void BlockyMesher::mesh(Mesh& out, const Stack& stack, HeightRange heights) {
    TERRANE_ASSERT(heights.first <= heights.last &&
                   heights.last - heights.first <= kRangeVoxelsMax);
    TERRANE_ASSERT(stack.side <= kChunkSideMax);
    out.clear();
    buffers_->mesh_solid(out, stack, heights);
    buffers_->water.append(out, stack, heights);
}

void BlockyMesher::Buffers::mesh_solid(Mesh& out, const Stack& stack, HeightRange heights) {
    find_solid_columns(columns, stack);
    // From the highest layer that is solid in all columns to the highest that is in any.
    const std::int64_t begin =
        std::max<std::int64_t>(owned_from(heights.first), voxels_under(columns.lowest256) - 1);
    const std::int64_t end =
        std::min<std::int64_t>(owned_from(heights.last), voxels_under(columns.highest256));
    if (begin >= end) {
        return;
    }
    start(stack);
    const auto layer_count = static_cast<std::int32_t>(end - begin);
    find_bands(static_cast<std::int32_t>(begin), layer_count);
    for (std::int32_t layer = 0; layer < layer_count; layer += kBandVoxels) {
        if (has_faces[static_cast<std::size_t>(layer / kBandVoxels)] == 0) {
            continue;
        }
        first = static_cast<std::int32_t>(begin) + layer;
        fill_solid();
        if (find_faces(std::min(layer_count - layer, kBandVoxels)) == 0) {
            continue;
        }
        find_materials(stack);
        const auto y256 = static_cast<std::int32_t>((first - 1 - heights.first) * kUnitsPerVoxel);
        for (std::size_t direction = 0; direction < kDirections.size(); ++direction) {
            if (kDirections[direction].axis == kY) {
                mesh_layers(out, direction, y256);
            } else {
                mesh_sides(out, direction, y256);
            }
        }
    }
}

}  // namespace terrane
