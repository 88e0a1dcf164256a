// The landscape of a world: the stack of layers bent, cut and pierced, as limits.
//
// Order of work for a rectangle of columns: folds and fractures; rivers and relief; the erosion
// filter; the resistance map and overhangs, which ask for version 1's layers one by one; dolines,
// channels, the sea and banks; caves; lenses and flow of the layers that show; and then column by
// column from the bottom to the top. Each step is a file of this folder and a function of (world,
// column): regions of any size give the same bytes.
#pragma once

#include "generator/landscape/caves.h"
#include "generator/landscape/channels.h"
#include "generator/landscape/fractures.h"
#include "generator/landscape/land_fields.h"
#include "generator/landscape/landscape_palette.h"
#include "generator/landscape/overhangs.h"
#include "generator/landscape/resistance.h"
#include "generator/terrain/column_writer.h"
#include "generator/terrain/region.h"
#include "generator/terrain/world.h"

#include <cstdint>
#include <vector>

namespace terrane {

/// Everything a landscape draws from its world once; made once per generator.
struct LandscapeConstants {
    FoldConstants folds;
    FractureConstants fractures;
    ReliefConstants relief;
    ErosionConstants erosion;
    ResistanceConstants resistance;
    OverhangConstants overhangs;
    ChannelConstants channels;
    CaveConstants caves;
    LandscapePalette palette;
    bool has_relief = false;
    float snow_line = 0;
    bool has_snow = false;
    float soil = 0;
    float sea = 0;
    float water_table = 0;
    Noise soil_noise;

    explicit LandscapeConstants(const World& world);
};

/// One worker's landscape and its buffers. Belongs to one thread at a time; its contents never
/// change results. `world` must outlive it.
class Landscape {
  public:
    explicit Landscape(const World& world);

    /// Columns around a rectangle that its region must hold.
    static constexpr std::int32_t kApron = 2;

    /// Builds everything that columns are made of. `region` has been begun with kApron; the layers,
    /// elements and flows that show in some column are built.
    void build(Region& region, const TerrainConstants& constants, PlotCache& plots,
               const RowKernels& kernels);

    /// Overwrites `out` with the columns of `region.inner`, the region of `build`, and `apron` more
    /// on each side (0 or 1), without flow there.
    void write(const ColumnWriterOutput& out, const Region& region,
               const TerrainConstants& constants, std::int32_t apron);

  private:
    void build_fields(const Region& region, const RowKernels& kernels);
    void build_ground(Region& region, const TerrainConstants& constants, const RowKernels& kernels);
    void raise_banks(const Region& region);
    void find_shown(const Region& region);
    void build_shown(Region& region, const TerrainConstants& constants, const RowKernels& kernels,
                     PlotCache& plots);
    std::size_t field_index(const RectangleShape& shape, std::int32_t x, std::int32_t z) const;

    const World* world_;
    LandscapeConstants constants_;

    RectangleShape field_;  ///< the region's shape, grown by what overhangs look at
    NoiseBuffers noise_;
    LandFieldBuilder field_builder_;
    const LandFields* fields_ = nullptr;  ///< of field_
    ReliefRasters relief_;                ///< of the region's shape: its rivers and crests
    FractureField fractures_;
    CaveGraph cave_graph_;
    CaveField caves_;
    ChannelRasters channels_;
    OverhangField overhangs_;
    std::vector<float> moved_;  ///< of field_: Us, what structure did to the rock at raw height
    std::vector<float> over_;   ///< of the region's shape from here on
    std::vector<float> rest_;
    std::vector<float> ground_;
    std::vector<float> banks_;          ///< the ground with its banks
    std::vector<float> soil_;           ///< noise
    std::vector<std::int32_t> buried_;  ///< up to which height in the stack nothing shows, likewise
    std::vector<std::int32_t> shown_;   ///< height in the stack from which on nothing shows, 1/256
};

}  // namespace terrane
