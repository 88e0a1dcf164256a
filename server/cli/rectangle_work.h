// Work over a rectangle of chunk stacks, spread over threads: what preseed and verify share.
//
// A rectangle is cut into batches of at most 64 stacks: squares of 8 x 8, so that neighbours meet
// in one worker's plots and in one stretch of the store's keys, or, shuffled, any 64 stacks.
#pragma once

#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "server/cli/arguments.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace terrane {

/// 4096 x 4096 stacks: hours of one worker, and 64 MiB of order when shuffled.
inline constexpr std::uint64_t kRectangleStacksMax = std::uint64_t{1} << 24U;
inline constexpr std::int64_t kBatchSide = 8;
inline constexpr std::size_t kBatchStacksMax = 64;

/// Which stacks make up which batch. Immutable; read from any thread.
class StackBatches {
  public:
    /// Every stack of the rectangle is in exactly one batch. With `shuffle_seed` the order is a
    /// random one that depends on the seed and the rectangle's size only. Fails with `too_large`
    /// above kRectangleStacksMax.
    static Result<StackBatches> cut(const StackRectangle& rectangle,
                                    std::optional<std::uint64_t> shuffle_seed = std::nullopt);

    std::size_t size() const { return batches_; }

    std::uint64_t stacks() const { return static_cast<std::uint64_t>(width_ * length_); }

    /// The level-0 stacks of batch `index` < size(). Overwrites `out`.
    void fill(std::vector<StackPos>& out, std::size_t index) const;

  private:
    explicit StackBatches(const StackRectangle& rectangle);

    StackPos stack_at(std::int64_t x, std::int64_t z) const;

    StackRectangle rectangle_;
    std::int64_t width_ = 0;
    std::int64_t length_ = 0;
    std::size_t batches_ = 0;
    std::vector<std::uint32_t> order_;  ///< empty unless shuffled
};

/// Does one batch. Belongs to one worker's thread. May throw; that fails the whole work.
using BatchStep = std::function<Result<void>(std::span<const StackPos>)>;

struct BatchWorkers {
    std::size_t count = 1;  ///< 1..kWorkersMax
    /// Called once on each worker's thread.
    std::function<BatchStep()> make_step;
    /// Called on the caller's thread about every 20 ms and at the end with the stacks done so far.
    /// False stops the work after the batches under way. May be empty.
    std::function<bool(std::uint64_t stacks_done)> tick;
};

/// Runs every batch once, or until something fails or `tick` says to stop. Gives the stacks done;
/// fewer than `batches.stacks()` means stopped. Fails with the first failure of a step;
/// what `make_step` or `tick` throws, or a thread that can't be started, is `internal`.
Result<std::uint64_t> for_each_batch(const StackBatches& batches, const BatchWorkers& workers);

}  // namespace terrane
