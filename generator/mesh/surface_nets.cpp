// Source: S. F. Gibson, "Constrained elastic surface nets: generating smooth surfaces from binary
// segmented data", 1998; here on the lattice of columns and integer heights, whole columns of
// lattice points at a time as bits of a word.
//
//   columns -> intervals (solid_mask) -> bits of solid points
//           -> bits of crossed edges, of those that this tile owns
//           -> bits of cells that an owned edge touches; counting them gives every vertex its index
//           -> a vertex a cell, two triangles an edge
//
// An edge is owned by the tile and height range that hold its first point, so every quad of the
// world is emitted once. A cell's vertex depends on its own eight corners only, so every tile that
// needs it computes the same one.
#include "generator/mesh/surface_nets.h"

#include "generator/mesh/cell_vertex.h"
#include "generator/mesh/shade.h"
#include "generator/mesh/solid_mask.h"
#include "generator/mesh/surface_cells.h"
#include "generator/mesh/water_surface.h"
#include "protocol/base/check.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr std::int64_t kRangeVoxelsMax = std::int64_t{1} << 22;

/// A corner of a cell: which of its columns, and whether at the ceiling.
struct Corner {
    int lane = 0;
    bool is_high = false;
};

/// The solid end of the first crossed level edge, in a fixed order. Needs: there is one.
Corner solid_end_of_level_edge(const CellCorners& corners) {
    constexpr std::array<std::pair<int, int>, 4> kEdges = {{{0, 1}, {2, 3}, {0, 2}, {1, 3}}};
    for (const int level : {4, 0}) {
        for (const auto& [a, b] : kEdges) {
            if (corners.solid[level + a] != corners.solid[level + b]) {
                return {.lane = corners.solid[level + a] != 0 ? a : b, .is_high = level != 0};
            }
        }
    }
    TERRANE_ASSERT(false);
}

}  // namespace

struct SurfaceNetsMesher::Buffers {
    explicit Buffers(const WorldDefinition& definition)
        : has_parts(definition.has_landscape()), water(definition) {}

    bool has_parts;
    WaterSurface water;
    std::vector<std::int32_t> covered256;
    std::vector<LinearColor> material_colors;
    std::vector<PaletteShade> shades;
    SolidColumns columns;
    SolidMask solid;
    EdgeMasks edges;
    Cells cells;
    std::vector<PackedPosition> packed;
};

namespace {

/// Where the set bits of a row of words are.
class BitList {
  public:
    struct Place {
        std::uint16_t x;
        std::uint16_t bit;
    };

    /// Replaces the list by the bits of row[first] to row[last]. One place a word is written
    /// whether there is one or not, so that what most words hold, no bit or one, takes no jump.
    void read(const Word* row, std::size_t first, std::size_t last) {
        Place* next = places_.data();
        for (std::size_t x = first; x <= last; ++x) {
            Word bits = row[x];
            *next = place(x, bits);
            next += bits != 0 ? 1 : 0;
            for (bits &= bits - 1; bits != 0; bits &= bits - 1) {
                *next++ = place(x, bits);
            }
        }
        count_ = static_cast<std::size_t>(next - places_.data());
    }

    std::span<const Place> places() const { return std::span(places_).first(count_); }

  private:
    static Place place(std::size_t x, Word bits) {
        return {.x = static_cast<std::uint16_t>(x),
                .bit = static_cast<std::uint16_t>(std::countr_zero(bits))};
    }

    std::array<Place, (kChunkSideMax + 2) * 64 + 1> places_;
    std::size_t count_ = 0;
};

/// Makes the vertices of one tile; only reads what it refers to.
class VertexMaker {
  public:
    struct Vertex {
        CellVertex vertex;
        Shade shade;
    };

    /// `covered256` is find_covered's, or empty if nobody asks for parts.
    VertexMaker(const Stack& stack, const SolidColumns& columns,
                std::span<const PaletteShade> shades, std::span<const std::int32_t> covered256)
        : stack_(stack), columns_(columns), shades_(shades), covered256_(covered256) {}

    bool has_parts() const { return !covered256_.empty(); }

    /// What the cell's vertex is of: a cave's if all four columns have enough rock above the cell.
    MeshPart part_at(std::size_t index, std::int32_t floor256) const {
        const Lanes is_open =
            lanes_of(covered256_.data(), index) < floor256 + std::int32_t{kUnitsPerVoxel};
        return bits_of(is_open) == 0 ? MeshPart::cave : MeshPart::ground;
    }

    /// The vertex of the cell over column `index`, its next in x, and those next in z.
    Vertex at(std::size_t index, std::int32_t floor256) const {
        // A comparison's lanes are the platform's own integers of that size: long on wasm32.
        const Lanes is_under = lanes_of(columns_.simple_from256.data(), index) > floor256;
        const bool is_open = bits_of(is_under) == 0;
        const CellCorners corners =
            is_open ? corners_of_one_end(lanes_of(columns_.top256.data(), index) - floor256)
                    : corners_of_ends(columns_.plane_count, [&](std::size_t plane) {
                          return lanes_of(columns_.plane256(plane), index) - floor256;
                      });
        const unsigned crossed = bits_of(crossed_upright(corners));
        Vertex made{.vertex = cell_vertex(corners), .shade = {}};
        if (crossed == 0) {
            made.shade = of_cliff(corners, index, floor256);
        } else {
            const std::size_t first = column(index, std::countr_zero(crossed));
            made.shade =
                shades_[is_open ? columns_.top_id[first]
                                : columns_.end(first, end_from(first, floor256)).palette_id]
                    .shade;
        }
        return made;
    }

  private:
    std::size_t column(std::size_t index, int lane) const {
        const auto at = static_cast<std::size_t>(lane);
        return index + (at & 1U) + (at >> 1U) * columns_.width;
    }

    Lanes lanes_of(const std::int32_t* values, std::size_t index) const {
        const std::int32_t* const here = values + index;
        const std::int32_t* const next_z = here + columns_.width;
        return Lanes{here[0], here[1], next_z[0], next_z[1]};
    }

    /// The column's first end that is not below a height. Needs: there is one.
    std::size_t end_from(std::size_t column, std::int32_t y256) const {
        std::size_t i = 0;
        while (columns_.end(column, i).y256 < y256) {
            ++i;
        }
        return i;
    }

    /// What shows on a steep side. Layers lie over slopes like blankets, so within 4 voxels of an
    /// end of its column (76 degrees) a side shows what that end does: a point of the lattice may
    /// be deeper in the ground than a layer is thick. Only a higher wall shows what is inside.
    Shade of_cliff(const CellCorners& corners, std::size_t index, std::int32_t floor256) const {
        const Corner solid = solid_end_of_level_edge(corners);
        const std::size_t at = column(index, solid.lane);
        const std::int32_t y256 = floor256 + (solid.is_high ? kUnitsPerVoxel : 0);
        if (corners.distance[solid.lane + (solid.is_high ? 4 : 0)] < kDistanceMax256) {
            const std::size_t i = end_from(at, y256);
            const SolidEnd above = columns_.end(at, i);
            const bool is_under =
                i == 0 || above.y256 - y256 <= y256 - columns_.end(at, i - 1).y256;
            return shades_[is_under ? above.palette_id : columns_.end(at, i - 1).palette_id].shade;
        }
        const ColumnGrid& grid = stack_.columns;
        return shade_at(std::span(grid.limits)
                            .subspan(grid.offsets[at], grid.offsets[at + 1] - grid.offsets[at]),
                        y256, stack_.palette, shades_);
    }

    const Stack& stack_;
    const SolidColumns& columns_;
    std::span<const PaletteShade> shades_;
    std::span<const std::int32_t> covered256_;
};

/// Where the cells of a row or of a slice stand along one axis: column i stands at i - 1 + 1/2, and
/// cells that straddle a side give their vertex to that side.
struct CellPlaces {
    std::array<std::int32_t, kChunkSideMax + 1> base256;
    std::array<std::int32_t, kChunkSideMax + 1> keeps;  ///< mask: the offset in the cell counts

    explicit CellPlaces(std::size_t last) {
        for (std::size_t i = 0; i <= last; ++i) {
            const bool is_side = i == 0 || i == last;
            base256[i] =
                static_cast<std::int32_t>(i) * kUnitsPerVoxel - (is_side ? 0 : kUnitsPerVoxel / 2);
            keeps[i] = is_side ? 0 : -1;
        }
    }
};

/// One vertex for every used cell, at its number; its position in `packed` too.
void find_vertices(Mesh& out, std::vector<PackedPosition>& packed, const VertexMaker& maker,
                   const Cells& cells, const SolidMask& solid, const Window& window) {
    const std::size_t width = cells.used.width;
    const std::size_t last = width - 2;
    const CellPlaces places(last);
    BitList list;
    for (std::size_t z = 0; z <= last; ++z) {
        for (std::size_t word = 0; word < cells.used.words; ++word) {
            list.read(cells.used.row(z, word), 0, last);
            const std::uint32_t* const first_vertex =
                cells.first_vertex.data() + (cells.used.row(z, word) - cells.used.bits.data());
            std::size_t x_before = width;
            std::size_t at = 0;
            for (const auto [x, bit] : list.places()) {
                at = x == x_before ? at + 1 : first_vertex[x];
                x_before = x;
                const std::int32_t floor256 = (solid.word_y[word] + bit) * kUnitsPerVoxel;
                const auto [vertex, shade] = maker.at(z * width + x, floor256);
                const Lanes base = {places.base256[x], floor256 - window.origin256,
                                    places.base256[z], 0};
                const Lanes keeps = {places.keeps[x], -1, places.keeps[z], 0};
                const Lanes position = base + (vertex.offset256 & keeps);
                packed[at] = packed_position(position);
                out.positions256[at] = {position[0], position[1], position[2]};
                out.normals[at] = {vertex.normal[0], vertex.normal[1], vertex.normal[2]};
                out.colors[at] = {shade.r, shade.g, shade.b};
                out.material_ids[at] = shade.material;
                if (maker.has_parts()) {
                    out.parts[at] = maker.part_at(z * width + x, floor256);
                }
            }
        }
    }
}

/// Writes two triangles a quad, split along the shorter diagonal.
class QuadWriter {
  public:
    QuadWriter(std::uint32_t* indices, const PackedPosition* positions)
        : next_(indices), positions_(positions) {}

    /// a, b, c, d run counter-clockwise seen from the side that faces_forward says is outside.
    void write(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d,
               bool faces_forward) {
        const std::uint32_t second = faces_forward ? b : d;
        const std::uint32_t fourth = faces_forward ? d : b;
        const bool splits_at_a =
            is_first_shorter(positions_[a], positions_[c], positions_[b], positions_[d]);
        next_[0] = a;
        next_[1] = second;
        next_[2] = splits_at_a ? c : fourth;
        next_[3] = splits_at_a ? a : second;
        next_[4] = c;
        next_[5] = fourth;
        next_ += 6;
    }

    const std::uint32_t* end() const { return next_; }

  private:
    std::uint32_t* next_;
    const PackedPosition* positions_;
};

/// The cells of one word of a row, to find vertices by.
struct CellRow {
    const Word* used;
    const std::uint32_t* first_vertex;

    CellRow(const Cells& cells, std::size_t z, std::size_t word)
        : used(cells.used.row(z, word)),
          first_vertex(cells.first_vertex.data() + (used - cells.used.bits.data())) {}

    std::uint32_t vertex(std::size_t x, unsigned bit) const {
        const Word below = (Word{1} << bit) - 1;
        return first_vertex[x] + static_cast<std::uint32_t>(std::popcount(used[x] & below));
    }
};

void find_triangles(Mesh& out, const std::vector<PackedPosition>& packed, const SolidMask& solid,
                    const EdgeMasks& edges, const Cells& cells) {
    QuadWriter quads(out.indices.data(), packed.data());
    BitList list;
    const std::size_t side = solid.width - 2;
    for (std::size_t z = 1; z <= side; ++z) {
        for (std::size_t word = 0; word < solid.words(); ++word) {
            const CellRow before(cells, z - 1, word);
            const CellRow here(cells, z, word);
            const auto starts_solid = [row = solid.row(z, word)](BitList::Place at) {
                return ((row[at.x] >> at.bit) & 1U) != 0;
            };
            list.read(edges.upright.row(z, word), 1, side);
            for (const BitList::Place at : list.places()) {
                const std::size_t x_before = at.x - std::size_t{1};
                quads.write(before.vertex(x_before, at.bit), here.vertex(x_before, at.bit),
                            here.vertex(at.x, at.bit), before.vertex(at.x, at.bit),
                            starts_solid(at));
            }
            // The cell under a level edge has the vertex before that of the cell over it.
            list.read(edges.along_x.row(z, word), 1, side);
            for (const BitList::Place at : list.places()) {
                const std::uint32_t a = before.vertex(at.x, at.bit);
                const std::uint32_t b = here.vertex(at.x, at.bit);
                quads.write(a - 1, a, b, b - 1, starts_solid(at));
            }
            list.read(edges.along_z.row(z, word), 1, side);
            for (const BitList::Place at : list.places()) {
                const std::uint32_t a = here.vertex(at.x - std::size_t{1}, at.bit);
                const std::uint32_t b = here.vertex(at.x, at.bit);
                quads.write(a - 1, b - 1, b, a, starts_solid(at));
            }
        }
    }
    TERRANE_DEBUG_ASSERT(quads.end() == out.indices.data() + out.indices.size());
}

}  // namespace

SurfaceNetsMesher::SurfaceNetsMesher(const WorldDefinition& definition)
    : buffers_(std::make_unique<Buffers>(definition)) {
    buffers_->material_colors = linear_colors_of(definition);
}

SurfaceNetsMesher::~SurfaceNetsMesher() = default;
SurfaceNetsMesher::SurfaceNetsMesher(SurfaceNetsMesher&&) noexcept = default;
SurfaceNetsMesher& SurfaceNetsMesher::operator=(SurfaceNetsMesher&&) noexcept = default;

void SurfaceNetsMesher::mesh(Mesh& out, const Stack& stack, std::int32_t y, std::int32_t height) {
    const std::int64_t first = std::int64_t{y} * height;
    mesh(out, stack, HeightRange{.first = first, .last = first + height});
}

void SurfaceNetsMesher::mesh(Mesh& out, const Stack& stack, HeightRange heights) {
    TERRANE_ASSERT(heights.first <= heights.last &&
                   heights.last - heights.first <= kRangeVoxelsMax);
    Buffers& b = *buffers_;
    find_solid_columns(b.columns, stack);
    const Window window = window_of(b.columns, heights);
    if (window.is_empty()) {
        out.clear();
        b.water.append(out, stack, heights);
        return;
    }
    find_words(b.solid.word_y, b.columns, window);
    fill_solid_mask(b.solid, b.columns);
    find_edges(b.edges, b.solid, window);
    find_cells(b.cells, b.edges, b.solid);
    find_palette_shades(b.shades, stack.palette, b.material_colors);
    if (b.has_parts) {
        find_covered(b.covered256, b.columns, kCaveRoofVoxels * kUnitsPerVoxel);
    }

    const std::size_t vertices = b.cells.vertex_count;
    out.positions256.resize(vertices);
    out.normals.resize(vertices);
    out.colors.resize(vertices);
    out.material_ids.resize(vertices);
    out.parts.resize(b.has_parts ? vertices : 0);
    out.indices.resize(6 * count_edges(b.edges));
    b.packed.resize(vertices);
    find_vertices(out, b.packed, VertexMaker(stack, b.columns, b.shades, b.covered256), b.cells,
                  b.solid, window);
    find_triangles(out, b.packed, b.solid, b.edges, b.cells);
    b.water.append(out, stack, heights);
}

}  // namespace terrane
