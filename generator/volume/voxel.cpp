#include "generator/volume/voxel.h"

#include "generator/volume/chunk.h"
#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "protocol/base/check.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

namespace terrane {
namespace {

/// Walks up a column: after seek(y), `lo` is the last limit at or below y (the first if none is)
/// and `share` how far y is on the way to `hi`.
class ColumnWalk {
  public:
    explicit ColumnWalk(std::span<const Limit> column) : column_(column) {
        TERRANE_ASSERT(!column.empty());
    }

    /// Heights may only grow from call to call.
    void seek(std::int64_t y256) {
        while (index_ + 1 < column_.size() && column_[index_ + 1].y256 <= y256) {
            ++index_;
        }
        const std::int64_t below = column_[index_].y256;
        if (index_ + 1 == column_.size() || y256 <= below) {
            share_ = 0;
            return;
        }
        const std::int64_t above = column_[index_ + 1].y256;
        share_ = static_cast<double>(y256 - below) / static_cast<double>(above - below);
    }

    const Limit& lo() const { return column_[index_]; }

    const Limit& hi() const { return column_[std::min(index_ + 1, column_.size() - 1)]; }

    double share() const { return share_; }

  private:
    std::span<const Limit> column_;
    std::size_t index_ = 0;
    double share_ = 0;
};

void add_share(Voxel& voxel, std::uint16_t material, double concentration) {
    for (std::size_t i = 0; i < voxel.count; ++i) {
        if (voxel.storage[i].material == material) {
            voxel.storage[i].concentration += concentration;
            return;
        }
    }
    voxel.storage[voxel.count++] = {.material = material, .concentration = concentration};
}

std::int8_t mix_flow(std::int8_t lo, std::int8_t hi, double share) {
    return static_cast<std::int8_t>(std::round(lo * (1 - share) + hi * share));
}

Voxel voxel_of_walk(const ColumnWalk& walk, const Palette& palette) {
    Voxel voxel;
    const double share = walk.share();
    const Limit& lo = walk.lo();
    const Limit& hi = walk.hi();
    const Composition& below = palette[lo.palette_id].composition;
    const Composition& above = palette[hi.palette_id].composition;
    // Equal ends are copied: (1 - t) + t need not be 1 in double.
    const bool mixed = share > 0 && lo.palette_id != hi.palette_id && below != above;
    for (const Share& part : below.shares()) {
        add_share(voxel, part.material,
                  mixed ? part.concentration * (1 - share) : part.concentration);
    }
    for (std::size_t i = 0; mixed && i < above.count; ++i) {
        add_share(voxel, above.storage[i].material, above.storage[i].concentration * share);
    }
    voxel.flow = {.x = mix_flow(lo.flow.x, hi.flow.x, share),
                  .y = mix_flow(lo.flow.y, hi.flow.y, share),
                  .z = mix_flow(lo.flow.z, hi.flow.z, share)};
    return voxel;
}

std::int64_t center_of(std::int64_t y) {
    return y * kUnitsPerVoxel + kUnitsPerVoxel / 2;
}

}  // namespace

bool operator==(const Voxel& a, const Voxel& b) {
    return a.flow == b.flow && std::ranges::equal(a.shares(), b.shares());
}

Voxel voxel_at(std::span<const Limit> column, const Palette& palette, std::int64_t y) {
    ColumnWalk walk(column);
    walk.seek(center_of(y));
    return voxel_of_walk(walk, palette);
}

void expand_column(std::span<Voxel> out, std::span<const Limit> column, const Palette& palette,
                   std::int64_t y_first) {
    ColumnWalk walk(column);
    std::int64_t y = y_first;
    for (Voxel& voxel : out) {
        walk.seek(center_of(y++));
        voxel = voxel_of_walk(walk, palette);
    }
}

Voxel voxel_of(const Chunk& chunk, std::int32_t x, std::int32_t y, std::int32_t z) {
    if (chunk.uniform) {
        Voxel voxel;
        for (const Share& part : chunk.uniform_content.composition.shares()) {
            add_share(voxel, part.material, part.concentration);
        }
        return voxel;
    }
    const std::int64_t floor = std::int64_t{chunk.position.y} * chunk.height;
    return voxel_at(chunk.columns.column(x, z), chunk.palette, floor + y);
}

LinearColor color_at(std::span<const Limit> column, std::span<const LinearColor> colors,
                     std::int64_t y256) {
    ColumnWalk walk(column);
    walk.seek(y256);
    const LinearColor lo = colors[walk.lo().palette_id];
    const LinearColor hi = colors[walk.hi().palette_id];
    const auto share = static_cast<float>(walk.share());
    return {.r = lo.r + (hi.r - lo.r) * share,
            .g = lo.g + (hi.g - lo.g) * share,
            .b = lo.b + (hi.b - lo.b) * share};
}

}  // namespace terrane
