#include "client-sample/cpp/view_set.h"

#include "protocol/base/coords.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace terrane {

std::int32_t heights_of(std::int32_t lod, const ServerHello& world) {
    if (lod > 0) {
        return 1;
    }
    const double highest = std::floor(world.height_bound_voxels / world.chunk_height);
    return static_cast<std::int32_t>(std::clamp(highest, 0.0, 65535.0)) + 1;
}

ViewSet::ViewSet(const ViewUpdate& view, const ServerHello& world) {
    const std::size_t levels = std::min(
        {view.radius_chunks.size(), kViewLevelsMax, static_cast<std::size_t>(world.levels)});
    const auto radius = [&](std::size_t level) {
        return static_cast<double>(
            std::min(view.radius_chunks[level], world.limits.view_radius_max));
    };
    constexpr std::int64_t kFirst = std::numeric_limits<std::int32_t>::min();
    constexpr std::int64_t kLast = std::numeric_limits<std::int32_t>::max();
    for (std::size_t i = levels; i-- > 0;) {
        const double side = static_cast<double>(world.chunk_side) * std::exp2(i);
        for (const bool is_x : {true, false}) {
            const double at = (is_x ? view.x : view.z) / side;
            Span there;
            if (i + 1 == levels) {  // the roots: distance <= radius
                there = {.first = static_cast<std::int64_t>(std::ceil(at - radius(i))) - 1,
                         .last = static_cast<std::int64_t>(std::floor(at + radius(i)))};
            } else if (const Rectangle& above = levels_[i + 1].split;
                       above.x.size() > 0 && above.z.size() > 0) {
                const Span& parents = is_x ? above.x : above.z;
                there = {.first = 2 * parents.first, .last = 2 * parents.last + 1};
            }
            there = {.first = std::max(there.first, kFirst), .last = std::min(there.last, kLast)};
            (is_x ? levels_[i].there.x : levels_[i].there.z) = there;
            if (i > 0 && radius(i - 1) > 0) {  // distance < radius of the level below
                const double reach = radius(i - 1) / 2;
                Span& split = is_x ? levels_[i].split.x : levels_[i].split.z;
                const auto first = static_cast<std::int64_t>(std::floor(at - reach));
                const auto last = static_cast<std::int64_t>(std::ceil(at + reach)) - 1;
                split = {.first = std::max(there.first, first), .last = std::min(there.last, last)};
            }
        }
    }
}

bool ViewSet::contains(StackPos square) const {
    if (square.lod < 0 || static_cast<std::size_t>(square.lod) >= levels_.size()) {
        return false;
    }
    const Level& level = levels_[static_cast<std::size_t>(square.lod)];
    return level.there.has(square.x, square.z) && !level.split.has(square.x, square.z);
}

std::vector<StackPos> ViewSet::squares() const {
    std::vector<StackPos> squares;
    squares.reserve(size());
    for (std::size_t i = 0; i < levels_.size(); ++i) {
        const Rectangle& there = levels_[i].there;
        const Rectangle& split = levels_[i].split;
        for (std::int64_t z = there.z.first; z <= there.z.last; ++z) {
            for (std::int64_t x = there.x.first; x <= there.x.last; ++x) {
                if (!split.has(x, z)) {
                    squares.push_back({.lod = static_cast<std::int32_t>(i),
                                       .x = static_cast<std::int32_t>(x),
                                       .z = static_cast<std::int32_t>(z)});
                }
            }
        }
    }
    return squares;
}

std::size_t ViewSet::size() const {
    std::int64_t sum = 0;
    for (const auto& [there, split] : levels_) {
        sum += there.x.size() * there.z.size() - split.x.size() * split.z.size();
    }
    return static_cast<std::size_t>(sum);
}

}  // namespace terrane
