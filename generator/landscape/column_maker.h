// One column of a landscape, from the bottom to the top.
//
// Blocks between fracture planes, each with its layers and lenses; the fillings of fractures; soil,
// sand and snow; caves and what floods them; open water; an overhang. What comes later replaces
// what was there. Lenses, fillings and caves are looked for first, as overlays; then limits are
// written as layers are met, see column_limits.h.
#pragma once

#include "generator/landscape/column_limits.h"
#include "generator/landscape/landscape.h"

#include <array>
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
    std::size_t field_first = 0;  ///< where the shape's first column lies in the field's rasters
};

/// The layers of a row of columns.
struct LayerRow {
    const std::int32_t* y256 = nullptr;  ///< of the lowest layer's tops
    const std::int32_t* flow = nullptr;  ///< of the first column that has some
    const std::uint8_t* irregular = nullptr;
    std::ptrdiff_t plane = 0;
    std::ptrdiff_t flow_plane = 0;
    std::ptrdiff_t to_middle = 0;  ///< from a layer's top to where it has blended
    std::int32_t flow_first = 0;   ///< which column that is
    std::int32_t layers = 0;
};

class ColumnMaker {
  public:
    /// `element_ids`: those that show in some column become 0; `element_limits` gets the numbers of
    /// the limits where they do.
    ColumnMaker(const ColumnSources& sources, std::span<std::uint16_t> element_ids,
                std::vector<std::uint32_t>& element_limits)
        : sources_(sources), element_ids_(element_ids), element_limits_(element_limits) {}

    /// Before the columns of a row.
    void begin_row(std::int32_t z);

    /// Writes column (x, z), counted from the rectangle's corner, -1 being its apron, behind the
    /// first `used` limits; returns how many there are then. What is behind them is no column's.
    std::size_t write(Limits& limits, std::size_t used, std::int32_t x, std::int32_t z,
                      bool has_flow);

  private:
    static constexpr float kSandWidths = 2.2F;  ///< half widths of a river: its banks

    /// Where a column's values lie.
    struct Place {
        std::size_t at = 0;        ///< in the region's rasters
        std::size_t field_at = 0;  ///< in the field's
        std::int32_t column = 0;   ///< of the region's shape
        std::int32_t row = 0;
        float ground = 0;
        float water = kNoWater;
        std::int32_t top256 = 0;
        const std::int32_t* flow = nullptr;  ///< null: none
        std::ptrdiff_t flow_plane = 0;

        std::int32_t flow_of(std::size_t layer) const {
            return flow == nullptr ? 0 : flow[static_cast<std::ptrdiff_t>(layer) * flow_plane];
        }
    };

    /// What lies on the ground: where it begins, in 1/256 voxel.
    struct Cover {
        std::int32_t soil_from = 0;  ///< or sand; the column's top: there is none
        std::int32_t snow_from = 0;
        std::uint16_t soil = 0;
    };

    struct Block;

    Place place_at(std::int32_t x, std::int32_t z, bool has_flow) const;
    void find_blocks(const Place& place, std::span<const PlaneInColumn> planes);
    void find_lenses(const Place& place, const Block& block);
    void find_sheets(const Place& place, std::span<const PlaneInColumn> planes);

    Cover cover_of(std::size_t i) const {
        return {.soil_from = row_.soil_from[i],
                .snow_from = row_.snow_from[i],
                .soil = static_cast<std::uint16_t>(row_.soil[i])};
    }

    void find_crossed();
    void find_covers(std::ptrdiff_t first);
    void find_snow(std::ptrdiff_t first);
    bool is_by_water(const Place& place) const;
    float lowest_around(const Place& place) const;
    /// Returns where the column ends: a cave that is open to the sky is none.
    std::int32_t find_caves(const Place& place);
    LimitTail above_stack(std::int32_t last_flow) const;
    std::int32_t top_flow(const Place& place, std::size_t first) const;
    /// Up to `end`; returns the layer there.
    std::size_t write_block(LimitWriter& out, const Place& place, const Block& block,
                            std::int32_t end) const;
    /// Column `i` of the row, of one block that was `moved`, of layers, covers and open water only;
    /// returns its end.
    Limit* write_plain(Limit* to, std::size_t i, std::int32_t moved, bool has_flow) const;
    /// Any other one, likewise.
    Limit* write_crossed(Limits& limits, std::size_t used, const Place& place);

    /// Room behind the first `used` limits for what a column can have.
    Limit* reserve(Limits& limits, std::size_t used, std::size_t blocks, std::size_t overlays) {
        const std::size_t runs = blocks * (sources_.region.layers_built + 1) + 5;
        const std::size_t most = used + LimitWriter::limits_max(runs, overlays);
        if (room_ < most) {
            limits.resize(std::max(most, 2 * limits.size()));
            room_ = limits.size();
        }
        return limits.data() + used;
    }

    void write_overhang(LimitWriter& out, const Place& place) const;
    /// Of limits first to end - 1.
    void mark_elements(const Limits& limits, std::size_t first, std::size_t end);

    ColumnSources sources_;
    std::span<std::uint16_t> element_ids_;
    std::vector<std::uint32_t>& element_limits_;

    /// Of one column: rock between two planes, moved as a whole; heights in 1/256 voxel.
    struct Block {
        std::int32_t bottom = 0;
        std::int32_t top = 0;
        std::int32_t moved = 0;
    };

    std::array<Block, kPlanesPerColumnMax + 1> blocks_{};
    std::size_t block_count_ = 0;
    std::size_t room_ = 0;  ///< so many limits at least there is room for
    Overlays overlays_;

    /// Of a row of the region's shape; heights in 1/256 voxel.
    struct Row {
        std::size_t at = 0;        ///< of its first column, in the region's rasters
        std::size_t field_at = 0;  ///< likewise, in the field's
        LayerRow layers;
        std::array<std::int32_t, kRectangleSideMax> top256{};
        std::array<std::int32_t, kRectangleSideMax> soil_from{};  ///< see Cover
        std::array<std::int32_t, kRectangleSideMax> snow_from{};
        std::array<std::int32_t, kRectangleSideMax> soil{};
        std::array<std::int32_t, kRectangleSideMax> folded{};   ///< how far folds move the column
        std::array<std::uint8_t, kRectangleSideMax> crossed{};  ///< 0: layers and covers only
    } row_;
};

}  // namespace terrane
