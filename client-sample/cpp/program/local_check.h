// Chunks against local generation: a server's world, built here from its own world file, must give
// the same chunks. Works on a thread of its own, so that a load's timing stays the load's.
//
// Columns are compared byte by byte before compression, meshes by every vertex and index after both
// sides' Draco, uniform chunks by composition.
#pragma once

#include "generator/terrain/world.h"
#include "protocol/base/bytes.h"
#include "protocol/base/mutex.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <thread>

namespace terrane {

/// Chunks that wait to be checked; at more they go unchecked.
inline constexpr std::size_t kChecksQueuedMax = 64;

/// The world of a WorldDefinition, after its fingerprint has been found to be `fingerprint` and
/// the answer's. Fails with `wrong_world`, or `invalid_argument` with the first fault (textures are
/// no part of the text, so worlds that have some can't be built here).
Result<std::shared_ptr<const World>> build_sent_world(const WorldAnswer& answer,
                                                      const Hash128& fingerprint);

/// Generates the chunk and compares. Fails with `corrupt`, saying what differs. `payload` has been
/// decoded before without a fault.
class ChunkChecker {
  public:
    /// Concentrations of uniform chunks may differ by `share_tolerance`: HTTP rounds them.
    explicit ChunkChecker(std::shared_ptr<const World> world, double share_tolerance = 0);
    ~ChunkChecker();

    Result<void> check(const ChunkAnswer& answer, std::span<const std::byte> payload);

  private:
    struct Buffers;
    std::shared_ptr<const World> world_;
    double share_tolerance_;
    std::unique_ptr<Buffers> buffers_;
};

struct CheckCounts {
    std::uint64_t checked = 0;
    std::uint64_t wrong = 0;
    std::string first_wrong;
};

/// A checker and its thread. `offer` and `counts` from any thread.
class LocalCheck {
  public:
    explicit LocalCheck(std::shared_ptr<const World> world, double share_tolerance = 0);
    /// Drops what waits.
    ~LocalCheck();

    /// Copies the chunk, unless the queue is full; false then.
    bool offer(const ChunkAnswer& answer, std::span<const std::byte> payload);

    /// Waits until all that was offered is checked.
    void finish();

    CheckCounts counts() const;

  private:
    struct Waiting {
        ChunkAnswer answer;
        Bytes payload;
    };

    void run(const std::stop_token& stop);

    ChunkChecker checker_;
    mutable Mutex mutex_;
    std::condition_variable_any changed_;
    std::deque<Waiting> queue_ TERRANE_GUARDED_BY(mutex_);
    bool is_checking_ TERRANE_GUARDED_BY(mutex_) = false;
    bool is_over_ TERRANE_GUARDED_BY(mutex_) = false;
    CheckCounts counts_ TERRANE_GUARDED_BY(mutex_);
    std::jthread thread_;  // last: it uses all the others
};

}  // namespace terrane
