// One smooth surface over a rectangle of columns, as small residuals.
//
// The tops of one layer over neighbouring columns are samples of one smooth surface. A plane holds
// such a surface, with holes where a column lacks it, and codes it in raster order against a
// prediction from cells already coded:
//
//     first order    L + U - UL                            a tilted plane continues
//     second order   (1 - (1-Dx)^2 (1-Dz)^2) f             a curved one does; needs 8 neighbours
//     edges          what is left of that: 2L - LL, L, 2U - UU, U, UL, UR, else the last cell coded
//
// Which order is better depends on how rough the surface is, so the encoder tries both on some
// rows. All sums wrap at 32 bits, which makes every value codable.
#pragma once

#include "protocol/base/bytes.h"

#include <array>
#include <cstddef>
#include <cstdint>

namespace terrane {

/// Columns along a side of the largest stack, apron included.
inline constexpr std::size_t kPlaneSideMax = 66;
/// Loops work on so many cells at once and may read and write so many past a row's end.
inline constexpr std::size_t kPlaneBlock = 8;

/// `length` rounded up to whole blocks.
constexpr std::size_t whole_blocks(std::size_t length) {
    return (length + kPlaneBlock - 1) / kPlaneBlock * kPlaneBlock;
}

/// Cells and rows of margin, to be read without checks.
inline constexpr std::size_t kPlaneMargin = 2;

/// A row's cells as bits. 66 columns do not fit into 64.
__extension__ using RowMask = unsigned __int128;

/// Where a plane's cells lie. Before row 0 there are kPlaneMargin rows of no cells, before each row
/// kPlaneMargin values and after it kPlaneBlock that belong to nobody.
struct PlaneView {
    std::uint32_t* cells = nullptr;  ///< cell (x, z) at [z * stride + x]
    RowMask* present = nullptr;      ///< bit x + kPlaneMargin of [z]; [-1] and [-2] are 0
    std::size_t stride = 0;
    std::size_t rows = 0;

    std::uint32_t* row(std::size_t z) const { return cells + z * stride; }

    void mark(std::size_t z, std::size_t x, std::size_t length) const {
        present[z] |= ((RowMask{1} << length) - 1) << (x + kPlaneMargin);
    }
};

/// Room for one plane of any size.
struct Plane {
    static constexpr std::size_t kStride = kPlaneSideMax + kPlaneMargin + kPlaneBlock;
    static constexpr std::size_t kRows = kPlaneSideMax + kPlaneMargin;

    std::array<std::uint32_t, kStride * kRows + kPlaneBlock> values{};
    std::array<RowMask, kRows> present{};

    PlaneView view() {
        return {.cells = values.data() + kPlaneMargin * kStride + kPlaneMargin,
                .present = present.data() + kPlaneMargin,
                .stride = kStride,
                .rows = kPlaneSideMax};
    }

    void clear() { present.fill(0); }
};

enum class PlaneOrder : std::uint8_t { first, second };

/// A plane's codes before they are written.
struct PlaneCodes {
    std::array<std::uint32_t, kPlaneSideMax * kPlaneSideMax + kPlaneBlock> of_cells;
};

/// Appends the plane as CHUNK_FORMAT.md has it under Heights.
void encode_heights(Bytes& out, const PlaneView& plane, PlaneCodes& scratch);

/// Fills the present cells. False when the bytes are cut short or no such encoding.
bool decode_heights(const PlaneView& plane, ByteReader& in);

/// Three planes of signed bytes, packed into a value (the lowest byte first): one after the other,
/// first order modulo 256, a byte a cell.
void encode_flows(Bytes& out, const PlaneView& plane, PlaneCodes& scratch);
bool decode_flows(const PlaneView& plane, ByteReader& in);

}  // namespace terrane
