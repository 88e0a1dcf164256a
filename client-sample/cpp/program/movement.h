// How the simulated viewers of `terrane-client load` move: on foot, in the air, by jumps, or along
// a recorded path. A function of seed and time, so that two runs move alike.
#pragma once

#include "protocol/base/result.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <string_view>
#include <vector>

namespace terrane {

enum class MovementKind : std::uint8_t { walk, fly, teleport, path };

inline constexpr double kWalkVoxelsPerSecond = 4.5;
inline constexpr double kFlyVoxelsPerSecond = 50;
inline constexpr double kTeleportSeconds = 5;
/// A jump leads this many times as far as viewers start from one another.
inline constexpr double kTeleportSpreads = 8;
inline constexpr std::size_t kPathPointsMax = std::size_t{1} << 20U;

/// Voxels of level 0, and voxels a second.
struct ViewerPlace {
    double x = 0;
    double y = 0;
    double z = 0;
    double velocity_x = 0;
    double velocity_y = 0;
    double velocity_z = 0;
};

struct PathPoint {
    double seconds = 0;
    double x = 0;
    double y = 0;
    double z = 0;
};

/// A recorded path: lines of "SECONDS X Y Z", times rising from line to line; '#' begins a comment.
/// Fails with `invalid_argument` naming the line, `too_large` above kPathPointsMax points.
Result<std::vector<PathPoint>> parse_path(std::string_view text);

struct MovementStart {
    MovementKind kind = MovementKind::walk;
    std::uint64_t seed = 0;
    double x = 0;  ///< where viewers begin, within `spread_voxels` of it
    double y = 0;
    double z = 0;
    double spread_voxels = 0;
    /// Of `path`: shared by all viewers, and how far into it this one begins.
    std::shared_ptr<const std::vector<PathPoint>> path;
    double path_offset_seconds = 0;
};

/// One viewer's way. One thread.
class Movement {
  public:
    explicit Movement(const MovementStart& start);

    /// Where it is after so many seconds; they do not fall from call to call.
    ViewerPlace at(double seconds);

  private:
    double random(double low, double high);
    void turn();
    ViewerPlace on_path(double seconds) const;

    MovementStart start_;
    std::mt19937_64 random_;
    ViewerPlace place_;
    double seconds_ = 0;
    double next_turn_seconds_ = 0;
};

}  // namespace terrane
