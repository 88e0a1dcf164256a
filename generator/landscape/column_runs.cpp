#include "generator/landscape/column_runs.h"

#include <algorithm>
#include <array>

namespace terrane {
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

Limit* ColumnRuns::write(Limit* out, std::uint16_t void_id) const {
    const Limit* const first = out;
    LimitTail shown = void_id;
    for (const Run& run : runs_) {
        const bool blends = run.middle > run.bottom;
        const LimitTail start = blends ? run.from : run.tail;
        if (out != first && start == shown) {
            out -= blends ? 0 : 1;  // goes on with what is there
        } else {
            put_limit(out++, run.bottom, start);
        }
        if (blends && run.middle < run.top) {
            put_limit(out++, run.middle, run.tail);
        }
        put_limit(out++, run.top, run.tail);
        shown = run.tail;
    }
    put_limit(out++, top(), void_id);
    return out;
}

}  // namespace terrane
