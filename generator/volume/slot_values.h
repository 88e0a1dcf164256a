// Heights and flows of columns, slot by slot.
//
// A column's limits lie far apart in memory from those of the column beside it; here everything
// that is coded together lies together.
#pragma once

#include "generator/volume/limit.h"
#include "generator/volume/signatures.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace terrane {

/// Those of slot s of a run are run.length neighbours from run.first_limit + s * run.length on. New
/// ones are not initialised.
class SlotValues {
  public:
    explicit SlotValues(std::size_t limits)
        : heights_(std::make_unique_for_overwrite<std::uint32_t[]>(limits)),
          flows_(std::make_unique_for_overwrite<std::uint32_t[]>(limits)) {}

    std::uint32_t* heights(const SignatureRun& run, std::size_t slot) {
        return heights_.get() + run.first_limit + slot * run.length;
    }

    /// As pack() makes them.
    std::uint32_t* flows(const SignatureRun& run, std::size_t slot) {
        return flows_.get() + run.first_limit + slot * run.length;
    }

    void clear_flows(std::size_t limits) { std::fill_n(flows_.get(), limits, 0U); }

  private:
    std::unique_ptr<std::uint32_t[]> heights_;
    std::unique_ptr<std::uint32_t[]> flows_;
};

/// x in the lowest byte, then y and z.
inline std::uint32_t pack(Flow flow) {
    return static_cast<std::uint32_t>(static_cast<std::uint8_t>(flow.x)) |
           static_cast<std::uint32_t>(static_cast<std::uint8_t>(flow.y)) << 8U |
           static_cast<std::uint32_t>(static_cast<std::uint8_t>(flow.z)) << 16U;
}

inline Flow unpack(std::uint32_t bits) {
    return {.x = static_cast<std::int8_t>(bits),
            .y = static_cast<std::int8_t>(bits >> 8U),
            .z = static_cast<std::int8_t>(bits >> 16U)};
}

/// Overwrites the columns' offsets and limits.
void join_slots(ColumnGrid& columns, SlotValues& values, const SignatureRuns& runs);

}  // namespace terrane
