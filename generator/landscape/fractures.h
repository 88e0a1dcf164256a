// Fractures: faults, dykes and mineral sheets are one thing, a plane through the rock.
//
// A cell of kFractureCell columns holds a few, in two sets of joints along and across the folds. A
// plane stands at y_f = y_reference - a * tangent, with l and a the column's place along and across
// it. Its two sides have slipped by the throw, which dies out towards the tips and away from the
// plane, as real faults do:
//
//     m = (1 - (l/L)^2)+^2 * (1 - (a/R)^2)+^2;    U += (y > y_f ? -1 : +1) * throw/2 * m
//
// So displacement is local and bounded. The planes of a column split it into blocks with a U of
// their own; a fault contact is sharp, and layers repeat or go missing across one by themselves.
// Some fractures are filled: the sheet around the plane is vein material. Within kEnrichedDepth of
// the ground it is the richer one of two compositions (supergene enrichment).
#pragma once

#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/noise.h"
#include "generator/world/world_definition.h"

#include <cstdint>
#include <span>
#include <vector>

namespace terrane {

inline constexpr std::int64_t kFractureCell = 512;     ///< columns
inline constexpr std::size_t kPlanesPerColumnMax = 6;  ///< of further ones the last are left out
inline constexpr float kEnrichedDepth = 24;            ///< voxels under the ground

struct FractureConstants {
    double density = 0;
    double throw_voxels = 0;
    double length = 0;
    double dip = 0;
    double sheet = 0;
    double strike = 0;  ///< turns
    double y_reference = 0;
    std::uint64_t seed = 0;
    Noise warp;

    explicit FractureConstants(const WorldDefinition& definition);

    /// |U| of all fractures of a column never exceeds this.
    double bound() const;
};

/// One plane where it passes a column.
struct PlaneInColumn {
    float y = 0;                ///< height of the plane, voxels
    float half_throw = 0;       ///< what the side below is lifted by, and the side above lowered
    float half_sheet = 0;       ///< voxels of filling above and below the plane; 0: none
    std::uint32_t filling = 0;  ///< a hash: which filling
};

/// The planes of a rectangle's columns.
class FractureField {
  public:
    /// Overwrites the field. Levels with steps of half a cell or more have no fractures.
    void build(const FractureConstants& constants, const RectangleShape& shape,
               const RowKernels& kernels, NoiseBuffers& buffers);

    /// The planes of column `i` of the shape's rasters, in order of their cells and numbers.
    std::span<const PlaneInColumn> planes(std::size_t i) const {
        if (counts_.empty() || counts_[i] == 0) {
            return {};
        }
        return {pool_.data() + static_cast<std::size_t>(places_[i]) * kPlanesPerColumnMax,
                counts_[i]};
    }

    /// How many each column has; nothing in a field that is empty.
    std::span<const std::uint8_t> counts() const { return counts_; }

    bool is_empty() const { return pool_used_ == 0; }

  private:
    std::vector<float> warp_;
    std::vector<std::uint8_t> counts_;
    std::vector<std::uint32_t> places_;
    std::vector<PlaneInColumn> pool_;
    std::size_t pool_used_ = 0;
};

/// What the fractures of a column add to the U of a height.
float displacement_at(std::span<const PlaneInColumn> planes, float y);

}  // namespace terrane
