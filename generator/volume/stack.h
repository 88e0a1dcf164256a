// A chunk stack: every height over one N x N square. The unit of generation, cache and storage.
#pragma once

#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "protocol/base/coords.h"

#include <cstdint>

namespace terrane {

struct Stack {
    StackPos position;
    std::int32_t side = 0;  ///< N
    /// Columns -1..N in x and z (an apron of one column for meshing, flow 0 there), local
    /// coordinates; whole columns from y256 = 0 (base) to the (y, void) limit at the top.
    ColumnGrid columns;
    /// Layers, void (K), then the elements that own a limit here, apron included, in ascending
    /// (gap, element id) order.
    Palette palette;
    std::int32_t highest_y256 = 0;  ///< the highest limit of the N x N columns

    friend bool operator==(const Stack&, const Stack&) = default;
};

}  // namespace terrane
