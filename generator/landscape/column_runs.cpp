#include "generator/landscape/column_runs.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace terrane {
namespace {

Limit limit_of(std::int32_t y256, LimitTail tail) {
    const auto flow = [tail](unsigned shift) {
        return static_cast<std::int8_t>(static_cast<std::uint8_t>(tail >> shift));
    };
    return {.y256 = y256,
            .palette_id = palette_id_of(tail),
            .flow = {.x = flow(16), .y = flow(24), .z = flow(32)}};
}

}  // namespace

void ColumnRuns::replace(std::int32_t low, std::int32_t high, LimitTail tail) {
    low = std::max(low, 0);
    high = std::min(high, top());
    if (low >= high) {
        return;
    }
    std::size_t first = runs_.size() - 1;
    while (runs_[first].bottom > low) {
        --first;
    }
    std::size_t last = first;
    while (runs_[last].top < high) {
        ++last;
    }
    std::array<Run, 3> pieces;
    std::size_t count = 0;
    if (runs_[first].bottom < low) {
        pieces[count] = runs_[first];
        pieces[count].top = low;
        pieces[count].middle = std::min(pieces[count].middle, low);
        ++count;
    }
    pieces[count++] = {.bottom = low, .top = high, .middle = low, .tail = tail, .from = tail};
    if (runs_[last].top > high) {
        pieces[count] = runs_[last];
        pieces[count].bottom = pieces[count].middle = high;
        ++count;
    }
    const std::size_t had = last - first + 1;
    const auto at = runs_.begin() + static_cast<std::ptrdiff_t>(first);
    if (count > had) {
        runs_.insert(at, count - had, Run{});
    } else {
        runs_.erase(at, at + static_cast<std::ptrdiff_t>(had - count));
    }
    std::copy_n(pieces.begin(), count, runs_.begin() + static_cast<std::ptrdiff_t>(first));
}

LimitTail ColumnRuns::at(std::int32_t y256) const {
    std::size_t i = runs_.size() - 1;
    while (i > 0 && runs_[i].bottom > y256) {
        --i;
    }
    return runs_[i].tail;
}

void ColumnRuns::cut(std::int32_t top) {
    while (!runs_.empty() && runs_.back().bottom >= top) {
        runs_.pop_back();
    }
    if (!runs_.empty() && runs_.back().top > top) {
        runs_.back().top = top;
        runs_.back().middle = std::min(runs_.back().middle, top);
    }
}

void ColumnRuns::write(Limits& out, std::uint16_t void_id) const {
    const std::size_t first = out.size();
    out.resize(first + 3 * runs_.size() + 1);
    Limit* to = out.data() + first;
    LimitTail shown = void_id;
    for (const Run& run : runs_) {
        const bool blends = run.middle > run.bottom;
        const LimitTail start = blends ? run.from : run.tail;
        if (run.bottom > 0 && start == shown) {
            to -= blends ? 0 : 1;  // goes on with what is there
        } else {
            *to++ = limit_of(run.bottom, start);
        }
        if (blends && run.middle < run.top) {
            *to++ = limit_of(run.middle, run.tail);
        }
        *to++ = limit_of(run.top, run.tail);
        shown = run.tail;
    }
    *to++ = {.y256 = top(), .palette_id = void_id, .flow = {}};
    out.resize(static_cast<std::size_t>(to - out.data()));
}

}  // namespace terrane
