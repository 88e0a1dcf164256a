#include "server/render/draw_pieces.h"

#include "protocol/base/check.h"
#include "protocol/base/mutex.h"
#include "protocol/base/result.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <limits>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace terrane {
namespace {

/// What the threads of one drawing share.
class Pieces {
  public:
    Pieces(std::int32_t count, const TellDrawn& tell) : count_(count), tell_(tell) {}

    void draw(const std::function<DrawPiece()>& begin) {
        try {
            const DrawPiece draw_piece = begin();
            for (std::int32_t piece = next_++; piece < count_; piece = next_++) {
                if (auto drawn = draw_piece(piece); !drawn) {
                    fail_with(drawn.error());
                    return;
                }
                count_one();
            }
        } catch (const std::exception& error) {
            fail_with({.code = ErrorCode::internal, .message = error.what()});
        }
    }

    /// Ends the others after the pieces that they are at.
    void fail_with(Error error) {
        next_ = std::numeric_limits<std::int32_t>::max() / 2;
        const MutexLock lock(mutex_);
        failure_ = failure_ ? std::move(failure_) : std::move(error);
    }

    Result<void> result() {
        const MutexLock lock(mutex_);
        if (failure_) {
            return tl::unexpected(*failure_);
        }
        return {};
    }

  private:
    void count_one() {
        const std::uint64_t done = ++done_;
        if (tell_ && !telling_.test_and_set(std::memory_order_acquire)) {
            tell_(done, static_cast<std::uint64_t>(count_));
            telling_.clear(std::memory_order_release);
        }
    }

    const std::int32_t count_;
    const TellDrawn& tell_;
    std::atomic<std::int32_t> next_ = 0;
    std::atomic<std::uint64_t> done_ = 0;
    std::atomic_flag telling_;
    Mutex mutex_;
    std::optional<Error> failure_ TERRANE_GUARDED_BY(mutex_);
};

}  // namespace

Result<void> draw_pieces(std::int32_t count, std::int32_t threads, const TellDrawn& tell,
                         const std::function<DrawPiece()>& begin) {
    TERRANE_ASSERT(threads >= 1);
    Pieces pieces(count, tell);
    {
        std::vector<std::jthread> workers;
        try {
            for (std::int32_t i = 0; i < std::min(threads, count); ++i) {
                workers.emplace_back([&] { pieces.draw(begin); });
            }
        } catch (const std::exception& error) {
            pieces.fail_with({.code = ErrorCode::internal, .message = error.what()});
        }
    }
    return pieces.result();
}

}  // namespace terrane
