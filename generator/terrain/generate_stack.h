// From coordinates to limits: a chunk stack, or any rectangle of columns.
#pragma once

#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/region.h"
#include "generator/terrain/world.h"
#include "generator/volume/stack.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"

#include <cstdint>
#include <memory>

namespace terrane {

struct ColumnWriterOutput;

/// A rectangle's columns and what their limits refer to.
struct ColumnSet {
    ColumnGrid columns;
    Palette palette;                ///< as Stack::palette
    std::int32_t highest_y256 = 0;  ///< the highest limit
};

/// One worker's generator and its buffers: reused from stack to stack so that the steady state
/// allocates nothing. Belongs to one thread at a time; its contents never change results. `world`
/// must outlive it.
class StackGenerator {
  public:
    /// With the row kernels that TERRANE_SIMD names, or the fastest.
    explicit StackGenerator(const World& world);
    StackGenerator(const World& world, const RowKernels& kernels);
    ~StackGenerator();
    StackGenerator(StackGenerator&&) noexcept;
    StackGenerator& operator=(StackGenerator&&) noexcept;

    /// Overwrites `out` (its buffers are reused) with the stack at `position`. The result is a
    /// function of (world, position) only. Fails with `out_of_range` when a column, apron included,
    /// is at or beyond kColumnCoordinateLimit, and `unsupported` for a level this build lacks.
    Result<void> generate(Stack& out, StackPos position);

    /// Overwrites `out` with any rectangle of level-0 columns, local coordinates from 0. Sides
    /// 1..126 columns. Fails with `out_of_range` like `generate`.
    Result<void> generate(ColumnSet& out, const ColumnRectangle& rectangle);

  private:
    struct Buffers;

    Result<void> build(const ColumnRectangle& rectangle);
    void write(const ColumnWriterOutput& out, std::int32_t apron);

    const World* world_;
    const RowKernels* kernels_;
    std::unique_ptr<Buffers> buffers_;
};

}  // namespace terrane
