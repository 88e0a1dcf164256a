#include "generator/terrain/column_writer.h"

#include "generator/terrain/element.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/region.h"
#include "generator/terrain/world.h"
#include "generator/volume/limit.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

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
    const std::int32_t* middle = nullptr;
    const float* height = nullptr;
    const std::int32_t* flow = nullptr;  ///< packed; of no flow, a zero
    std::ptrdiff_t plane = 0;
    std::ptrdiff_t flow_plane = 0;
    std::uint64_t gaps = 0;  ///< bit g: an element stands in gap g
    bool layers_regular = false;
    std::int32_t column = 0;
    std::int32_t row = 0;

    std::int32_t y256_of(std::size_t layer) const {
        return y256[static_cast<std::ptrdiff_t>(layer) * plane];
    }

    std::int32_t flow_of(std::size_t layer) const {
        return flow[static_cast<std::ptrdiff_t>(layer) * flow_plane];
    }
};

/// Where elements own limits, to give these their ids later.
struct ElementUse {
    std::span<std::uint16_t> ids;        ///< kNone, or 0 once the element owns a limit
    std::vector<std::uint32_t>& limits;  ///< their numbers, ascending
    const Limit* base;                   ///< of limit 0
};

/// The general walk: elements, pinched layers and materials that are alone.
class ColumnWalk {
  public:
    ColumnWalk(const ColumnSource& source, const std::vector<LayerRules>& rules,
               const ElementUse& elements)
        : source_(source), rules_(rules), elements_(elements) {}

    Limit* write(Limit* out) const {
        const std::size_t layers = rules_.size();
        State state{.out = out};
        for (std::size_t k = 0; k < layers; ++k) {
            if (source_.layers_regular && !state.on_element) {
                // Up to the next gap with an element all is as where there are none.
                const auto plain = static_cast<std::size_t>(std::countr_zero(source_.gaps >> k));
                const std::size_t last = std::min(k + plain, layers - 1);
                state = with_regular_layers(state, k, last);
                k = last;
            } else if (source_.y256_of(k) > state.bottom) {
                state = with_layer(state, source_.y256_of(k), rules_[k],
                                   tail_of(k, source_.flow_of(k)));
            }
            if ((source_.gaps >> k & 1U) != 0) {
                state = with_elements(state, k);
            }
        }
        put(state.out++, state.bottom, tail_of(layers, 0));
        return state.out;
    }

  private:
    /// How far the walk is; handed on by value, so that it stays in registers.
    struct State {
        Limit* out = nullptr;
        std::int32_t bottom = 0;
        bool below_alone = false;
        bool on_element = false;  ///< the last limit shows an element, not the layer below
        std::uint64_t below = 0;  ///< tail of the last layer with something of its own below
    };

    /// Layers first..last, each on the one right below it.
    State with_regular_layers(State state, std::size_t first, std::size_t last) const {
        const auto at = static_cast<std::ptrdiff_t>(first) * source_.plane;
        const std::int32_t* y256 = source_.y256 + at;
        const std::int32_t* middle = source_.middle + at;
        const std::int32_t* flow =
            source_.flow + static_cast<std::ptrdiff_t>(first) * source_.flow_plane;
        Limit* out = state.out;
        std::uint64_t tail = 0;
        for (std::size_t k = first; k <= last; ++k) {
            tail = tail_of(k, *flow);
            put(out, *middle, tail);
            put(out + 1, *y256, tail);
            out += 2;
            y256 += source_.plane;
            middle += source_.plane;
            flow += source_.flow_plane;
        }
        return {.out = out,
                .bottom = y256[-source_.plane],
                .below_alone = rules_[last].alone,
                .below = tail};
    }

    static State with_layer(State state, std::int32_t top, const LayerRules& rule,
                            std::uint64_t tail) {
        const std::int32_t blend = state.below_alone || rule.alone ? 0 : rule.blend;
        if (state.bottom == 0) {
            put(state.out++, 0, tail);
        } else if (!state.on_element) {
            state.out = blend_or_frontier(state, top, blend, tail);
        } else {  // what is below shows the element: begin anew
            put(state.out++, state.bottom, blend > 0 ? state.below : tail);
            if (blend > 0) {
                state.out = blend_or_frontier(state, top, blend, tail);
            }
        }
        put(state.out++, top, tail);
        return {.out = state.out, .bottom = top, .below_alone = rule.alone, .below = tail};
    }

    /// The limit where `tail` alone begins to be shown; left out if that is only at its top.
    static Limit* blend_or_frontier(State state, std::int32_t top, std::int32_t blend,
                                    std::uint64_t tail) {
        const std::int32_t thickness = top - state.bottom;
        const std::int32_t part = std::max(blend > 0 ? 1 : 0, (thickness * blend + 128) >> 8);
        put(state.out, state.bottom + part, tail);
        return state.out + (part < thickness ? 1 : 0);
    }

    /// The elements of gap k, last first: each owns what rises above those before it.
    State with_elements(State state, std::size_t k) const {
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
                const auto top256 = static_cast<std::int32_t>(std::floor(top * 256.0F + 0.5F));
                if (top256 > state.bottom) {
                    state = with_element(state, e - 1, k, top256, first_owner);
                }
                first_owner = false;
                current = top;
            }
        }
        return state;
    }

    State with_element(State state, std::size_t e, std::size_t k, std::int32_t top,
                       bool first_owner) const {
        const Element& own = source_.region.elements[e].element();
        const bool is_cave = own.type == ElementType::cave;
        const bool blends = first_owner && own.blend > 0 && !state.below_alone;
        const std::uint64_t tail = tail_of(rules_.size() + 1 + e, is_cave ? 0 : source_.flow_of(k));
        if (blends && state.on_element) {
            put(state.out++, state.bottom, state.below);
        }
        const Limit* const first = state.out;
        if (blends) {
            state.out = blend_or_frontier(state, top, own.blend, tail);
        } else {
            put(state.out++, state.bottom, tail);
        }
        put(state.out++, top, tail);
        elements_.ids[e] = 0;
        for (const Limit* limit = first; limit != state.out; ++limit) {
            elements_.limits.push_back(static_cast<std::uint32_t>(limit - elements_.base));
        }
        state.bottom = top;
        state.on_element = true;
        return state;
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

    const ColumnSource& source_;
    const std::vector<LayerRules>& rules_;
    const ElementUse& elements_;
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
              const ElementUse& elements, std::int32_t z)
        : region_(region), rules_(rules), kernels_(kernels), elements_(elements), z_(z) {
        const auto shape_row = static_cast<std::ptrdiff_t>(z + 1) * region.shape.stride();
        plain_.y256 = region.y256.data() + shape_row;
        plain_.middle = region.middle.data() + shape_row;
        plain_.plane = static_cast<std::int64_t>(region.plane_size());
        plain_.flow_plane = static_cast<std::int64_t>(region.flow_plane_size());
        plain_.layers = static_cast<std::int32_t>(rules.size());
        irregular_ = region.irregular.data() + shape_row;
    }

    /// Columns first <= x < end; `end_of` gets where each one's limits end.
    Limit* write(Limit* out, std::int32_t first, std::int32_t end, bool has_flow,
                 std::uint32_t* end_of) {
        const Limit* const base = elements_.base;
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
            out = ColumnWalk(source_at(x, has_flow), rules_, elements_).write(out);
            *end_of++ = static_cast<std::uint32_t>(out - base);
            ++x;
        }
        return out;
    }

  private:
    ColumnSource source_at(std::int32_t x, bool has_flow) const {
        static constexpr std::int32_t kNoFlow = 0;
        const std::size_t at = region_.shape.index(x + 1, z_ + 1);
        return {.region = region_,
                .y256 = region_.y256.data() + at,
                .middle = region_.middle.data() + at,
                .height = region_.heights.data() + at,
                .flow = has_flow ? plain_.flow + x + 1 : &kNoFlow,
                .plane = static_cast<std::ptrdiff_t>(plain_.plane),
                .flow_plane = has_flow ? static_cast<std::ptrdiff_t>(plain_.flow_plane) : 0,
                .gaps = region_.gap_mask[at],
                .layers_regular = region_.irregular[at] == kElementStands,
                .column = x + 1,
                .row = z_ + 1};
    }

    const Region& region_;
    const std::vector<LayerRules>& rules_;
    const RowKernels& kernels_;
    const ElementUse& elements_;
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
    for (const std::uint32_t i : out.element_limits) {
        std::uint16_t& id = out.grid.limits[i].palette_id;
        id = out.element_ids[id - first_id];
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
    out.element_limits.clear();
    std::size_t used = 0;
    std::uint32_t* end_of = grid.offsets.data() + 1;
    for (std::int32_t z = -apron; z < length + apron; ++z) {
        if (grid.limits.size() < used + row_limits_max) {
            grid.limits.resize(std::max(used + row_limits_max, 2 * grid.limits.size()));
        }
        Limit* const base = grid.limits.data();
        Limit* at = base + used;
        const ElementUse elements{
            .ids = out.element_ids, .limits = out.element_limits, .base = base};
        RowWriter row(region, constants.rules, kernels, elements, z);
        if (z < 0 || z >= length) {
            at = row.write(at, -apron, width + apron, false, end_of);
        } else {
            at = row.write(at, -apron, 0, false, end_of);
            at = row.write(at, 0, width, true, end_of + apron);
            at = row.write(at, width, width + apron, false, end_of + apron + width);
        }
        end_of += row_columns;
        used = static_cast<std::size_t>(at - base);
    }
    grid.limits.resize(used);
    out.highest_y256 = highest_limit(region, constants.rules.size());
    number_elements(out, region, world);
}

}  // namespace terrane
