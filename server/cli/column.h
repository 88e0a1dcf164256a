// terrane column: one column's limits, for a person or a program.
#pragma once

#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"

#include <span>
#include <string>

namespace terrane {

/// A column with what its limits refer to.
struct ColumnReport {
    ColumnPos position;
    std::span<const Limit> limits;  ///< bottom first
    const Palette& palette;
    std::span<const Material> materials;
};

/// One line: {"x":..,"z":..,"limits":[{"y256":..,"flow":[a,b,c],"composition":{"name":share}}]}.
std::string column_json(const ColumnReport& column);

/// A table, a limit a line.
std::string column_text(const ColumnReport& column);

}  // namespace terrane
