// Overhangs: hard layers that lean out over soft ones.
//
// For a layer k with resistance over kHard above one under kSoft, thicker than kThickLeast, whose
// top stands above the column: of all lip columns j within `overhang`,
//
//     e = min over j of dist / (reach_j + .5);  j is a lip if raw_j - Us_j >= A_k (raw height of
//         the layer's top here), pf_j >= .27, fine_j >= -1, |Us_j - Us| <= .4 dist
//     reach = overhang * clamp01(.6 + 1.6 noise)
//     e < 1: rock from top - t to top, t = .45 thickness (1 - e^2) + 1.2, top lowered by 1.5 e
//
// A dilation of the lips, so that it hangs together with what it grows from. The air below goes
// down to the ground; a gap under kGapLeast is filled. One overhang a column, level 0 only. There
// is none where the ground is no longer the rock's: where pf < .27, as for lips, and where a river
// or a sinkhole has cut more than kCutMost into it; or ledges would hang in the air before their
// hill. Lips are told by what the land was before those, so that some 6 in 100,000 columns of
// ledges still do.
#pragma once

#include "generator/landscape/resistance.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/region.h"
#include "generator/world/world_definition.h"

#include <cstdint>
#include <vector>

namespace terrane {

struct OverhangConstants {
    std::int32_t reach = 0;  ///< columns; 0: none
    /// Layers that can lean out, bottom first: at most every second one, so 32.
    std::vector<std::size_t> ledges;
    std::vector<float> distances;  ///< of columns within `reach`, see LipPlace
    Noise noise;

    OverhangConstants(const WorldDefinition& definition, const ResistanceConstants& resistance);
};

/// What overhangs look at, over a shape that is grown by `reach` on each side.
struct OverhangInput {
    RectangleShape field;
    const float* raw = nullptr;
    const float* moved = nullptr;  ///< Us
    const float* crest = nullptr;  ///< pf
    const float* fine = nullptr;
};

struct Overhang {
    float bottom = 0;  ///< voxels
    float top = 0;
    float ground = 0;         ///< under it, while it was found
    std::int32_t layer = -1;  ///< -1: none here
};

class OverhangField {
  public:
    /// Finds the overhangs of a region, but for its outermost columns. Layers that can lean out are
    /// built if they are not there. `ground` is of the region's shape.
    void build(const OverhangConstants& constants, const ResistanceConstants& resistance,
               const OverhangInput& input, Region& region, const TerrainConstants& terrain,
               const float* ground, const RowKernels& kernels, NoiseBuffers& buffers);

    void clear() { overhangs_.clear(); }

    /// After channels and funnels: where they cut into the ground, its ledge has broken off.
    void break_off(const float* ground);

    bool is_empty() const { return overhangs_.empty(); }

    const Overhang* at(std::size_t i) const {
        return overhangs_.empty() || overhangs_[i].layer < 0 ? nullptr : &overhangs_[i];
    }

    template <typename Use>
    void for_each(Use use) const {
        for (const Overhang& one : overhangs_) {
            if (one.layer >= 0) {
                use(one);
            }
        }
    }

  private:
    bool find_ledges(const OverhangConstants& constants, const ResistanceConstants& resistance,
                     const OverhangInput& input, Region& region, const TerrainConstants& terrain,
                     const RowKernels& kernels);

    std::vector<Overhang> overhangs_;
    std::vector<float> over_;
    std::vector<float> inverse_reach_;  ///< 1 / (reach + .5)
    std::vector<float> highest_;
    std::vector<float> row_highest_;
    std::vector<float> raw_top_;       ///< raw height of the layers so far
    std::vector<float> raw_tops_;      ///< planes: raw height of each ledge's top
    std::vector<std::uint32_t> lean_;  ///< bit l: ledge l may lean out over the column
};

}  // namespace terrane
