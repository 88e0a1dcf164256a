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
    std::size_t lane = 0;
    bool is_high = false;
};

/// The solid end of the first crossed level edge, in a fixed order. Needs: there is one.
Corner solid_end_of_level_edge(const CellCorners& corners) {
    constexpr std::array<std::pair<std::size_t, std::size_t>, 4> kEdges = {
        {{0, 1}, {2, 3}, {0, 2}, {1, 3}}};
    for (const bool is_high : {true, false}) {
        const Lanes solid = is_high ? corners.solid_high : corners.solid_low;
        for (const auto& [a, b] : kEdges) {
            if (solid[a] != solid[b]) {
                return {.lane = solid[a] != 0 ? a : b, .is_high = is_high};
            }
        }
    }
    TERRANE_ASSERT(false);
}

}  // namespace

struct SurfaceNetsMesher::Buffers {
    std::vector<LinearColor> material_colors;
    std::vector<PaletteShade> shades;
    SolidColumns columns;
    SolidMask solid;
    EdgeMasks edges;
    Cells cells;
};

namespace {

struct SurfacePoint {
    CellVertex vertex;
    Shade shade;
};

/// Makes the vertices of one tile; only reads what it refers to.
class VertexMaker {
  public:
    VertexMaker(const Stack& stack, const SolidColumns& columns,
                std::span<const PaletteShade> shades)
        : stack_(stack), columns_(columns), shades_(shades) {}

    /// Turns to the cells over columns `index` (the least), its neighbours in x and z.
    void enter(std::size_t index) {
        const std::size_t width = columns_.width;
        at_ = {index, index + 1, index + width, index + width + 1};
        top256_ = lanes_of(columns_.top256);
        const Lanes from = lanes_of(columns_.simple_from256);
        simple_from256_ = std::max(std::max(from[0], from[1]), std::max(from[2], from[3]));
    }

    SurfacePoint at(std::int32_t floor256) const {
        return floor256 >= simple_from256_ ? in_the_open(floor256) : near_caves(floor256);
    }

  private:
    Lanes lanes_of(const std::vector<std::int32_t>& values) const {
        return Lanes{values[at_[0]], values[at_[1]], values[at_[2]], values[at_[3]]};
    }

    SurfacePoint in_the_open(std::int32_t floor256) const {
        const CellCorners corners = corners_below_tops(top256_ - floor256);
        const unsigned crossed = bits_of(corners.solid_low & ~corners.solid_high);
        if (crossed == 0) {
            return {.vertex = cell_vertex(corners), .shade = of_cliff(corners, floor256)};
        }
        const auto lane = static_cast<std::size_t>(std::countr_zero(crossed));
        return {
            .vertex = crossed == 0xF ? flat_cell_vertex(corners.crossing) : cell_vertex(corners),
            .shade = shades_[columns_.top_id[at_[lane]]].shade};
    }

    SurfacePoint near_caves(std::int32_t floor256) const {
        const CaveCell cell = cave_cell(columns_, at_, floor256);
        const unsigned crossed = bits_of(cell.corners.solid_low ^ cell.corners.solid_high);
        const auto lane = static_cast<std::size_t>(std::countr_zero(crossed));
        return {.vertex = cell_vertex(cell.corners),
                .shade = crossed == 0 ? of_cliff(cell.corners, floor256)
                                      : shades_[cell.crossing_ids[lane]].shade};
    }

    Shade of_cliff(const CellCorners& corners, std::int32_t floor256) const {
        const Corner end = solid_end_of_level_edge(corners);
        const ColumnGrid& grid = stack_.columns;
        const std::uint32_t first = grid.offsets[at_[end.lane]];
        const std::uint32_t last = grid.offsets[at_[end.lane] + 1];
        return shade_at(std::span(grid.limits).subspan(first, last - first),
                        floor256 + (end.is_high ? kUnitsPerVoxel : 0), stack_.palette, shades_);
    }

    const Stack& stack_;
    const SolidColumns& columns_;
    std::span<const PaletteShade> shades_;
    std::array<std::size_t, 4> at_{};
    Lanes top256_{};
    std::int32_t simple_from256_ = 0;
};

/// One vertex for every used cell, in the order of their numbers.
void find_vertices(Mesh& out, VertexMaker maker, const Cells& cells, const Window& window) {
    const std::size_t width = cells.used.width;
    const std::size_t last = width - 2;  // the last cell of a row: it straddles the far side
    const auto side256 = static_cast<std::int32_t>(last) * kUnitsPerVoxel;
    const auto place = [last, side256](std::size_t cell, std::int32_t offset256) {
        // Column i stands at i - 1 + 1/2. Cells that straddle a side give their vertex to that
        // side.
        const auto inside = static_cast<std::int32_t>(cell) * kUnitsPerVoxel - 128 + offset256;
        return cell == 0 ? 0 : cell == last ? side256 : inside;
    };
    std::size_t next = 0;
    for (std::size_t z = 0; z <= last; ++z) {
        for (std::size_t x = 0; x <= last; ++x) {
            maker.enter(z * width + x);
            for (std::size_t word = 0; word < cells.used.words; ++word) {
                const std::int32_t word_y = static_cast<std::int32_t>(word) * 64;
                for (Word bits = cells.used.row(z, word)[x]; bits != 0; bits &= bits - 1) {
                    const std::int32_t bit = word_y + std::countr_zero(bits);
                    const auto [vertex, shade] = maker.at((window.bit0_y + bit) * kUnitsPerVoxel);
                    out.positions256[next] = {
                        place(x, vertex.offset256.x),
                        bit * kUnitsPerVoxel - window.origin256 + vertex.offset256.y,
                        place(z, vertex.offset256.z)};
                    out.normals[next] = vertex.normal;
                    out.colors[next] = {shade.r, shade.g, shade.b};
                    out.material_ids[next] = shade.material;
                    ++next;
                }
            }
        }
    }
    TERRANE_DEBUG_ASSERT(next == cells.vertex_count);
}

/// Writes two triangles a quad, split along the shorter diagonal.
class QuadWriter {
  public:
    QuadWriter(Mesh& out) : positions_(out.positions256.data()), next_(out.indices.data()) {}

    /// a, b, c, d run counter-clockwise seen from the side that faces_forward says is outside.
    void write(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d,
               bool faces_forward) {
        const std::uint32_t second = faces_forward ? b : d;
        const std::uint32_t fourth = faces_forward ? d : b;
        const bool splits_at_a = square(a, c) <= square(b, d);
        const std::array<std::uint32_t, 6> triangles = {
            a, second, splits_at_a ? c : fourth, splits_at_a ? a : second, c, fourth};
        next_ = std::copy(triangles.begin(), triangles.end(), next_);
    }

    const std::uint32_t* end() const { return next_; }

  private:
    std::int32_t square(std::uint32_t a, std::uint32_t b) const {
        const glm::i32vec3 d = positions_[a] - positions_[b];  // at most two voxels long each way
        return d.x * d.x + d.y * d.y + d.z * d.z;
    }

    const glm::i32vec3* positions_;
    std::uint32_t* next_;
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

void find_triangles(Mesh& out, const SolidMask& solid, const EdgeMasks& edges, const Cells& cells) {
    QuadWriter quads(out);
    const std::size_t side = solid.width - 2;
    for (std::size_t z = 1; z <= side; ++z) {
        for (std::size_t word = 0; word < solid.words; ++word) {
            const CellRow before(cells, z - 1, word);
            const CellRow here(cells, z, word);
            const Word* const is_solid = solid.row(z, word);
            const Word* const upright = edges.upright.row(z, word);
            const Word* const along_x = edges.along_x.row(z, word);
            const Word* const along_z = edges.along_z.row(z, word);
            for (std::size_t x = 1; x <= side; ++x) {
                const auto faces_on = [inside = is_solid[x]](unsigned bit) {
                    return ((inside >> bit) & 1U) != 0;
                };
                for (Word bits = upright[x]; bits != 0; bits &= bits - 1) {
                    const auto bit = static_cast<unsigned>(std::countr_zero(bits));
                    quads.write(before.vertex(x - 1, bit), here.vertex(x - 1, bit),
                                here.vertex(x, bit), before.vertex(x, bit), faces_on(bit));
                }
                // The cells under a level edge hold the vertices before those over it.
                for (Word bits = along_x[x]; bits != 0; bits &= bits - 1) {
                    const auto bit = static_cast<unsigned>(std::countr_zero(bits));
                    const std::uint32_t a = before.vertex(x, bit);
                    const std::uint32_t b = here.vertex(x, bit);
                    quads.write(a - 1, a, b, b - 1, faces_on(bit));
                }
                for (Word bits = along_z[x]; bits != 0; bits &= bits - 1) {
                    const auto bit = static_cast<unsigned>(std::countr_zero(bits));
                    const std::uint32_t a = here.vertex(x - 1, bit);
                    const std::uint32_t b = here.vertex(x, bit);
                    quads.write(a - 1, b - 1, b, a, faces_on(bit));
                }
            }
        }
    }
    TERRANE_DEBUG_ASSERT(quads.end() == out.indices.data() + out.indices.size());
}

}  // namespace

SurfaceNetsMesher::SurfaceNetsMesher(const WorldDefinition& definition)
    : buffers_(std::make_unique<Buffers>()) {
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
    if (window.points == 0) {
        out.clear();
        return;
    }
    fill_solid_mask(b.solid, b.columns, window.bit0_y, window.words());
    find_edges(b.edges, b.solid, window);
    find_cells(b.cells, b.edges);
    find_palette_shades(b.shades, stack.palette, b.material_colors);

    const std::size_t vertices = b.cells.vertex_count;
    out.positions256.resize(vertices);
    out.normals.resize(vertices);
    out.colors.resize(vertices);
    out.material_ids.resize(vertices);
    out.indices.resize(6 * count_edges(b.edges));
    find_vertices(out, VertexMaker(stack, b.columns, b.shades), b.cells, window);
    find_triangles(out, b.solid, b.edges, b.cells);
}

}  // namespace terrane
