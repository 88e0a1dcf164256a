#include "generator/volume/slot_values.h"

#include "generator/volume/limit.h"
#include "generator/volume/signatures.h"

#include <cstddef>
#include <cstdint>

namespace terrane {

void join_slots(ColumnGrid& columns, SlotValues& values, const SignatureRuns& runs) {
    columns.limits.resize(runs.limit_count);
    columns.offsets.assign(1, 0);
    Limit* limit = columns.limits.data();
    std::uint32_t offset = 0;
    for (const SignatureRun& run : runs.runs) {
        const auto ids = runs.table[run.signature];
        const std::uint32_t* heights = values.heights(run, 0);
        const std::uint32_t* flows = values.flows(run, 0);
        for (std::uint32_t i = 0; i < run.length; ++i) {
            std::size_t at = i;
            for (const std::uint16_t id : ids) {
                *limit++ = {.y256 = static_cast<std::int32_t>(heights[at]),
                            .palette_id = id,
                            .flow = unpack(flows[at])};
                at += run.length;
            }
            offset += static_cast<std::uint32_t>(ids.size());
            columns.offsets.push_back(offset);
        }
    }
}

}  // namespace terrane
