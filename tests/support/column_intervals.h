// What columns are made of as intervals of one kind, and which of them hang together.
#pragma once

#include "generator/terrain/generate_stack.h"
#include "generator/volume/water.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

namespace terrane::testing {

/// Heights in 1/256 voxel.
struct Interval {
    std::int32_t low = 0;
    std::int32_t high = 0;
};

inline constexpr std::int32_t kSky256 = 1 << 30;

/// The solid parts of a column, bottom first.
inline std::vector<Interval> solid_intervals(std::span<const Limit> column,
                                             const Palette& palette) {
    std::vector<Interval> found;
    for (std::size_t i = 0; i + 1 < column.size(); ++i) {
        if (column[i + 1].y256 <= column[i].y256 || !palette[column[i].palette_id].is_solid()) {
            continue;
        }
        if (!found.empty() && found.back().high == column[i].y256) {
            found.back().high = column[i + 1].y256;
        } else {
            found.push_back({.low = column[i].y256, .high = column[i + 1].y256});
        }
    }
    return found;
}

/// What is between them and above, up to kSky256.
inline std::vector<Interval> hollow_intervals(std::span<const Interval> solid) {
    std::vector<Interval> found;
    for (std::size_t i = 0; i < solid.size(); ++i) {
        found.push_back(
            {.low = solid[i].high, .high = i + 1 < solid.size() ? solid[i + 1].low : kSky256});
    }
    return found;
}

/// The highest open water of a column, or nothing (INT32_MIN): water that only air is above.
inline std::int32_t open_water256(std::span<const Limit> column, const Palette& palette,
                                  std::span<const Material> materials) {
    for (std::size_t i = column.size() - 1; i > 0; --i) {
        const PaletteEntry& entry = palette[column[i - 1].palette_id];
        if (column[i].y256 <= column[i - 1].y256) {
            continue;
        }
        if (is_water(entry, materials)) {
            return column[i].y256;
        }
        if (entry.is_solid()) {
            break;
        }
    }
    return INT32_MIN;
}

/// Intervals of a square of columns with what hangs together joined.
class JoinedIntervals {
  public:
    /// `columns`: width x width, row by row. Neighbours join where they overlap by `least256`.
    JoinedIntervals(std::vector<std::vector<Interval>> columns, std::int32_t width,
                    std::int32_t least256)
        : columns_(std::move(columns)) {
        std::uint32_t count = 0;
        for (const auto& column : columns_) {
            first_.push_back(count);
            count += static_cast<std::uint32_t>(column.size());
        }
        parent_.resize(count);
        std::iota(parent_.begin(), parent_.end(), 0U);
        const auto side = static_cast<std::size_t>(width);
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            if (i % side + 1 < side) {
                join(i, i + 1, least256);
            }
            if (i + side < columns_.size()) {
                join(i, i + side, least256);
            }
        }
    }

    std::uint32_t root(std::size_t column, std::size_t interval) {
        std::uint32_t at = first_[column] + static_cast<std::uint32_t>(interval);
        while (parent_[at] != at) {
            parent_[at] = parent_[parent_[at]];
            at = parent_[at];
        }
        return at;
    }

    const std::vector<std::vector<Interval>>& columns() const { return columns_; }

    std::size_t size() const { return parent_.size(); }

  private:
    void join(std::size_t a, std::size_t b, std::int32_t least256) {
        for (std::size_t i = 0; i < columns_[a].size(); ++i) {
            for (std::size_t j = 0; j < columns_[b].size(); ++j) {
                const std::int32_t overlap = std::min(columns_[a][i].high, columns_[b][j].high) -
                                             std::max(columns_[a][i].low, columns_[b][j].low);
                if (overlap >= least256) {
                    parent_[root(a, i)] = root(b, j);
                }
            }
        }
    }

    std::vector<std::vector<Interval>> columns_;
    std::vector<std::uint32_t> first_;
    std::vector<std::uint32_t> parent_;
};

/// A square of columns from (x0, z0), made patch by patch; `use(x, z, column, palette)` gets each.
template <typename Use>
void for_each_column(const World& world, std::int64_t x0, std::int64_t z0, std::int32_t width,
                     std::int32_t patch, Use use) {
    StackGenerator generator(world);
    ColumnSet set;
    for (std::int32_t z = 0; z < width; z += patch) {
        for (std::int32_t x = 0; x < width; x += patch) {
            ASSERT_TRUE(generator.generate(
                set, {.x0 = x0 + x, .z0 = z0 + z, .width = patch, .length = patch}));
            for (std::int32_t dz = 0; dz < patch; ++dz) {
                for (std::int32_t dx = 0; dx < patch; ++dx) {
                    use(x + dx, z + dz, set.columns.column(dx, dz), set.palette);
                }
            }
        }
    }
}

}  // namespace terrane::testing
