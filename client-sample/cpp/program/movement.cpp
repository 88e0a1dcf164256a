#include "client-sample/cpp/program/movement.h"

#include "protocol/base/result.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <numbers>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace terrane {

namespace {

constexpr double kTurnSecondsMin = 3;
constexpr double kTurnSecondsMax = 10;
constexpr double kPlaceMax = 9e15;

/// The next number of a line, or false.
bool take_number(std::string_view& line, double& number) {
    line.remove_prefix(std::min(line.find_first_not_of(" \t,"), line.size()));
    const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), number);
    if (error != std::errc()) {
        return false;
    }
    line.remove_prefix(static_cast<std::size_t>(end - line.data()));
    return std::isfinite(number) && std::abs(number) <= kPlaceMax;
}

}  // namespace

Result<std::vector<PathPoint>> parse_path(std::string_view text) {
    std::vector<PathPoint> points;
    for (std::size_t number = 1; !text.empty(); ++number) {
        const std::size_t end = std::min(text.find('\n'), text.size());
        std::string_view line = text.substr(0, end);
        text.remove_prefix(std::min(end + 1, text.size()));
        line = line.substr(0, line.find('#'));
        if (line.find_first_not_of(" \t\r") == std::string_view::npos) {
            continue;
        }
        if (points.size() == kPathPointsMax) {
            return fail(ErrorCode::too_large,
                        "a path has at most " + std::to_string(kPathPointsMax) + " points");
        }
        PathPoint point;
        const bool is_whole = take_number(line, point.seconds) && take_number(line, point.x) &&
                              take_number(line, point.y) && take_number(line, point.z);
        if (!is_whole || line.find_first_not_of(" \t\r") != std::string_view::npos) {
            return fail(ErrorCode::invalid_argument,
                        "line " + std::to_string(number) + " is not SECONDS X Y Z");
        }
        if (point.seconds < 0 || (!points.empty() && point.seconds <= points.back().seconds)) {
            return fail(ErrorCode::invalid_argument,
                        "line " + std::to_string(number) + ": times must rise from 0 on");
        }
        points.push_back(point);
    }
    if (points.empty()) {
        return fail(ErrorCode::invalid_argument, "a path without points");
    }
    return points;
}

Movement::Movement(const MovementStart& start) : start_(start), random_(start.seed) {
    place_ = {.x = start.x + random(-1, 1) * start.spread_voxels,
              .y = start.y,
              .z = start.z + random(-1, 1) * start.spread_voxels,
              .velocity_x = 0,
              .velocity_y = 0,
              .velocity_z = 0};
    if (start_.kind != MovementKind::path) {
        turn();
    }
}

/// Written out: the standard's distributions differ between libraries.
double Movement::random(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11U) * 0x1p-53;
}

/// A new heading for some seconds, or a jump.
void Movement::turn() {
    if (start_.kind == MovementKind::teleport) {
        if (seconds_ > 0) {
            const double reach = start_.spread_voxels * kTeleportSpreads;
            place_.x = start_.x + random(-1, 1) * reach;
            place_.z = start_.z + random(-1, 1) * reach;
        }
        next_turn_seconds_ = seconds_ + kTeleportSeconds * random(0.8, 1.2);
        return;
    }
    const double speed =
        start_.kind == MovementKind::walk ? kWalkVoxelsPerSecond : kFlyVoxelsPerSecond;
    const double heading = random(0, 2 * std::numbers::pi);
    place_.velocity_x = speed * std::cos(heading);
    place_.velocity_z = speed * std::sin(heading);
    next_turn_seconds_ = seconds_ + random(kTurnSecondsMin, kTurnSecondsMax);
}

ViewerPlace Movement::at(double seconds) {
    if (start_.kind == MovementKind::path) {
        return on_path(seconds);
    }
    while (seconds_ < seconds) {
        const double until = std::min(seconds, next_turn_seconds_);
        place_.x += place_.velocity_x * (until - seconds_);
        place_.z += place_.velocity_z * (until - seconds_);
        seconds_ = until;
        if (seconds_ >= next_turn_seconds_) {
            turn();
        }
    }
    return place_;
}

/// Straight from point to point; after the last it begins again.
ViewerPlace Movement::on_path(double seconds) const {
    const std::vector<PathPoint>& path = *start_.path;
    const double length = path.back().seconds;
    const double at = length > 0 ? std::fmod(seconds + start_.path_offset_seconds, length) : 0.0;
    const auto next = std::ranges::upper_bound(path, at, {}, &PathPoint::seconds);
    if (next == path.begin() || next == path.end()) {
        const PathPoint& end = next == path.end() ? path.back() : path.front();
        return {
            .x = end.x, .y = end.y, .z = end.z, .velocity_x = 0, .velocity_y = 0, .velocity_z = 0};
    }
    const PathPoint& from = *std::prev(next);
    const double duration = next->seconds - from.seconds;
    const double share = (at - from.seconds) / duration;
    return {.x = from.x + (next->x - from.x) * share,
            .y = from.y + (next->y - from.y) * share,
            .z = from.z + (next->z - from.z) * share,
            .velocity_x = (next->x - from.x) / duration,
            .velocity_y = (next->y - from.y) / duration,
            .velocity_z = (next->z - from.z) / duration};
}

}  // namespace terrane
