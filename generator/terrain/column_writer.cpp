#include "generator/terrain/column_writer.h"

#include "generator/terrain/choose_composition.h"

#include <algorithm>
#include <span>

namespace terrane {
namespace {

constexpr std::uint16_t kNone = 0xffff;

Flow unpack_flow(std::int32_t packed) {
    const auto bits = static_cast<std::uint32_t>(packed);
    return {.x = static_cast<std::int8_t>(bits & 255U),
            .y = static_cast<std::int8_t>((bits >> 8U) & 255U),
            .z = static_cast<std::int8_t>((bits >> 16U) & 255U)};
}

/// Height at which the blend of an interval (bottom, top] ends. `blend` > 0.
std::int32_t blend_top(std::int32_t bottom, std::int32_t top, std::int32_t blend) {
    return bottom + std::min(top - bottom, std::max(1, ((top - bottom) * blend + 128) >> 8));
}

/// One column's rasters.
struct ColumnSource {
    const Region& region;
    std::size_t at = 0;       ///< place in the region's height rasters
    std::size_t flow_at = 0;  ///< place in its flow rasters
    bool has_flow = false;

    std::int32_t y256(std::size_t layer) const {
        return region.y256[layer * region.plane_size() + at];
    }

    float height(std::size_t layer) const {
        return region.heights[layer * region.plane_size() + at];
    }

    Flow flow(std::size_t layer) const {
        return has_flow ? unpack_flow(region.flow[layer * region.flow_plane_size() + flow_at])
                        : Flow{};
    }
};

/// The general walk: elements, pinched layers and materials that are alone.
class ColumnWalk {
  public:
    ColumnWalk(Limit* out, const ColumnSource& source, const std::vector<LayerRules>& rules,
               std::span<std::uint16_t> element_ids)
        : first_(out), out_(out), source_(source), rules_(rules), element_ids_(element_ids) {}

    Limit* write(std::int32_t column, std::int32_t row) {
        const Region& region = source_.region;
        const std::size_t layers = rules_.size();
        const std::uint64_t gaps = region.gap_mask[source_.at];
        for (std::size_t k = 0; k < layers; ++k) {
            layer(k);
            if ((gaps >> k & 1U) == 0) {
                continue;
            }
            const std::size_t end =
                k + 1 < layers ? region.gap_begin[k + 1] : region.elements.size();
            float current = source_.height(k);
            bool first_owner = true;
            for (std::size_t e = end; e > region.gap_begin[k]; --e) {
                const float thickness = thickness_at(region.elements[e - 1], column, row);
                const float top = source_.height(k) + thickness;
                if (thickness > 0 && top > current) {
                    element(e - 1, k, top, first_owner);
                    first_owner = false;
                    current = top;
                }
            }
        }
        add(bottom_, static_cast<std::uint16_t>(layers), {});
        return out_;
    }

  private:
    void layer(std::size_t k) {
        const std::int32_t top = source_.y256(k);
        if (top <= bottom_) {
            return;
        }
        const LayerRules& rule = rules_[k];
        const bool blends = from_ != kNone && rule.blend > 0 && !rule.alone && !rules_[from_].alone;
        interval(top, static_cast<std::uint16_t>(k), source_.flow(k), blends ? rule.blend : 0);
        from_ = static_cast<std::uint16_t>(k);
    }

    void element(std::size_t e, std::size_t k, float height, bool first_owner) {
        const std::int32_t top = static_cast<std::int32_t>(height * 256.0F + 0.5F);
        if (top <= bottom_) {
            return;
        }
        const Element& own = source_.region.elements[e].element();
        const bool is_cave = own.type == ElementType::cave;
        const bool blends = first_owner && from_ != kNone && own.blend > 0 && !is_cave &&
                            !own.content.alone && !rules_[from_].alone;
        const auto id = static_cast<std::uint16_t>(rules_.size() + 1 + e);
        element_ids_[e] = 0;
        interval(top, id, is_cave ? Flow{} : source_.flow(k), blends ? own.blend : 0);
    }

    void interval(std::int32_t top, std::uint16_t id, Flow flow, std::int32_t blend) {
        if (blend > 0) {
            add(bottom_, from_, source_.flow(from_));
            add(blend_top(bottom_, top, blend), id, flow);
        } else {
            add(bottom_, id, flow);
        }
        add(top, id, flow);
        bottom_ = top;
    }

    void add(std::int32_t y256, std::uint16_t id, Flow flow) {
        if (out_ != first_ && out_[-1].y256 == y256 && out_[-1].palette_id == id) {
            return;
        }
        *out_++ = {.y256 = y256, .palette_id = id, .flow = flow};
    }

    float thickness_at(const PlacedElement& placed, std::int32_t column, std::int32_t row) const {
        const std::int32_t x = column - placed.column_first;
        const std::int32_t z = row - placed.row_first;
        if (x < 0 || z < 0 || x >= placed.columns || z >= placed.rows) {
            return 0;
        }
        return source_.region
            .thickness[placed.raster + static_cast<std::size_t>(z * placed.stride + x)];
    }

    Limit* first_;
    Limit* out_;
    const ColumnSource& source_;
    const std::vector<LayerRules>& rules_;
    std::span<std::uint16_t> element_ids_;  ///< kNone, or 0 once the element owns a limit
    std::int32_t bottom_ = 0;
    std::uint16_t from_ = kNone;  ///< the last layer with something of its own below
};

/// Gives the elements that own limits the ids after the void, in their order. `element_ids` says
/// which do, and gets the ids.
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
            const ColumnSource source{
                .region = region_,
                .at = static_cast<std::size_t>((z_ + 1) * region_.shape.stride() + x + 1),
                .flow_at = has_flow ? static_cast<std::size_t>(z_ * region_.flow_stride + x) : 0,
                .has_flow = has_flow};
            out = ColumnWalk(out, source, rules_, element_ids_).write(x + 1, z_ + 1);
            *end_of++ = static_cast<std::uint32_t>(out - base);
            ++x;
        }
        return out;
    }

  private:
    const Region& region_;
    const std::vector<LayerRules>& rules_;
    const RowKernels& kernels_;
    std::span<std::uint16_t> element_ids_;
    std::int32_t z_;
    PlainRow plain_;
    const std::uint8_t* irregular_ = nullptr;
};

/// The highest limit of the inner columns: what is void above it is void for ever.
std::int32_t highest_limit(const ColumnGrid& grid, std::int32_t apron) {
    std::int32_t highest = 0;
    for (std::int32_t z = 0; z < grid.length - 2 * apron; ++z) {
        for (std::int32_t x = 0; x < grid.width - 2 * apron; ++x) {
            const std::uint32_t end = grid.offsets[grid.index_of(x, z) + 1];
            highest = std::max(highest, grid.limits[end - 1].y256);
        }
    }
    return highest;
}

}  // namespace

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
    out.highest_y256 = highest_limit(grid, apron);
    number_elements(out, region, world);
}

}  // namespace terrane
