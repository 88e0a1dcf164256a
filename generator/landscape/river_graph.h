// Rivers first: the drainage that all relief hangs on.
//
// Source: Genevaux, Galin, Guerin, Peytavie, Benes, "Terrain generation using procedural models
// based on hydrology", 2013: draw the rivers, then raise the land between them. There, rivers grow
// over the whole map; here every node finds its way alone, so that any place can be asked for:
//
// - One node in each cell of a staggered lattice, `valley` columns apart, somewhere inside it. Its
//   level is a smooth potential plus a little chance.
// - It flows to the lowest of its six neighbours if that is lower, else it is a sink: a lake, or
//   the sea, below its level. So rivers only run downhill, join, and never cross.
// - acc = 1, and kUpstreamSteps times acc = 1 + the sum of acc upstream. The measure of a river's
//   width at a node is sqrt(acc - 1): a source begins at 0.
// - A reach is a quadratic curve from a node to the one downstream, in kReachSegments straight
//   pieces; level and width are linear along it.
//
// Everything that looks a place up first moves it by a noise, which makes the rivers wind.
#pragma once

#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/noise.h"
#include "generator/world/world_definition.h"
#include "protocol/base/check.h"

#include <array>
#include <cstdint>
#include <vector>

namespace terrane {

inline constexpr std::int32_t kUpstreamSteps = 3;
/// The nodes that can matter to a place: so many cells around its own.
inline constexpr std::int64_t kRiverReachCells = 3;

struct RiverConstants {
    std::int64_t cell_x = 0;  ///< columns
    std::int64_t cell_z = 0;
    float ground = 0;
    float fall = 0;
    float wander = 0;  ///< columns by which places are moved at most
    std::uint64_t seed = 0;
    Noise potential;
    Noise wander_x;
    Noise wander_z;

    explicit RiverConstants(const WorldDefinition& definition);

    /// Ground level of the land without its chance part, at a column.
    float potential_at(std::int64_t x, std::int64_t z) const;

    /// No river level leaves these.
    double level_max() const;

    std::int64_t row_of(std::int64_t z) const;
    /// Column of the cell in row j.
    std::int64_t cell_of(std::int64_t x, std::int64_t j) const;
};

/// From a node to the one downstream; columns from the node. A sink's reach is a point.
struct Reach {
    std::int64_t x = 0;  ///< the node
    std::int64_t z = 0;
    std::array<float, kReachSegments + 1> px{};
    std::array<float, kReachSegments + 1> pz{};
    std::array<float, kReachSegments> inverse_square{};  ///< 1 / length^2 of each piece, or 0
    float level = 0;  ///< at the node, then what is added towards the end
    float level_change = 0;
    float measure = 0;  ///< of width, likewise
    float measure_change = 0;
    float x_min = 0;  ///< its box
    float x_max = 0;
    float z_min = 0;
    float z_max = 0;
    bool is_sink = false;
};

/// What kernels see of a reach; the place of its node is left to the caller.
ReachShape shape_of_reach(const Reach& reach);

struct ReachBox {
    float x_min = 0;
    float x_max = 0;
    float z_min = 0;
    float z_max = 0;
};

/// Cells first_i <= i <= last_i, likewise j.
struct CellRange {
    std::int64_t first_i = 0;
    std::int64_t last_i = -1;
    std::int64_t first_j = 0;
    std::int64_t last_j = -1;

    friend bool operator==(const CellRange&, const CellRange&) = default;
};

/// Where a cell's river passes.
struct RiverNode {
    std::uint64_t hash = 0;
    std::int64_t x = 0;
    std::int64_t z = 0;
    float level = 0;
    float accumulated = 1;
    std::int8_t downstream = -1;  ///< which neighbour; -1: it is a sink
};

/// A rectangle of cells' nodes, by row.
struct RiverNodes {
    CellRange range;
    std::vector<RiverNode> nodes;
};

/// The reaches of a rectangle of cells. Kept from region to region: neighbours ask for the same, or
/// for most of the nodes.
class RiverGraph {
  public:
    /// More are never held: a coarse region of the widest rectangle needs fewer.
    static constexpr std::size_t kNodesMax = std::size_t{1} << 16U;

    void build(const RiverConstants& constants, const CellRange& range);

    const Reach& reach(std::int64_t i, std::int64_t j) const {
        return reaches_[static_cast<std::size_t>(
            (j - range_.first_j) * (range_.last_i - range_.first_i + 1) + (i - range_.first_i))];
    }

    /// By row, then along it.
    const std::vector<Reach>& reaches() const { return reaches_; }

    /// Calls `use(reach)` for those of `range` whose boxes may meet `box`, in order. Boxes are
    /// floats, in columns from the first reach's node: `box` must have some slack.
    template <typename Use>
    void for_each_meeting(const CellRange& range, const ReachBox& box, Use use) const {
        TERRANE_DEBUG_ASSERT(range.first_i >= range_.first_i && range.last_i <= range_.last_i &&
                             range.first_j >= range_.first_j && range.last_j <= range_.last_j);
        const std::int64_t width = range_.last_i - range_.first_i + 1;
        for (std::int64_t j = range.first_j; j <= range.last_j; ++j) {
            const auto row = static_cast<std::size_t>((j - range_.first_j) * width);
            const auto end = row + static_cast<std::size_t>(range.last_i - range_.first_i);
            for (auto n = row + static_cast<std::size_t>(range.first_i - range_.first_i); n <= end;
                 ++n) {
                const ReachBox& one = boxes_[n];
                if (one.x_min <= box.x_max && one.x_max >= box.x_min && one.z_min <= box.z_max &&
                    one.z_max >= box.z_min) {
                    use(reaches_[n]);
                }
            }
        }
    }

  private:
    CellRange range_;
    RiverNodes nodes_;  ///< of the range and what is upstream and downstream of it
    RiverNodes before_;
    std::vector<Reach> reaches_;
    std::vector<ReachBox> boxes_;
};

}  // namespace terrane
