// One column while a landscape puts it together: what it is made of, bottom to top, as runs that
// later things cut into. Heights in 1/256 voxel.
#pragma once

#include "generator/volume/limit.h"

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace terrane {

/// Palette id and flow as they lie in a limit behind its height: id | flow << 16.
using LimitTail = std::uint64_t;

constexpr std::uint16_t palette_id_of(LimitTail tail) {
    return static_cast<std::uint16_t>(tail & 0xffffU);
}

constexpr LimitTail tail_of(std::uint16_t id, std::int32_t packed_flow) {
    return id | std::uint64_t{static_cast<std::uint32_t>(packed_flow)} << 16U;
}

inline void put_limit(Limit* to, std::int32_t y256, LimitTail tail) {
    static_assert(sizeof(Limit) == sizeof y256 + sizeof tail && offsetof(Limit, palette_id) == 4 &&
                  offsetof(Limit, flow) == 6);
    std::memcpy(static_cast<void*>(to), &y256, sizeof y256);
    std::memcpy(&to->palette_id, &tail, sizeof tail);
}

/// From bottom to top shows `tail`; up to `middle`, if that is above the bottom, it blends out of
/// `from`.
struct Run {
    std::int32_t bottom = 0;
    std::int32_t top = 0;
    std::int32_t middle = 0;
    LimitTail tail = 0;
    LimitTail from = 0;
};

/// Runs follow each other without gaps from height 0 on. Belongs to one thread.
class ColumnRuns {
  public:
    void clear() { runs_.clear(); }

    std::int32_t top() const { return runs_.empty() ? 0 : runs_.back().top; }

    bool is_empty() const { return runs_.empty(); }

    const Run& last() const { return runs_.back(); }

    /// On top of what is there; nothing if `run` has no height.
    void push(const Run& run) {
        if (run.top > run.bottom) {
            runs_.push_back(run);
        }
    }

    /// Replaces what lies in low..high, as far as there is something.
    void replace(std::int32_t low, std::int32_t high, LimitTail tail);

    /// What lies at a height below the top.
    LimitTail at(std::int32_t y256) const;

    /// Removes everything above.
    void cut(std::int32_t top);

    /// Writes the column's limits and the void's and returns their end; at most limits_max().
    /// Equal neighbours become one.
    Limit* write(Limit* out, std::uint16_t void_id) const;

    std::size_t limits_max() const { return 3 * runs_.size() + 1; }

    std::span<const Run> runs() const { return runs_; }

  private:
    std::vector<Run> runs_;
};

}  // namespace terrane
