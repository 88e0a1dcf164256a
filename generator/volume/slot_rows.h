// A run of columns turned on its side, so that the same limit of neighbouring columns lies
// together.
//
// A limit is three words: the height; palette id | flow x << 16 | flow y << 24; flow z (and a byte
// that means nothing). Word w of slot s of the run's column i is rows[(3 * s + w) * kStride + i].
#pragma once

#include "generator/volume/limit.h"
#include "generator/volume/plane_coder.h"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {

/// Reused from run to run. One thread's.
class SlotRows {
  public:
    /// A run, one cell of offset and a block that runs over.
    static constexpr std::size_t kStride = kPlaneSideMax + 1 + kPlaneBlock + 5;
    static constexpr std::size_t kWords = 3;
    static_assert(sizeof(Limit) == kWords * sizeof(std::uint32_t));

    /// Of `columns` columns (1..kPlaneSideMax) of `slots` limits each, one behind the other. Cells
    /// up to the end of the last block repeat the last column.
    void fill(const Limit* first, std::size_t slots, std::size_t columns);

    std::uint32_t* heights(std::size_t slot) { return words_.data() + kWords * slot * kStride; }

    /// The slot's two words that hold its flow; the second lies kStride further.
    const std::uint32_t* flow_words(std::size_t slot) { return heights(slot) + kStride; }

  private:
    std::vector<std::uint32_t> words_;
};

// Flows of a slot from column `first` on, given its flow_words() there: whole blocks.

/// As pack() makes them.
void pack_flows(std::uint32_t* packed, const std::uint32_t* words, std::size_t columns);

/// Whether any of two slots' flows differ, or any of one is not 0 (a block's rest counts too).
bool flows_differ(const std::uint32_t* a, const std::uint32_t* b, std::size_t columns);
bool flows_differ_from_zero(const std::uint32_t* words, std::size_t columns);

/// How many of the columns from `first` on, `slots` limits each, show the same palette ids as the
/// first one: 1..columns.
std::size_t count_alike(const Limit* first, std::size_t slots, std::size_t columns);

/// Whether any of the limits has a flow.
bool any_flow(const Limit* first, std::size_t count);

}  // namespace terrane
