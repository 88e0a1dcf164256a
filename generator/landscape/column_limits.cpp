#include "generator/landscape/column_limits.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace terrane {

void Overlays::add(std::int32_t low, std::int32_t high, LimitTail tail) {
    if (low >= high) {
        return;
    }
    if (overlays_.empty() || overlays_.back().high <= low) {
        overlays_.push_back({.low = low, .high = high, .tail = tail});
        return;
    }
    std::size_t first = 0;  // the first that reaches above `low`
    while (first < overlays_.size() && overlays_[first].high <= low) {
        ++first;
    }
    std::size_t end = first;  // the first that begins at `high` or above
    while (end < overlays_.size() && overlays_[end].low < high) {
        ++end;
    }
    std::array<Overlay, 3> pieces;
    std::size_t count = 0;
    if (first < end && overlays_[first].low < low) {
        pieces[count] = overlays_[first];
        pieces[count++].high = low;
    }
    pieces[count++] = {.low = low, .high = high, .tail = tail};
    if (first < end && overlays_[end - 1].high > high) {
        pieces[count] = overlays_[end - 1];
        pieces[count++].low = high;
    }
    const std::size_t had = end - first;
    const auto at = overlays_.begin() + static_cast<std::ptrdiff_t>(first);
    if (count > had) {
        overlays_.insert(at, count - had, Overlay{});
    } else {
        overlays_.erase(at, at + static_cast<std::ptrdiff_t>(had - count));
    }
    std::copy_n(pieces.begin(), count, overlays_.begin() + static_cast<std::ptrdiff_t>(first));
}

void Overlays::cut(std::int32_t top) {
    while (!overlays_.empty() && overlays_.back().low >= top) {
        overlays_.pop_back();
    }
    if (!overlays_.empty()) {
        overlays_.back().high = std::min(overlays_.back().high, top);
    }
}

}  // namespace terrane
