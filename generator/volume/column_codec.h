// A rectangle of columns as bytes: the body of CHUNK_FORMAT.md's records.
//
// Signatures first, then heights, then (in an own section) the flow. Heights are coded surface by
// surface (plane_coder.h); where an interval begins is derived from its neighbours and only what
// deviates is stored, so that every list of limits comes back exactly.
#pragma once

#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <cstdint>

namespace terrane {

/// Limits are in the palette's range; the corner, width and length are the caller's business.
/// `apron` columns on each side are expected to have flow 0 (others cost more bytes).
struct ColumnsLayout {
    std::int32_t width = 0;
    std::int32_t length = 0;
    std::int32_t apron = 0;
    bool with_flow = true;
};

/// Appends to `out`.
void encode_columns(Bytes& out, const ColumnGrid& columns, const Palette& palette,
                    const ColumnsLayout& layout);

/// Fills offsets and limits; the rest of `columns` is the caller's. `limits_max` is checked before
/// anything is allocated for limits.
Result<void> decode_columns(ColumnGrid& columns, ByteReader& in, const Palette& palette,
                            const ColumnsLayout& layout, std::size_t limits_max);

}  // namespace terrane
