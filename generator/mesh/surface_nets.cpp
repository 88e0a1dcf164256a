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

#include "generator/mesh/kernels/mesh_kernels.h"
#include "generator/mesh/lanes.h"
#include "generator/mesh/mesh.h"
#include "generator/mesh/shade.h"
#include "generator/mesh/solid_mask.h"
#include "generator/mesh/steep_normals.h"
#include "generator/mesh/surface_cells.h"
#include "generator/mesh/water_surface.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/check.h"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace terrane {
namespace {

static_assert(kCellUnits == kUnitsPerVoxel && kCellDistanceMax256 == kDistanceMax256);
constexpr std::int64_t kRangeVoxelsMax = std::int64_t{1} << 22;

/// The solid end of the first crossed level edge, in a fixed order, by the cell's solid corners.
/// Needs: there is one.
int solid_end_of_level_edge(unsigned solid) {
    constexpr std::array<std::pair<int, int>, 4> kEdges = {{{0, 1}, {2, 3}, {0, 2}, {1, 3}}};
    for (const int level : {4, 0}) {
        for (const auto& [a, b] : kEdges) {
            const unsigned a_solid = solid >> (level + a) & 1U;
            if (a_solid != (solid >> (level + b) & 1U)) {
                return level + (a_solid != 0 ? a : b);
            }
        }
    }
    TERRANE_ASSERT(false);
}

/// Cells that wait to be made together.
struct CellQueue {
    struct Cell {
        std::uint32_t at;  ///< its vertex's number
        std::uint32_t x;
        std::uint32_t z;
        std::int32_t floor256;
    };

    std::vector<std::int32_t> ends256;  ///< as MeshKernels says
    std::array<Cell, kCellBatch> cells;
    std::size_t count = 0;

    /// Needs: no cell waits.
    void set_planes(std::size_t planes) { ends256.resize(planes * 4 * kCellBatch); }

    std::int32_t planes() const {
        return static_cast<std::int32_t>(ends256.size() / (4 * std::size_t{kCellBatch}));
    }
};

}  // namespace

struct SurfaceNetsMesher::Buffers {
    Buffers(const WorldDefinition& definition, const MeshKernels& mesh_kernels)
        : kernels(mesh_kernels), water(definition), has_parts(definition.has_landscape()) {}

    CellResults results{};  // first, being aligned the widest
    const MeshKernels& kernels;
    CellQueue simple_cells;
    CellQueue other_cells;
    WaterSurface water;
    std::vector<std::int32_t> covered256;
    std::vector<LinearColor> material_colors;
    std::vector<PaletteShade> shades;
    SolidColumns columns;
    SolidMask solid;
    EdgeMasks edges;
    Cells cells;
    std::vector<PackedPosition> packed;
    bool has_parts;
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

/// Makes the vertices of one tile, many at a time. Most cells see one end of each of their columns;
/// the others all of them.
class VertexMaker {
  public:
    struct Input {
        const Stack& stack;
        const SolidColumns& columns;
        std::span<const PaletteShade> shades;
        std::span<const std::int32_t> covered256;  ///< find_covered's, or empty: no parts
        std::int32_t origin256;
        const MeshKernels& kernels;
        CellQueue& simple;
        CellQueue& other;
        CellResults& results;
    };

    VertexMaker(Mesh& out, std::vector<PackedPosition>& packed, const Input& in)
        : in_(in), columns_(in.columns), places_(in.columns.width - 2), out_(out), packed_(packed) {
        in_.simple.set_planes(1);
        in_.other.set_planes(columns_.plane_count);
    }

    /// Vertex `at` is of the cell over column (x, z), its next in x, and those next in z.
    void add(std::uint32_t at, std::uint32_t x, std::uint32_t z, std::int32_t floor256) {
        const std::size_t index = z * columns_.width + x;
        // A comparison's lanes are the platform's own integers of that size: long on wasm32.
        const Lanes is_under = lanes_of(columns_.simple_from256.data(), index) > floor256;
        const bool is_simple = bits_of(is_under) == 0;
        CellQueue& queue = is_simple ? in_.simple : in_.other;
        queue.cells[queue.count] = {.at = at, .x = x, .z = z, .floor256 = floor256};
        std::int32_t* to = queue.ends256.data() + queue.count;
        const std::int32_t* from = is_simple ? columns_.top256.data() : columns_.plane256(0);
        for (std::int32_t plane = queue.planes(); plane > 0; --plane) {
            const Lanes ends = lanes_of(from, index) - floor256;
            for (int lane = 0; lane < 4; ++lane, to += kCellBatch) {
                *to = ends[lane];
            }
            from += columns_.column_count();
        }
        if (++queue.count == kCellBatch) {
            make(queue);
        }
    }

    /// To be called once after the last add().
    void finish() {
        make(in_.simple);
        make(in_.other);
    }

  private:
    using Cell = CellQueue::Cell;

    std::size_t index_of(const Cell& cell) const { return cell.z * columns_.width + cell.x; }

    std::size_t column(std::size_t index, int lane) const {
        const auto at = static_cast<std::size_t>(lane);
        return index + (at & 1U) + (at >> 1U) * columns_.width;
    }

    Lanes lanes_of(const std::int32_t* values, std::size_t index) const {
        const std::int32_t* const here = values + index;
        const std::int32_t* const next_z = here + columns_.width;
        return Lanes{here[0], here[1], next_z[0], next_z[1]};
    }

    void make(CellQueue& queue) {
        const auto blocks = static_cast<std::int32_t>(queue.count + kCellBlock - 1) / kCellBlock;
        in_.kernels.cell_vertices(in_.results, queue.ends256.data(), queue.planes(),
                                  blocks * kCellBlock);
        const bool is_simple = &queue == &in_.simple;
        const bool has_cliffs = !in_.covered256.empty();  // of a landscape
        for (std::size_t i = 0; i < queue.count; ++i) {
            const Cell& cell = queue.cells[i];
            if (has_cliffs && is_steep(in_.results, i)) {
                smooth_steep_normal(in_.results, i, columns_, cell.x, cell.z, cell.floor256);
            }
            put(cell, i, shade_of(cell, i, is_simple));
        }
        queue.count = 0;
    }

    Shade shade_of(const Cell& cell, std::size_t i, bool is_simple) const {
        const std::int32_t upright = in_.results.first_upright[i];
        if (upright == 4) {
            return of_cliff(cell, i);
        }
        const std::size_t first = column(index_of(cell), upright);
        const std::uint16_t id =
            is_simple ? columns_.top_id[first]
                      : columns_.end(first, end_from(first, cell.floor256)).palette_id;
        return in_.shades[id].shade;
    }

    void put(const Cell& cell, std::size_t i, Shade shade) {
        const CellResults& made = in_.results;
        const std::int32_t x =
            places_.base256[cell.x] + (made.offset256[0][i] & places_.keeps[cell.x]);
        const std::int32_t y = cell.floor256 - in_.origin256 + made.offset256[1][i];
        const std::int32_t z =
            places_.base256[cell.z] + (made.offset256[2][i] & places_.keeps[cell.z]);
        const std::size_t at = cell.at;
        packed_[at] = packed_position(x, y, z);
        out_.positions256[at] = {x, y, z};
        out_.normals[at] = {made.normal[0][i], made.normal[1][i], made.normal[2][i]};
        out_.colors[at] = {shade.r, shade.g, shade.b};
        out_.material_ids[at] = shade.material;
        if (!in_.covered256.empty()) {
            out_.parts[at] = part_at(index_of(cell), cell.floor256);
        }
    }

    /// What the cell's vertex is of: a cave's if all four columns have enough rock above the cell.
    MeshPart part_at(std::size_t index, std::int32_t floor256) const {
        const Lanes is_open =
            lanes_of(in_.covered256.data(), index) < floor256 + std::int32_t{kUnitsPerVoxel};
        return bits_of(is_open) == 0 ? MeshPart::cave : MeshPart::ground;
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
    Shade of_cliff(const Cell& cell, std::size_t i) const {
        const int corner = solid_end_of_level_edge(static_cast<unsigned>(in_.results.solid[i]));
        const std::size_t at = column(index_of(cell), corner % 4);
        const std::int32_t y256 = cell.floor256 + corner / 4 * kUnitsPerVoxel;
        if (in_.results.distance256[corner][i] < kDistanceMax256) {
            const std::size_t above_at = end_from(at, y256);
            const SolidEnd above = columns_.end(at, above_at);
            const bool is_under =
                above_at == 0 || above.y256 - y256 <= y256 - columns_.end(at, above_at - 1).y256;
            return in_
                .shades[is_under ? above.palette_id : columns_.end(at, above_at - 1).palette_id]
                .shade;
        }
        const ColumnGrid& grid = in_.stack.columns;
        return shade_at(std::span(grid.limits)
                            .subspan(grid.offsets[at], grid.offsets[at + 1] - grid.offsets[at]),
                        y256, in_.stack.palette, in_.shades);
    }

    Input in_;
    const SolidColumns& columns_;
    CellPlaces places_;
    Mesh& out_;
    std::vector<PackedPosition>& packed_;
};

/// One vertex for every used cell, at its number.
void find_vertices(VertexMaker& maker, const Cells& cells, const SolidMask& solid) {
    const std::size_t width = cells.used.width;
    const std::size_t last = width - 2;
    BitList list;
    for (std::size_t z = 0; z <= last; ++z) {
        for (std::size_t word = 0; word < cells.used.words; ++word) {
            list.read(cells.used.row(z, word), 0, last);
            const std::uint32_t* const first_vertex =
                cells.first_vertex.data() + (cells.used.row(z, word) - cells.used.bits.data());
            std::size_t x_before = width;
            std::uint32_t at = 0;
            for (const auto [x, bit] : list.places()) {
                at = x == x_before ? at + 1 : first_vertex[x];
                x_before = x;
                maker.add(at, x, static_cast<std::uint32_t>(z),
                          (solid.word_y[word] + bit) * kUnitsPerVoxel);
            }
        }
    }
    maker.finish();
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
    : SurfaceNetsMesher(definition, chosen_mesh_kernels()) {}

SurfaceNetsMesher::SurfaceNetsMesher(const WorldDefinition& definition, const MeshKernels& kernels)
    : buffers_(std::make_unique<Buffers>(definition, kernels)) {
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
    VertexMaker maker(out, b.packed,
                      {.stack = stack,
                       .columns = b.columns,
                       .shades = b.shades,
                       .covered256 = b.covered256,
                       .origin256 = window.origin256,
                       .kernels = b.kernels,
                       .simple = b.simple_cells,
                       .other = b.other_cells,
                       .results = b.results});
    find_vertices(maker, b.cells, b.solid);
    find_triangles(out, b.packed, b.solid, b.edges, b.cells);
    b.water.append(out, stack, heights);
}

}  // namespace terrane
