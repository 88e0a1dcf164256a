// Pieces of columns and which of them hang together: how much rock floats, what caves are one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {

/// Heights in 1/256 voxel.
struct Interval {
    std::int32_t low = 0;
    std::int32_t high = 0;
};

/// Of a square of columns, row by row; those of a column bottom first.
using IntervalColumns = std::vector<std::vector<Interval>>;

class JoinedIntervals {
  public:
    /// Neighbours join where they overlap by `least256`. `columns` must outlive it.
    JoinedIntervals(const IntervalColumns& columns, std::size_t width, std::int32_t least256);

    /// The same number for all that hang together; below `size`.
    std::size_t root(std::size_t column, std::size_t interval);

    std::size_t size() const { return parent_.size(); }

  private:
    void join(std::size_t a, std::size_t b, std::int32_t least256);

    const IntervalColumns* columns_;
    std::vector<std::size_t> first_;
    std::vector<std::size_t> parent_;
};

}  // namespace terrane
