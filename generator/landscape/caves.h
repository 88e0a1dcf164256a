// Cave systems: nodes in the soluble layers, joined by tubes.
//
// After Paris, Guerin, Peytavie, Collon, Galin, "Synthesizing geologically coherent cave networks",
// 2021: caves begin on inception horizons, so they follow layers and their folds. There, paths are
// searched over the whole rock; here every node knows its neighbours, so that any place can be
// asked for.
//
// Horizons: the stack from kLowest to kHighest of its depth is cut into `levels` bands; in each,
// the layer with the greatest soluble * thickness, if that is over kSolubleLeast. A cell of `cell`
// columns has a node on each horizon with chance `density`. Tubes run to the next nodes along +x
// and +z with chance `connect`, along the diagonal with 0.3 of it, up to the next horizon with
// `shaft`; a node of the highest horizon opens to the sky with `sink`, a doline.
//
// A tube is kTubePoints points along a bent line. At a column each piece is a capsule: with q the
// distance^2 on the map, r the radius made uneven by noise, hh = sqrt(r^2 - q) and m the slope of
// the piece, the cave reaches hh * sqrt(1 + m^2) up from the axis but not beyond the piece's ends
// and hh, and 0.62 of it down, so that one can walk.
#pragma once

#include "generator/landscape/fold.h"
#include "generator/terrain/layer_stack.h"
#include "generator/terrain/noise.h"
#include "generator/world/world_definition.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {

inline constexpr std::size_t kTubePoints = 7;
inline constexpr std::size_t kCavesPerColumnMax = 10;  ///< of further ones the last are left out

/// A layer in which caves form.
struct CaveHorizon {
    float bottom = 0;  ///< voxels
    float thickness = 0;
    float soluble = 0;
};

struct CaveConstants {
    std::int64_t cell = 0;  ///< columns; 0: no caves
    CaveParameters parameters;
    std::vector<CaveHorizon> horizons;  ///< bottom first
    std::uint64_t seed = 0;
    Noise rough;   ///< of walls
    Noise ragged;  ///< likewise, wider

    CaveConstants(const WorldDefinition& definition, const LayerStack& stack);
};

struct TubePoint {
    float x = 0;  ///< columns from the tube's origin
    float z = 0;
    float y = 0;  ///< voxels
    float radius = 0;
};

struct Tube {
    std::int64_t x = 0;  ///< origin: its first node
    std::int64_t z = 0;
    std::array<TubePoint, kTubePoints> points{};
    float x_min = 0;  ///< its box, radii included
    float x_max = 0;
    float z_min = 0;
    float z_max = 0;
    float y_min = 0;  ///< no floor is lower
};

/// A shaft to the sky and the funnel around its mouth.
struct Doline {
    std::int64_t x = 0;
    std::int64_t z = 0;
    float y = 0;  ///< of the node it leads to
    float radius = 0;
};

/// What begins in a cell.
struct CaveCell {
    std::vector<Tube> tubes;
    std::vector<Doline> dolines;
};

/// A rectangle of cells, by row.
struct CaveCells {
    std::int64_t first_i = 0;
    std::int64_t first_j = 0;
    std::int64_t width = 0;
    std::int64_t length = 0;

    bool holds(std::int64_t i, std::int64_t j) const {
        return i >= first_i && i < first_i + width && j >= first_j && j < first_j + length;
    }

    std::size_t index(std::int64_t i, std::int64_t j) const {
        return static_cast<std::size_t>((j - first_j) * width + (i - first_i));
    }

    friend bool operator==(const CaveCells&, const CaveCells&) = default;
};

/// Everything that can be met in a rectangle of columns, cells ascending. Kept from region to
/// region: neighbours ask for the same cells, or for most of them.
class CaveGraph {
  public:
    void build(const CaveConstants& constants, const FoldConstants& folds,
               const RectangleShape& shape);

    std::span<const CaveCell> cells() const { return cells_; }

  private:
    CaveCells known_;
    std::vector<CaveCell> cells_;
    std::vector<CaveCell> before_;
};

/// Voxels from floor to lid in one column.
struct CaveGap {
    float floor = 0;
    float lid = 0;
};

/// The gaps of a rectangle's columns.
class CaveField {
  public:
    /// Overwrites the field: level 0's gaps as far as they begin under the ground.
    void build(const CaveConstants& constants, const CaveGraph& graph, const float* ground,
               const RectangleShape& shape, const RowKernels& kernels, NoiseBuffers& buffers);

    void clear() { counts_.clear(); }

    bool is_empty() const { return counts_.empty(); }

    /// How many each column has; nothing in a field that is empty.
    std::span<const std::uint8_t> counts() const { return counts_; }

    std::span<const CaveGap> gaps(std::size_t i) const {
        if (counts_.empty()) {
            return {};
        }
        return {pool_.data() + std::size_t{places_[i]} * kCavesPerColumnMax, counts_[i]};
    }

  private:
    void add(std::size_t i, CaveGap gap);
    void add_tube(const Tube& tube, const float* ground, const RectangleShape& shape,
                  const RowKernels& kernels);

    std::vector<std::uint8_t> counts_;
    std::vector<std::uint32_t> places_;
    std::vector<CaveGap> pool_;
    std::uint32_t pool_used_ = 0;
    std::vector<float> rough_;
    std::vector<float> ragged_;
    std::vector<float> tube_floor_;  ///< of one tube, while it is being added
    std::vector<float> tube_lid_;
};

/// Lowers the ground around the mouths of dolines; `allowed` is 0 where water would run in and 1
/// where nothing speaks against it.
void cut_funnels(float* ground, const float* allowed, const CaveGraph& graph,
                 const RectangleShape& shape);

}  // namespace terrane
