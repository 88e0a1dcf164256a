#include "server/report/joined_intervals.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>

namespace terrane {

JoinedIntervals::JoinedIntervals(const IntervalColumns& columns, std::size_t width,
                                 std::int32_t least256)
    : columns_(&columns) {
    std::size_t count = 0;
    for (const auto& column : columns) {
        first_.push_back(count);
        count += column.size();
    }
    parent_.resize(count);
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
    for (std::size_t i = 0; i < columns.size(); ++i) {
        if (i % width + 1 < width) {
            join(i, i + 1, least256);
        }
        if (i + width < columns.size()) {
            join(i, i + width, least256);
        }
    }
}

std::size_t JoinedIntervals::root(std::size_t column, std::size_t interval) {
    std::size_t at = first_[column] + interval;
    while (parent_[at] != at) {
        parent_[at] = parent_[parent_[at]];
        at = parent_[at];
    }
    return at;
}

void JoinedIntervals::join(std::size_t a, std::size_t b, std::int32_t least256) {
    for (std::size_t i = 0; i < (*columns_)[a].size(); ++i) {
        for (std::size_t j = 0; j < (*columns_)[b].size(); ++j) {
            const Interval& one = (*columns_)[a][i];
            const Interval& other = (*columns_)[b][j];
            if (std::min(one.high, other.high) - std::max(one.low, other.low) >= least256) {
                parent_[root(a, i)] = root(b, j);
            }
        }
    }
}

}  // namespace terrane
