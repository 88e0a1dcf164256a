// Rivers as maps draw them: how far each column is from the nearest one that has water.
//
// From above, a river that is narrower than what is seen of the land at once would break into
// dashes. Distances are those of the channels; how rivers wind is asked column by column instead of
// from the relief's lattice, a column's difference at most.
#pragma once

#include "generator/landscape/channels.h"
#include "generator/landscape/relief.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/world.h"

#include <span>
#include <vector>

namespace terrane {

/// Belongs to one thread at a time.
class RiverMap {
  public:
    explicit RiverMap(const World& world);

    /// Per column of `shape`, with its stride: columns from the edge of a river's water, 0 in it.
    /// Beyond `within` columns it is at least that. Valid until the next call.
    std::span<const float> distances(const RectangleShape& shape, float within);

  private:
    bool has_rivers_;
    ReliefConstants relief_;
    ChannelConstants channels_;
    ReliefBuilder builder_;
    ReliefRasters wander_;
    NoiseBuffers noise_;
    std::vector<NearReach> near_;
    std::vector<float> distances_;
};

}  // namespace terrane
