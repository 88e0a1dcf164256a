// A rectangle of columns to bytes: the body of CHUNK_FORMAT.md's records.
//
// Runs of columns of one signature are found first. Each is then turned on its side (slot_rows.h),
// so that limits that mean the same lie together: what is coded in a plane is copied to it, what
// is derived is compared with its derivation. Last, the planes are coded.
#pragma once

#include "generator/volume/column_codec.h"
#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "protocol/base/bytes.h"

#include <memory>

namespace terrane {

/// Reused from record to record, it allocates nothing but what `out` grows. One thread's; its
/// contents never change results.
class ColumnEncoder {
  public:
    ColumnEncoder();
    ~ColumnEncoder();
    ColumnEncoder(ColumnEncoder&&) noexcept;
    ColumnEncoder& operator=(ColumnEncoder&&) noexcept;

    /// Appends to `out`.
    void encode(Bytes& out, const ColumnGrid& columns, const Palette& palette,
                const ColumnsLayout& layout);

  private:
    struct Buffers;
    std::unique_ptr<Buffers> buffers_;
};

}  // namespace terrane
