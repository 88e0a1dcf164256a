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
// Which order is better depends on how rough the surface is, so the encoder measures both. All sums
// wrap at 32 bits, which makes every value codable.
#pragma once

#include "protocol/base/bytes.h"

#include <array>
#include <cstddef>
#include <cstdint>

namespace terrane {

/// Columns along a side of the largest stack, apron included.
inline constexpr std::size_t kPlaneSideMax = 66;

/// A row's cells as bits. 66 columns do not fit into 64.
__extension__ using RowMask = unsigned __int128;

/// Cell (x, z) stands at values[(z + 2) * kStride + x + 2]: two cells of margin to read without
/// checks.
struct Plane {
    static constexpr std::size_t kStride = kPlaneSideMax + 3;
    static constexpr std::size_t kMargin = 2;

    std::array<std::uint32_t, kStride*(kPlaneSideMax + kMargin)> values{};
    std::array<RowMask, kPlaneSideMax + kMargin> present{};  ///< bit x + 2 of [z + 2]

    std::uint32_t* row(std::size_t z) { return values.data() + (z + kMargin) * kStride + kMargin; }

    const std::uint32_t* row(std::size_t z) const {
        return values.data() + (z + kMargin) * kStride + kMargin;
    }

    void mark(std::size_t z, std::size_t x, std::size_t length) {
        present[z + kMargin] |= ((RowMask{1} << length) - 1) << (x + kMargin);
    }

    void clear() { present.fill(0); }
};

enum class PlaneOrder : std::uint8_t { first, second };

/// Appends the order (one byte), then a zigzag varint for each present cell in raster order.
void encode_heights(Bytes& out, const Plane& plane);

/// Fills the present cells. False when the bytes are cut short or no such encoding.
bool decode_heights(Plane& plane, ByteReader& in);

/// The same for signed bytes, kept as their 32-bit values: first order, modulo 256, a byte a cell.
void encode_bytes(Bytes& out, const Plane& plane);
bool decode_bytes(Plane& plane, ByteReader& in);

}  // namespace terrane
