// One column of a landscape, from the bottom to the top.
//
// Blocks between fracture planes, each with its layers and lenses; the fillings of fractures; soil,
// sand and snow; caves and what floods them; open water; an overhang. What comes later replaces
// what was there, see column_runs.h.
#pragma once

#include "generator/landscape/landscape.h"

#include <cstdint>
#include <span>
#include <vector>

namespace terrane {

/// Rasters of the region's shape, unless `field` is named; borrowed.
struct ColumnSources {
    const World& world;
    const LandscapeConstants& constants;
    const std::vector<LayerRules>& rules;
    const Region& region;
    const std::vector<float>& ground;
    const std::vector<float>& banks;
    const std::vector<float>& crest;
    const std::vector<float>& river;
    const std::vector<float>& soil;
    const ChannelRasters& channels;
    const CaveField& caves;
    const OverhangField& overhangs;
    const FractureField& fractures;   ///< of the field
    const std::vector<float>& folds;  ///< likewise
    const RectangleShape& field;
    std::int32_t margin = 0;  ///< columns from the field's side to the shape's
};

class ColumnMaker {
  public:
    explicit ColumnMaker(const ColumnSources& sources) : sources_(sources) {}

    /// Overwrites `out` with column (x, z), counted from the rectangle's corner, -1 being its
    /// apron.
    void make(ColumnRuns& out, std::int32_t x, std::int32_t z, bool has_flow) const;

  private:
    struct Place;

    void add_blocks(ColumnRuns& out, const Place& place) const;
    void add_layers(ColumnRuns& out, const Place& place, std::int32_t moved256,
                    std::int32_t block_top) const;
    void add_lenses(ColumnRuns& out, const Place& place, std::int32_t moved256,
                    std::int32_t block_bottom) const;
    void add_sheets(ColumnRuns& out, const Place& place) const;
    void add_cover(ColumnRuns& out, const Place& place) const;
    void add_caves(ColumnRuns& out, const Place& place) const;
    void add_overhang(ColumnRuns& out, const Place& place) const;

    ColumnSources sources_;
};

}  // namespace terrane
