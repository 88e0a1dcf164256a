// A drawing in pieces that do not look at each other, made by several threads.
#pragma once

#include "protocol/base/result.h"

#include <cstdint>
#include <functional>

namespace terrane {

/// Called as pieces are done, from whichever thread drew one, by one at a time; while it runs
/// others are counted and not told of.
using TellDrawn = std::function<void(std::uint64_t done, std::uint64_t total)>;

/// Draws one piece. One thread's.
using DrawPiece = std::function<Result<void>(std::int32_t piece)>;

/// Draws pieces 0..count-1, in at most `threads` threads, each of which calls `begin` once for its
/// own DrawPiece; `tell` may be empty. Returns the first failure, after which no piece is handed
/// out; exceptions (out of memory, most likely) are `internal` ones. Needs: threads >= 1.
Result<void> draw_pieces(std::int32_t count, std::int32_t threads, const TellDrawn& tell,
                         const std::function<DrawPiece()>& begin);

}  // namespace terrane
