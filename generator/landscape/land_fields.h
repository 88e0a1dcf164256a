// What a landscape knows of each column before it asks the rock: folds, and the relief with its
// gullies.
//
// Regions of neighbours overlap by their margins: of the columns that a chunk's stack looks at, not
// half are its own. So the fields of the last regions are kept, and what they have is not made
// again: values are functions of their column alone.
#pragma once

#include "generator/landscape/erosion.h"
#include "generator/landscape/fold.h"
#include "generator/landscape/relief.h"
#include "generator/terrain/noise.h"

#include <array>
#include <vector>

namespace terrane {

/// One value a column of `shape`: padded_size() each. But for folds, of worlds with relief only.
struct LandFields {
    RectangleShape shape;
    std::vector<float> folds;  ///< voxels that the stack is moved up
    std::vector<float> raw;    ///< height before the rock is asked
    std::vector<float> fine;   ///< the finer gullies, voxels
    std::vector<float> crest;  ///< see ReliefRasters, likewise the others
    std::vector<float> river;
    std::vector<float> wander_x;
    std::vector<float> wander_z;
    bool is_smooth = false;

    using Raster = std::vector<float> LandFields::*;
    static constexpr std::array<Raster, 7> kRasters = {
        &LandFields::folds, &LandFields::raw,      &LandFields::fine,    &LandFields::crest,
        &LandFields::river, &LandFields::wander_x, &LandFields::wander_z};
};

struct LandFieldConstants {
    const FoldConstants& folds;
    const ReliefConstants& relief;
    const ErosionConstants& erosion;
    bool has_relief = false;
};

/// Builds fields for one worker; keeps the last ones (some 60 KB each), its rivers and
/// buffers.
class LandFieldBuilder {
  public:
    /// Builds the fields of `shape`; valid until the next ones are built.
    const LandFields& build(const LandFieldConstants& constants, const RectangleShape& shape,
                            const RowKernels& kernels, NoiseBuffers& buffers);

    /// Those around the last shape.
    const RiverGraph& rivers() const { return relief_builder_.rivers(); }

  private:
    void make(LandFields& out, const LandFieldConstants& constants, const RectangleShape& shape,
              const RowKernels& kernels, NoiseBuffers& buffers);

    /// Stacks of a row of some sixteen, and those beside them in the row after it.
    static constexpr std::size_t kKept = 18;

    std::array<LandFields, kKept> kept_;  ///< of level 0
    std::size_t next_ = 0;                ///< the newest
    LandFields coarse_;                   ///< of other levels
    LandFields strip_;                    ///< what was missing
    std::vector<const LandFields*> sources_;
    ReliefBuilder relief_builder_;
    ReliefRasters relief_;
    ErosionBuffers erosion_;
};

}  // namespace terrane
