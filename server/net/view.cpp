#include "server/net/view.h"

#include "protocol/base/check.h"
#include "protocol/base/coords.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"
#include "server/chunks/work_queue.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

namespace terrane {

namespace {

/// How far ahead a moving viewer is looked for.
constexpr float kAheadSeconds = 2;
/// What lies in the view cone counts as nearer by this.
constexpr float kConeWeight = 0.5F;
/// Of priorities a side of distance.
constexpr float kPrioritiesPerSide = 16;
constexpr float kFarthestPriority = 1 << 19;

double power_of_two(std::int32_t exponent) {
    return static_cast<double>(std::int64_t{1} << exponent);
}

std::int32_t heights_of(const ViewWorld& world) {
    const double highest = std::floor(world.height_bound_voxels / world.chunk_height);
    return static_cast<std::int32_t>(std::clamp(highest, 0.0, 65535.0)) + 1;
}

/// Between a square of level 0 and one that may be larger, along one axis: squares of level 0 from
/// one to the other, 0 inside, 1 side by side.
std::int64_t gap_of(std::int64_t own, std::int64_t at, std::int32_t lod) {
    const std::int64_t first = at << lod;
    const std::int64_t last = ((at + 1) << lod) - 1;
    return std::max({first - own, own - last, std::int64_t{0}});
}

}  // namespace

ViewSquares::Span ViewSquares::common(Span a, Span b) {
    return {.first = std::max(a.first, b.first), .last = std::min(a.last, b.last)};
}

void ViewSquares::build(Centre centre, const std::vector<double>& radii) {
    constexpr Span kEverywhere{.first = std::numeric_limits<std::int32_t>::min(),
                               .last = std::numeric_limits<std::int32_t>::max()};
    levels_ = {};
    for (std::size_t i = radii.size(); i-- > 0;) {
        const double scale = power_of_two(static_cast<std::int32_t>(i));
        Level& level = levels_[i];
        for (const bool is_x : {true, false}) {
            const double at = (is_x ? centre.x : centre.z) / scale;
            Span& there = is_x ? level.there.x : level.there.z;
            if (i + 1 == radii.size()) {  // distance <= radius
                there = {.first = static_cast<std::int64_t>(std::ceil(at - radii[i])) - 1,
                         .last = static_cast<std::int64_t>(std::floor(at + radii[i]))};
            } else if (levels_[i + 1].split.size() > 0) {
                const Span& above = is_x ? levels_[i + 1].split.x : levels_[i + 1].split.z;
                there = {.first = 2 * above.first, .last = 2 * above.last + 1};
            }
            there = common(there, kEverywhere);
            if (i > 0 && radii[i - 1] > 0) {  // distance < radius of the level below
                const double radius = radii[i - 1] / 2;
                Span& split = is_x ? level.split.x : level.split.z;
                split =
                    common(there, {.first = static_cast<std::int64_t>(std::floor(at - radius)),
                                   .last = static_cast<std::int64_t>(std::ceil(at + radius)) - 1});
            }
        }
    }
}

ViewSquares::ViewSquares(const ViewUpdate& update, const ViewWorld& world,
                         const ViewBounds& bounds) {
    const Centre centre{.x = update.x / world.side, .z = update.z / world.side};
    const std::size_t levels = std::min(
        {update.radius_chunks.size(), kViewLevelsMax, static_cast<std::size_t>(world.levels)});
    std::vector<double> radii;
    radii.reserve(levels);
    for (std::size_t i = 0; i < levels; ++i) {
        radii.push_back(std::min(update.radius_chunks[i], bounds.radius_max));
    }
    build(centre, radii);
    while (!radii.empty() && size() > bounds.squares_max) {
        if (radii.back() > 1) {  // at 0 it would end beside the viewer
            radii.back() -= 1;
        } else {
            radii.pop_back();
        }
        build(centre, radii);
    }
}

bool ViewSquares::contains(StackPos square) const {
    if (square.lod < 0 || static_cast<std::size_t>(square.lod) >= levels_.size()) {
        return false;
    }
    const Level& level = levels_[static_cast<std::size_t>(square.lod)];
    return level.there.has(square.x, square.z) && !level.split.has(square.x, square.z);
}

std::size_t ViewSquares::size() const {
    std::int64_t sum = 0;
    for (const Level& level : levels_) {
        sum += level.there.size() - level.split.size();
    }
    return static_cast<std::size_t>(sum);
}

std::size_t ViewSquares::places() const {
    std::int64_t sum = 0;
    for (const Level& level : levels_) {
        sum += level.there.size();
    }
    return static_cast<std::size_t>(sum);
}

std::size_t ViewSquares::place_of(StackPos square) const {
    std::int64_t place = 0;
    const auto lod = static_cast<std::size_t>(square.lod);
    for (std::size_t i = 0; i < lod; ++i) {
        place += levels_[i].there.size();
    }
    const Rectangle& there = levels_[lod].there;
    return static_cast<std::size_t>(place + (square.z - there.z.first) * there.x.size() +
                                    (square.x - there.x.first));
}

template <typename Visit>
void ViewSquares::for_each(Visit visit) const {
    for (std::size_t i = 0; i < levels_.size(); ++i) {
        const auto& [there, split] = levels_[i];
        for (std::int64_t z = there.z.first; z <= there.z.last; ++z) {
            const bool is_cut = split.z.has(z) && split.x.size() > 0;
            for (std::int64_t x = there.x.first; x <= there.x.last; ++x) {
                if (is_cut && x == split.x.first) {
                    x = split.x.last;
                    continue;
                }
                visit(StackPos{.lod = static_cast<std::int32_t>(i),
                               .x = static_cast<std::int32_t>(x),
                               .z = static_cast<std::int32_t>(z)});
            }
        }
    }
}

View::View(const ViewWorld& world, const ViewBounds& bounds)
    : world_(world), bounds_(bounds), heights_(terrane::heights_of(world)) {}

void View::update(const ViewUpdate& update) {
    const ViewSquares next(update, world_, bounds_);
    const bool all_again = update.format != format_ || update.without_flow != without_flow_;
    look(update);
    if (all_again || !(next == squares_)) {
        forget_what_left(next);
        if (all_again) {
            waiting_.clear();
            returned_.clear();
        }
        waiting_.reserve(next.size());  // exactly: so its memory is bounded by the view's size
        next.for_each([&](StackPos square) {
            if (all_again || !squares_.contains(square)) {
                waiting_.push_back(
                    {.handed = {.square = square, .low = 0, .high = 0}, .priority = 0});
            }
        });
        squares_ = next;
    }
    for (Waiting& waiting : waiting_) {
        waiting.priority = priority_of(waiting.handed.square);
    }
    std::ranges::make_heap(waiting_, {}, &Waiting::priority);
}

/// What was handed out and is not in `next`: to be told, and no longer waited for.
void View::forget_what_left(const ViewSquares& next) {
    unfinished_.assign(squares_.places(), false);
    forgotten_.reserve(forgotten_.size() + squares_.size());
    std::erase_if(waiting_, [&](const Waiting& waiting) {
        const Stretch& handed = waiting.handed;
        if (next.contains(handed.square)) {
            return false;
        }
        if (handed.low < handed.high) {
            forgotten_.push_back(handed);
        }
        unfinished_[squares_.place_of(handed.square)] = true;
        return true;
    });
    squares_.for_each([&](StackPos square) {
        if (!next.contains(square) && !unfinished_[squares_.place_of(square)]) {
            forgotten_.push_back({.square = square, .low = 0, .high = heights_of(square)});
        }
    });
    std::erase_if(returned_, [&](ChunkPos key) { return !next.contains(stack_of(key)); });
}

void View::look(const ViewUpdate& update) {
    format_ = update.format;
    without_flow_ = update.without_flow;
    x_sides_ = update.x / world_.side;
    z_sides_ = update.z / world_.side;
    const double y = std::floor(update.y / world_.chunk_height);
    y_chunk_ = static_cast<std::int32_t>(std::clamp(y, 0.0, heights_ - 1.0));
    const auto side = static_cast<float>(world_.side);
    ahead_ = {.x = update.velocity.x * (kAheadSeconds / side),
              .z = update.velocity.z * (kAheadSeconds / side)};
    direction_ = {};
    cone_cosine_ = -2;
    const float length = std::hypot(update.direction.x, update.direction.z);
    if (update.field_of_view > 0 && length > 0 && std::isfinite(length)) {
        direction_ = {.x = update.direction.x / length, .z = update.direction.z / length};
        cone_cosine_ = std::cos(update.field_of_view / 2);
    }
}

bool View::contains(ChunkPos key) const {
    const StackPos square = stack_of(key);
    return key.y >= 0 && key.y < heights_of(square) && squares_.contains(square);
}

std::int32_t View::priority_of(StackPos square) const {
    const auto own_x = static_cast<std::int64_t>(std::floor(x_sides_));
    const auto own_z = static_cast<std::int64_t>(std::floor(z_sides_));
    const std::int64_t gap_x = gap_of(own_x, square.x, square.lod);
    const std::int64_t gap_z = gap_of(own_z, square.z, square.lod);
    if (gap_x <= 1 && gap_z <= 1) {
        return kNearPriority + static_cast<std::int32_t>(2 - gap_x - gap_z);
    }
    // From here on in sides of the square's level.
    const double scale = power_of_two(square.lod);
    const auto x = static_cast<float>(square.x + 0.5 - x_sides_ / scale);
    const auto z = static_cast<float>(square.z + 0.5 - z_sides_ / scale);
    const float ahead_x = x - ahead_.x / static_cast<float>(scale);
    const float ahead_z = z - ahead_.z / static_cast<float>(scale);
    float distance = std::sqrt(x * x + z * z);
    const bool in_cone =
        cone_cosine_ >= -1 && direction_.x * x + direction_.z * z >= cone_cosine_ * distance;
    distance = std::min(distance, std::sqrt(ahead_x * ahead_x + ahead_z * ahead_z) + 1);
    distance *= in_cone ? kConeWeight : 1;
    return -static_cast<std::int32_t>(std::min(distance * kPrioritiesPerSide, kFarthestPriority));
}

std::optional<std::size_t> View::next_returned() const {
    std::optional<std::size_t> best;
    std::int32_t best_priority =
        waiting_.empty() ? std::numeric_limits<std::int32_t>::min() : waiting_.front().priority;
    for (std::size_t i = 0; i < returned_.size(); ++i) {
        const std::int32_t priority = priority_of(stack_of(returned_[i]));
        if (priority > best_priority || (!best && priority == best_priority)) {
            best = i;
            best_priority = priority;
        }
    }
    return best;
}

std::int32_t View::next_priority() const {
    if (const auto returned = next_returned()) {
        return priority_of(stack_of(returned_[*returned]));
    }
    return waiting_.front().priority;
}

ChunkPos View::take() {
    TERRANE_ASSERT(has_wish());
    if (const auto returned = next_returned()) {
        const ChunkPos key = returned_[*returned];
        returned_.erase(returned_.begin() + static_cast<std::ptrdiff_t>(*returned));
        return key;
    }
    Stretch& handed = waiting_.front().handed;
    const StackPos square = handed.square;
    const std::int32_t heights = heights_of(square);
    std::int32_t y = 0;
    if (handed.low == handed.high) {
        y = std::min(y_chunk_, heights - 1);
        handed.low = y;
        handed.high = y + 1;
    } else if (handed.low > 0 &&
               (handed.high == heights || y_chunk_ - handed.low <= handed.high - 1 - y_chunk_)) {
        y = --handed.low;
    } else {
        y = handed.high++;
    }
    if (handed.high - handed.low == heights) {
        std::ranges::pop_heap(waiting_, {}, &Waiting::priority);
        waiting_.pop_back();
    }
    return {.lod = square.lod, .x = square.x, .y = y, .z = square.z};
}

void View::give_back(ChunkPos key) {
    if (contains(key)) {
        returned_.push_back(key);
    }
}

std::vector<ChunkPos> View::take_forgotten(std::size_t count_max) {
    std::vector<ChunkPos> keys;
    while (!forgotten_.empty() && keys.size() < count_max) {
        Stretch& last = forgotten_.back();
        const StackPos square = last.square;
        keys.push_back({.lod = square.lod, .x = square.x, .y = --last.high, .z = square.z});
        if (last.low == last.high) {
            forgotten_.pop_back();
        }
    }
    return keys;
}

std::size_t View::bytes_max(const ViewBounds& bounds) {
    return bounds.squares_max * (sizeof(Waiting) + sizeof(Stretch));
}

}  // namespace terrane
