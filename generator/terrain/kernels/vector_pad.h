// How wide kernels work, and how wide rectangles are. Plain data, see row_kernels.h.
#pragma once

#include <cstdint>

namespace terrane {

/// Kernels work in blocks of this many columns and may write so many values past a row's end.
inline constexpr std::int32_t kVectorPad = 16;
/// Widest rectangle: a 64-column stack, the paper's 50-column plots and pictures' tiles fit, with
/// the wider aprons of landscapes.
inline constexpr std::int32_t kRectangleSideMax = 144;

constexpr std::int32_t padded_width(std::int32_t width) {
    return (width + kVectorPad - 1) / kVectorPad * kVectorPad;
}

}  // namespace terrane
