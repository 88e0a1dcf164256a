#include "generator/terrain/column_writer.h"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>

namespace terrane {
namespace {

constexpr std::uint16_t kNone = kNoPaletteId;

/// Palette id and flow as they lie in a limit behind its height.
std::uint64_t tail_of(std::size_t id, std::int32_t packed_flow) {
    return id | std::uint64_t{static_cast<std::uint32_t>(packed_flow)} << 16U;
}

void put(Limit* to, std::int32_t y256, std::uint64_t tail) {
    static_assert(sizeof(Limit) == sizeof y256 + sizeof tail && offsetof(Limit, palette_id) == 4 &&
                  offsetof(Limit, flow) == 6);
    std::memcpy(static_cast<void*>(to), &y256, sizeof y256);
    std::memcpy(&to->palette_id, &tail, sizeof tail);
}

/// One column's rasters: layer k's values lie k planes further.
struct ColumnSource {
    const Region& region;
    const std::int32_t* y256 = nullptr;
    const float* height = nullptr;
    const std::int32_t* flow = nullptr;  ///< packed; of no flow, a zero
    std::ptrdiff_t plane = 0;
    std::ptrdiff_t flow_plane = 0;
    std::uint64_t gaps = 0;  ///< bit g: an element stands in gap g
    std::int32_t column = 0;
    std::int32_t row = 0;

    std::int32_t flow_of(std::size_t layer) const {
        return flow[static_cast<std::ptrdiff_t>(layer) * flow_plane];
    }
};

/// The general walk: elements, pinched layers and materials that are alone.
class ColumnWalk {
  public:
    ColumnWalk(Limit* out, const ColumnSource& source, const std::vector<LayerRules>& rules,
               std::span<std::uint16_t> element_ids)
        : out_(out), source_(source), rules_(rules), element_ids_(element_ids) {}

    Limit* write() {
        const std::size_t layers = rules_.size();
        const std::int32_t* y256 = source_.y256;
        const std::int32_t* flow = source_.flow;
        for (std::size_t k = 0; k < layers; ++k) {
            if (*y256 > bottom_) {
                layer(*y256, k, tail_of(k, *flow));
            }
            if ((source_.gaps >> k & 1U) != 0) {
                elements(k);
            }
            y256 += source_.plane;
            flow += source_.flow_plane;
        }
        put(out_++, bottom_, tail_of(layers, 0));
        return out_;
    }

  private:
    void layer(std::int32_t top, std::size_t k, std::uint64_t tail) {
        const LayerRules& rule = rules_[k];
        const std::int32_t blend = below_alone_ || rule.alone ? 0 : rule.blend;
        if (bottom_ == 0) {
            put(out_++, 0, tail);
        } else {
            if (on_element_) {  // what is below shows the element: begin anew
                put(out_++, bottom_, blend > 0 ? below_ : tail);
            }
            if (blend > 0 || !on_element_) {
                blend_or_frontier(top, blend, tail);
            }
        }
        put(out_++, top, tail);
        bottom_ = top;
        below_ = tail;
        below_alone_ = rule.alone;
        on_element_ = false;
    }

    /// The limit where `tail` alone begins to be shown; left out if that is only at its top.
    void blend_or_frontier(std::int32_t top, std::int32_t blend, std::uint64_t tail) {
        const std::int32_t thickness = top - bottom_;
        const std::int32_t part = std::max(blend > 0 ? 1 : 0, (thickness * blend + 128) >> 8);
        put(out_, bottom_ + part, tail);
        out_ += part < thickness ? 1 : 0;
    }

    /// The elements of gap k, last first: each owns what rises above those before it.
    void elements(std::size_t k) {
        const Region& region = source_.region;
        const std::size_t end =
            k + 1 < rules_.size() ? region.gap_begin[k + 1] : region.elements.size();
        const float height = source_.height[static_cast<std::ptrdiff_t>(k) * source_.plane];
        float current = height;
        bool first_owner = true;
        for (std::size_t e = end; e > region.gap_begin[k]; --e) {
            const float thickness = thickness_at(region.elements[e - 1]);
            const float top = height + thickness;
            if (thickness > 0 && top > current) {
                element(e - 1, k, static_cast<std::int32_t>(top * 256.0F + 0.5F), first_owner);
                first_owner = false;
                current = top;
            }
        }
    }

    void element(std::size_t e, std::size_t k, std::int32_t top, bool first_owner) {
        if (top <= bottom_) {
            return;
        }
        const Element& own = source_.region.elements[e].element();
        const bool is_cave = own.type == ElementType::cave;
        const bool blends = first_owner && own.blend > 0 && !below_alone_;
        const std::uint64_t tail = tail_of(rules_.size() + 1 + e, is_cave ? 0 : source_.flow_of(k));
        element_ids_[e] = 0;
        if (blends) {
            if (on_element_) {
                put(out_++, bottom_, below_);
            }
            blend_or_frontier(top, own.blend, tail);
        } else {
            put(out_++, bottom_, tail);
        }
        put(out_++, top, tail);
        bottom_ = top;
        on_element_ = true;
    }

    float thickness_at(const PlacedElement& placed) const {
        const std::int32_t x = source_.column - placed.column_first;
        const std::int32_t z = source_.row - placed.row_first;
        if (x < 0 || z < 0 || x >= placed.columns || z >= placed.rows) {
            return 0;
        }
        return source_.region
            .thickness[placed.raster + static_cast<std::size_t>(z * placed.stride + x)];
    }

    Limit* out_;
    const ColumnSource& source_;
    const std::vector<LayerRules>& rules_;
    std::span<std::uint16_t> element_ids_;  ///< kNone, or 0 once the element owns a limit
    std::int32_t bottom_ = 0;
    std::uint64_t below_ = 0;  ///< tail of the last layer with something of its own below
    bool below_alone_ = false;
    bool on_element_ = false;  ///< the last limit shows an element, not that layer
};

/// Limits a column can have at most: two a layer and one where it begins, three an element, the
/// void's.
std::size_t column_limits_max(const Region& region, std::size_t layers) {
    return 3 * layers + 3 * region.elements.size() + 1;
}

/// One row of columns, run by run.
class RowWriter {
  public:
    RowWriter(const Region& region, const std::vector<LayerRules>& rules, const RowKernels& kernels,
              std::span<std::uint16_t> element_ids, std::int32_t z)
        : region_(region), rules_(rules), kernels_(kernels), element_ids_(element_ids), z_(z) {
        const auto shape_row = static_cast<std::ptrdiff_t>(z + 1) * region.shape.stride();
        plain_.y256 = region.y256.data() + shape_row;
        plain_.middle = region.middle.data() + shape_row;
        plain_.plane = static_cast<std::int64_t>(region.plane_size());
        plain_.flow_plane = static_cast<std::int64_t>(region.flow_plane_size());
        plain_.layers = static_cast<std::int32_t>(rules.size());
        irregular_ = region.irregular.data() + shape_row;
    }

    /// Columns first <= x < end; `end_of` gets where each one's limits end, counted from `base`.
    Limit* write(Limit* out, std::int32_t first, std::int32_t end, bool has_flow,
                 std::uint32_t* end_of, const Limit* base) {
        if (has_flow) {
            plain_.flow =
                region_.flow.data() + static_cast<std::ptrdiff_t>(z_) * region_.flow_stride - 1;
        } else {
            plain_.flow = nullptr;
        }
        const std::int32_t plain_limits = 2 * plain_.layers + 1;
        for (std::int32_t x = first; x < end;) {
            std::int32_t stop = x;
            while (stop < end && irregular_[stop + 1] == 0) {
                ++stop;
            }
            if (stop > x) {
                kernels_.plain_columns(out, plain_, x + 1, stop - x);
                for (; x < stop; ++x) {
                    out += plain_limits;
                    *end_of++ = static_cast<std::uint32_t>(out - base);
                }
                continue;
            }
            out = ColumnWalk(out, source_at(x, has_flow), rules_, element_ids_).write();
            *end_of++ = static_cast<std::uint32_t>(out - base);
            ++x;
        }
        return out;
    }

  private:
    ColumnSource source_at(std::int32_t x, bool has_flow) const {
        static constexpr std::int32_t kNoFlow = 0;
        const auto at = static_cast<std::size_t>((z_ + 1) * region_.shape.stride() + x + 1);
        return {.region = region_,
                .y256 = region_.y256.data() + at,
                .height = region_.heights.data() + at,
                .flow = has_flow ? plain_.flow + x + 1 : &kNoFlow,
                .plane = static_cast<std::ptrdiff_t>(plain_.plane),
                .flow_plane = has_flow ? static_cast<std::ptrdiff_t>(plain_.flow_plane) : 0,
                .gaps = region_.gap_mask[at],
                .column = x + 1,
                .row = z_ + 1};
    }

    const Region& region_;
    const std::vector<LayerRules>& rules_;
    const RowKernels& kernels_;
    std::span<std::uint16_t> element_ids_;
    std::int32_t z_;
    PlainRow plain_;
    const std::uint8_t* irregular_ = nullptr;
};

/// The highest limit of the inner columns: the last layer's top, since no layer lies below what it
/// rests on. What is void above it is void for ever.
std::int32_t highest_limit(const Region& region, std::size_t layers) {
    std::int32_t highest = 0;
    for (std::int32_t z = 1; z <= region.inner.length; ++z) {
        const std::int32_t* const row = region.y256.data() + (layers - 1) * region.plane_size() +
                                        static_cast<std::ptrdiff_t>(z) * region.shape.stride() + 1;
        for (std::int32_t x = 0; x < region.inner.width; ++x) {
            highest = std::max(highest, row[x]);
        }
    }
    return highest;
}

}  // namespace

void number_elements(const ColumnWriterOutput& out, const Region& region, const World& world) {
    const std::size_t first_id = world.base_palette.size();
    out.palette.assign(world.base_palette.begin(), world.base_palette.end());
    bool all_used = true;
    for (std::size_t e = 0; e < region.elements.size(); ++e) {
        if (out.element_ids[e] == kNone) {
            all_used = false;
            continue;
        }
        out.element_ids[e] = static_cast<std::uint16_t>(out.palette.size());
        out.palette.push_back(region.elements[e].element().content);
    }
    if (all_used) {
        return;
    }
    for (Limit& limit : out.grid.limits) {
        if (limit.palette_id >= first_id) {
            limit.palette_id = out.element_ids[limit.palette_id - first_id];
        }
    }
}

void write_columns(const ColumnWriterOutput& out, const Region& region, const World& world,
                   const TerrainConstants& constants, std::int32_t apron,
                   const RowKernels& kernels) {
    ColumnGrid& grid = out.grid;
    const std::int32_t width = region.inner.width;
    const std::int32_t length = region.inner.length;
    grid.x_first = -apron;
    grid.z_first = -apron;
    grid.width = width + 2 * apron;
    grid.length = length + 2 * apron;
    const auto row_columns = static_cast<std::size_t>(grid.width);
    grid.offsets.resize(row_columns * static_cast<std::size_t>(grid.length) + 1);
    grid.offsets[0] = 0;
    const std::size_t row_limits_max =
        row_columns * column_limits_max(region, constants.rules.size());
    out.element_ids.assign(region.elements.size(), kNone);
    std::size_t used = 0;
    std::uint32_t* end_of = grid.offsets.data() + 1;
    for (std::int32_t z = -apron; z < length + apron; ++z) {
        if (grid.limits.size() < used + row_limits_max) {
            grid.limits.resize(std::max(used + row_limits_max, 2 * grid.limits.size()));
        }
        Limit* const base = grid.limits.data();
        Limit* at = base + used;
        RowWriter row(region, constants.rules, kernels, out.element_ids, z);
        if (z < 0 || z >= length) {
            at = row.write(at, -apron, width + apron, false, end_of, base);
        } else {
            at = row.write(at, -apron, 0, false, end_of, base);
            at = row.write(at, 0, width, true, end_of + apron, base);
            at = row.write(at, width, width + apron, false, end_of + apron + width, base);
        }
        end_of += row_columns;
        used = static_cast<std::size_t>(at - base);
    }
    grid.limits.resize(used);
    out.highest_y256 = highest_limit(region, constants.rules.size());
    number_elements(out, region, world);
}

}  // namespace terrane
