// The relief: how high the land stands between its rivers, from plains to mountains.
//
// A lattice every kLatticeStep columns carries, with t the distance to the rivers in half valleys:
//
//     w = (1 - q/R^2)^2 / (q + e2)^2 for each reach nearer than R = 1.1 valleys (q: distance^2)
//     hr = sum(w * level) / sum(w)                               level of the rivers
//     d = sqrt(max(0, 1/sqrt(sum w) - e2)), t = min(1.4, d / half a valley)
//     pf = lerp(sqrt(t^2 + .03) - .173, t^2 / (t^2 + .15), plateau)    0 at a river, 1 on a crest
//     vm = .1 + .9 * step(-.2, .3, noise)                         how mountainous
//     g = hr + height * vm * pf
//
// The sum is a smooth minimum of distances, so that valleys meet in crests (Genevaux et al. 2013)
// without sorting or a pass over the map. Only reaches of nodes at most kRiverReachCells away come
// so near: four tiles of at most sixteen lattice points look for them together, by their boxes.
// Columns take the uniform cubic B-spline of 4 x 4 points, and its gradient; so do they take how
// far a place is moved before a river is sought. Levels whose step exceeds a quarter of the valley
// take the value of one point; levels whose step exceeds the valley take the mean between river and
// crest.
#pragma once

#include "generator/landscape/river_graph.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/noise.h"
#include "generator/world/world_definition.h"

#include <cstdint>
#include <vector>

namespace terrane {

inline constexpr std::int64_t kLatticeStep = 8;  ///< columns

struct ReliefConstants {
    RiverConstants rivers;
    float height = 0;
    float valley = 0;
    float plateau = 0;
    Noise mountains;

    explicit ReliefConstants(const WorldDefinition& definition);
};

/// One value a column of a shape: padded_size() each.
struct ReliefRasters {
    std::vector<float> ground;    ///< g, voxels
    std::vector<float> river;     ///< hr, voxels
    std::vector<float> crest;     ///< pf
    std::vector<float> mountain;  ///< vm
    std::vector<float> slope_x;   ///< of g, voxels a column
    std::vector<float> slope_z;
    std::vector<float> wander_x;  ///< columns by which the place is moved before a river is sought
    std::vector<float> wander_z;
    bool is_smooth = false;  ///< false at coarse levels: there are no slopes, and no channels
};

/// Whether levels of such a step have slopes and channels.
inline bool is_smooth_step(const ReliefConstants& constants, std::int64_t step) {
    constexpr std::int64_t kSmoothSteps = 4;  // a valley is so many steps wide where it is smoothed
    return step <= constants.rivers.cell_x / kSmoothSteps;
}

/// Builds relief for one worker; keeps its rivers and buffers.
class ReliefBuilder {
  public:
    /// Makes the rivers around a shape known; before what is inside of it is built.
    void find_rivers(const ReliefConstants& constants, const RectangleShape& shape);

    void build(ReliefRasters& out, const ReliefConstants& constants, const RectangleShape& shape,
               const RowKernels& kernels, NoiseBuffers& buffers);

    const RiverGraph& rivers() const { return rivers_; }

  private:
    struct Axis;
    struct Tiles;

    /// Points of the lattice that are weighed together.
    struct LatticeTile {
        std::size_t first_x = 0;
        std::size_t first_z = 0;
        std::size_t width = 0;
        std::size_t length = 0;
    };

    void fill_lattice(const ReliefConstants& constants, const Axis& x, const Axis& z,
                      const RowKernels& kernels, NoiseBuffers& buffers);
    void fill_tiles(const ReliefConstants& constants, const Axis& x, const Axis& z,
                    const LatticeTile& first, const RowKernels& kernels);
    Tiles place_tiles(const Axis& x, const Axis& z, const LatticeTile& first) const;
    void find_near(const ReliefConstants& constants, const Tiles& tiles);
    void build_far(ReliefRasters& out, const ReliefConstants& constants,
                   const RectangleShape& shape, const RowKernels& kernels, NoiseBuffers& buffers);
    void take_points(ReliefRasters& out, std::size_t plane, std::size_t size) const;
    void smooth(ReliefRasters& out, const Axis& x, const Axis& z, const RectangleShape& shape,
                const RowKernels& kernels);
    void mix_lattice_row(const Axis& x, const Axis& z, std::int32_t row);

    RiverGraph rivers_;
    std::vector<float> lattice_;    ///< planes of g, hr, pf, vm and how a place is moved in x and z
    std::vector<ReachShape> near_;  ///< of some tiles of the lattice
    std::vector<float> mixed_;      ///< one row of the lattice, mixed along z
};

}  // namespace terrane
