#include "generator/landscape/river_graph.h"

#include "generator/landscape/numbers.h"
#include "generator/terrain/kernels/landscape_kernels.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/random.h"
#include "generator/world/world_definition.h"
#include "protocol/base/check.h"
#include "protocol/base/coords.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr std::int8_t kSink = -1;
constexpr std::int64_t kMargin =
    kUpstreamSteps + 2;  ///< cells around those whose reaches are known

struct Step {
    std::int64_t i = 0;
    std::int64_t j = 0;
};

/// Neighbour `n` (0..5) of a node in row j: rows with odd numbers stand half a cell further.
Step neighbour(std::int64_t j, int n) {
    const std::int64_t shift = (j & 1) != 0 ? 0 : -1;
    switch (n) {
        case 0:
            return {.i = shift, .j = -1};
        case 1:
            return {.i = shift + 1, .j = -1};
        case 2:
            return {.i = -1, .j = 0};
        case 3:
            return {.i = 1, .j = 0};
        case 4:
            return {.i = shift, .j = 1};
        default:
            return {.i = shift + 1, .j = 1};
    }
}

RiverNode make_node(const RiverConstants& constants, std::int64_t i, std::int64_t j) {
    RiverNode node;
    node.hash = key(constants.seed, LandscapeTag::river_node, i, j);
    const auto inside = [](double u, std::int64_t side) {
        return static_cast<std::int64_t>((0.2 + 0.6 * u) * static_cast<double>(side));
    };
    node.x = i * constants.cell_x + ((j & 1) != 0 ? constants.cell_x / 2 : 0) +
             inside(unit_of(node.hash), constants.cell_x);
    node.z = j * constants.cell_z + inside(unit_of(mix(node.hash + 1)), constants.cell_z);
    const auto chance = static_cast<float>(unit_of(mix(node.hash + 2)) - 0.5);
    node.level = constants.potential_at(node.x, node.z) + 0.12F * constants.fall * chance;
    return node;
}

void shape_reach(Reach& reach, const RiverNode& from, const RiverNode& to) {
    const auto ex = static_cast<float>(to.x - from.x);
    const auto ez = static_cast<float>(to.z - from.z);
    const auto bend = 0.7F * static_cast<float>(unit_of(mix(from.hash + 3)) - 0.5);
    const float mx = 0.5F * ex - bend * ez;  // the normal is as long as the way
    const float mz = 0.5F * ez + bend * ex;
    for (std::size_t p = 0; p <= kReachSegments; ++p) {
        const float t = static_cast<float>(p) / static_cast<float>(kReachSegments);
        const float middle = 2.0F * t * (1.0F - t);
        reach.px[p] = middle * mx + t * t * ex;
        reach.pz[p] = middle * mz + t * t * ez;
    }
    for (std::size_t p = 0; p < kReachSegments; ++p) {
        const float x = reach.px[p + 1] - reach.px[p];
        const float z = reach.pz[p + 1] - reach.pz[p];
        const float square = x * x + z * z;
        reach.inverse_square[p] = square > 0 ? 1.0F / square : 0.0F;
    }
    reach.x_min = *std::min_element(reach.px.begin(), reach.px.end());
    reach.x_max = *std::max_element(reach.px.begin(), reach.px.end());
    reach.z_min = *std::min_element(reach.pz.begin(), reach.pz.end());
    reach.z_max = *std::max_element(reach.pz.begin(), reach.pz.end());
}

/// Finds downstream and accumulation in a rectangle of nodes; they are known but for kMargin.
class NodeGrid {
  public:
    /// Overwrites `nodes`; what `before` holds is not made again.
    NodeGrid(RiverNodes& nodes, const RiverNodes& before, const RiverConstants& constants,
             const CellRange& range)
        : first_i_(range.first_i - kMargin),
          first_j_(range.first_j - kMargin),
          width_(range.last_i - range.first_i + 1 + 2 * kMargin),
          length_(range.last_j - range.first_j + 1 + 2 * kMargin),
          nodes_(nodes.nodes) {
        nodes_.clear();
        nodes_.reserve(static_cast<std::size_t>(width_ * length_));
        const CellRange& known = before.range;
        const std::int64_t known_width = known.last_i - known.first_i + 1;
        for (std::int64_t j = first_j_; j < first_j_ + length_; ++j) {
            for (std::int64_t i = first_i_; i < first_i_ + width_; ++i) {
                if (i < known.first_i || i > known.last_i || j < known.first_j ||
                    j > known.last_j) {
                    nodes_.push_back(make_node(constants, i, j));
                    continue;
                }
                nodes_.push_back(before.nodes[static_cast<std::size_t>(
                    (j - known.first_j) * known_width + (i - known.first_i))]);
                nodes_.back().accumulated = 1;
                nodes_.back().downstream = kSink;
            }
        }
        nodes.range = {.first_i = first_i_,
                       .last_i = first_i_ + width_ - 1,
                       .first_j = first_j_,
                       .last_j = first_j_ + length_ - 1};
        find_downstream();
        for (int step = 0; step < kUpstreamSteps; ++step) {
            accumulate();
        }
    }

    const RiverNode& at(std::int64_t i, std::int64_t j) const {
        return nodes_[index(i - first_i_, j - first_j_)];
    }

    const RiverNode& downstream_of(std::int64_t i, std::int64_t j) const {
        const Step step = neighbour(j, at(i, j).downstream);
        return at(i + step.i, j + step.j);
    }

  private:
    std::size_t index(std::int64_t i, std::int64_t j) const {
        return static_cast<std::size_t>(j * width_ + i);
    }

    void find_downstream() {
        for (std::int64_t j = 1; j + 1 < length_; ++j) {
            for (std::int64_t i = 1; i + 1 < width_; ++i) {
                RiverNode& node = nodes_[index(i, j)];
                float lowest = node.level;
                for (int n = 0; n < 6; ++n) {
                    const Step step = neighbour(first_j_ + j, n);
                    const float level = nodes_[index(i + step.i, j + step.j)].level;
                    if (level < lowest) {
                        lowest = level;
                        node.downstream = static_cast<std::int8_t>(n);
                    }
                }
            }
        }
    }

    void accumulate() {
        std::vector<float> next(nodes_.size(), 1.0F);
        for (std::int64_t j = 1; j + 1 < length_; ++j) {
            for (std::int64_t i = 1; i + 1 < width_; ++i) {
                const RiverNode& node = nodes_[index(i, j)];
                if (node.downstream != kSink) {
                    const Step step = neighbour(first_j_ + j, node.downstream);
                    next[index(i + step.i, j + step.j)] += node.accumulated;
                }
            }
        }
        for (std::size_t n = 0; n < nodes_.size(); ++n) {
            nodes_[n].accumulated = next[n];
        }
    }

    std::int64_t first_i_;
    std::int64_t first_j_;
    std::int64_t width_;
    std::int64_t length_;
    std::vector<RiverNode>& nodes_;
};

}  // namespace

RiverConstants::RiverConstants(const WorldDefinition& definition)
    : cell_x(static_cast<std::int64_t>(definition.relief.valley)),
      cell_z(cell_x * 7 / 8),
      ground(static_cast<float>(definition.relief.ground)),
      fall(static_cast<float>(definition.relief.fall)),
      wander(0.3F * static_cast<float>(cell_x)),
      seed(definition.seed),
      potential(
          Noise::make(key(seed, LandscapeTag::potential), 1.25 * definition.relief.province, 2)),
      wander_x(Noise::make(key(seed, LandscapeTag::warp, 1), 0.6 * definition.relief.valley, 3)),
      wander_z(Noise::make(key(seed, LandscapeTag::warp, 2), 0.6 * definition.relief.valley, 3)) {}

float RiverConstants::potential_at(std::int64_t x, std::int64_t z) const {
    return ground + 1.6F * fall * noise_at(potential, x, z);
}

double RiverConstants::level_max() const {
    return static_cast<double>(ground) + 1.66 * static_cast<double>(fall);
}

std::int64_t RiverConstants::row_of(std::int64_t z) const {
    return floor_div(z, cell_z);
}

std::int64_t RiverConstants::cell_of(std::int64_t x, std::int64_t j) const {
    return floor_div(x - ((j & 1) != 0 ? cell_x / 2 : 0), cell_x);
}

ReachShape shape_of_reach(const Reach& reach) {
    ReachShape shape;
    std::copy(reach.px.begin(), reach.px.end(), shape.px);
    std::copy(reach.pz.begin(), reach.pz.end(), shape.pz);
    std::copy(reach.inverse_square.begin(), reach.inverse_square.end(), shape.inverse_square);
    shape.level = reach.level;
    shape.level_change = reach.level_change;
    return shape;
}

void RiverGraph::build(const RiverConstants& constants, const CellRange& range) {
    if (range == range_ && !reaches_.empty()) {
        return;
    }
    const std::int64_t width = range.last_i - range.first_i + 1;
    const std::int64_t length = range.last_j - range.first_j + 1;
    TERRANE_ASSERT(width > 0 && length > 0 &&
                   static_cast<std::size_t>(width * length) <= kNodesMax);
    // Nothing is known until all is: memory may run out on the way.
    range_ = {};
    reaches_.clear();
    boxes_.clear();
    std::swap(nodes_, before_);
    nodes_.range = {};
    const NodeGrid nodes(nodes_, before_, constants, range);
    for (std::int64_t j = range.first_j; j <= range.last_j; ++j) {
        for (std::int64_t i = range.first_i; i <= range.last_i; ++i) {
            const RiverNode& node = nodes.at(i, j);
            Reach reach;
            reach.x = node.x;
            reach.z = node.z;
            reach.level = node.level;
            reach.measure = std::sqrt(node.accumulated - 1.0F);
            reach.is_sink = node.downstream == kSink;
            if (!reach.is_sink) {
                const RiverNode& next = nodes.downstream_of(i, j);
                reach.level_change = next.level - node.level;
                reach.measure_change = std::sqrt(next.accumulated - 1.0F) - reach.measure;
                shape_reach(reach, node, next);
            }
            reaches_.push_back(reach);
            const auto x = static_cast<float>(reach.x - reaches_.front().x);
            const auto z = static_cast<float>(reach.z - reaches_.front().z);
            boxes_.push_back({.x_min = x + reach.x_min,
                              .x_max = x + reach.x_max,
                              .z_min = z + reach.z_min,
                              .z_max = z + reach.z_max});
        }
    }
    range_ = range;
}

}  // namespace terrane
