// All planes of a rectangle of columns, each with the rows that it needs.
#pragma once

#include "generator/volume/plane_coder.h"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {

/// First every run of cells is announced, then place() makes room, then the cells are put. Reused,
/// it allocates nothing. One thread's.
class PlaneSet {
  public:
    void begin(std::size_t planes) { ranges_.assign(planes, {}); }

    /// Rows come in ascending order.
    void announce(std::size_t plane, std::uint32_t z) {
        Range& range = ranges_[plane];
        if (range.rows == 0) {
            range.first = z;
        }
        range.rows = z - range.first + 1;
    }

    /// Of planes up to `width` cells wide.
    void place(std::size_t width) {
        stride_ = (width + kPlaneMargin + 2 * kPlaneBlock - 1) / kPlaneBlock * kPlaneBlock;
        std::size_t rows = 0;
        for (Range& range : ranges_) {
            range.begin = rows + kPlaneMargin;
            rows += kPlaneMargin + range.rows;
        }
        present_.assign(rows, 0);
        if (cells_.size() < rows * stride_ + kPlaneMargin + kPlaneBlock) {
            cells_.resize(rows * stride_ + kPlaneMargin + kPlaneBlock);
        }
    }

    std::size_t size() const { return ranges_.size(); }

    PlaneView view(std::size_t plane) {
        const Range& range = ranges_[plane];
        return {.cells = cells_.data() + range.begin * stride_ + kPlaneMargin,
                .present = present_.data() + range.begin,
                .stride = stride_,
                .rows = range.rows};
    }

    /// Marks `length` cells from x on of row z; gives where they are to be put, in whole blocks.
    std::uint32_t* cells(std::size_t plane, std::uint32_t z, std::uint32_t x, std::size_t length) {
        const Range& range = ranges_[plane];
        const std::size_t row = range.begin + (z - range.first);
        present_[row] |= ((RowMask{1} << length) - 1) << (x + kPlaneMargin);
        return cells_.data() + row * stride_ + kPlaneMargin + x;
    }

  private:
    struct Range {
        std::uint32_t first = 0;
        std::uint32_t rows = 0;
        std::size_t begin = 0;  ///< of its row `first` in all planes' rows
    };

    std::vector<Range> ranges_;
    std::vector<std::uint32_t> cells_;
    std::vector<RowMask> present_;
    std::size_t stride_ = 0;
};

}  // namespace terrane
