// From coordinates to a chunk stack: noise, heights, elements, limits.
#pragma once

#include <memory>

#include "generator/terrain/world.h"
#include "generator/volume/stack.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"

namespace terrane {

/// One worker's buffers: reused from stack to stack so that the steady state allocates nothing.
/// Belongs to one thread at a time; its contents never change results.
class StackGenerator {
  public:
    explicit StackGenerator(const World& world);
    ~StackGenerator();
    StackGenerator(StackGenerator&&) noexcept;
    StackGenerator& operator=(StackGenerator&&) noexcept;

    /// Overwrites `out` (its buffers are reused) with the stack at `position`. The result is a
    /// function of (world, position) only. Fails with `out_of_range` when a column, apron included,
    /// is at or beyond kColumnCoordinateLimit, and `unsupported` for a level this build lacks.
    Result<void> generate(Stack& out, StackPos position);

  private:
    struct Buffers;
    const World* world_;
    std::unique_ptr<Buffers> buffers_;
};

}  // namespace terrane
