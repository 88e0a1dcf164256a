#include "generator/terrain/column_writer.h"

#include "generator/terrain/choose_composition.h"

#include <algorithm>

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

/// A column without elements: per layer two limits at most, written unconditionally and kept by
/// moving the end; no branch depends on the data.
Limit* write_plain_column(Limit* out, const ColumnSource& source, const ColumnRules& rules) {
    std::int32_t bottom = source.y256(0);
    const Flow base_flow = source.flow(0);
    *out++ = {.y256 = 0, .palette_id = 0, .flow = base_flow};
    *out++ = {.y256 = bottom, .palette_id = 0, .flow = base_flow};
    const std::size_t layers = rules.layers.size();
    for (std::size_t k = 1; k < layers; ++k) {
        const std::int32_t top = source.y256(k);
        const std::int32_t blend = rules.layers[k].blend_on_below;
        const std::int32_t least = blend > 0 ? 1 : 0;
        const std::int32_t middle =
            bottom + std::min(top - bottom, std::max(least, ((top - bottom) * blend + 128) >> 8));
        const auto id = static_cast<std::uint16_t>(k);
        const Flow flow = source.flow(k);
        const bool stands = top > bottom;
        *out = {.y256 = middle, .palette_id = id, .flow = flow};
        out += (stands && middle < top) ? 1 : 0;
        *out = {.y256 = top, .palette_id = id, .flow = flow};
        out += stands ? 1 : 0;
        bottom = std::max(bottom, top);
    }
    *out++ = {.y256 = bottom, .palette_id = static_cast<std::uint16_t>(layers), .flow = {}};
    return out;
}

/// The general walk: elements, pinched layers and materials that are alone.
class ColumnWalk {
  public:
    ColumnWalk(Limit* out, const ColumnSource& source, const ColumnRules& rules)
        : first_(out), out_(out), source_(source), rules_(rules) {}

    Limit* write(std::int32_t column, std::int32_t row) {
        const Region& region = source_.region;
        const std::size_t layers = rules_.layers.size();
        for (std::size_t k = 0; k < layers; ++k) {
            layer(k);
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
        const LayerRules& rule = rules_.layers[k];
        const bool blends =
            from_ != kNone && rule.blend > 0 && !rule.alone && !rules_.layers[from_].alone;
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
                            !own.content.alone && !rules_.layers[from_].alone;
        const auto id = static_cast<std::uint16_t>(rules_.layers.size() + 1 + e);
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
    const ColumnRules& rules_;
    std::int32_t bottom_ = 0;
    std::uint16_t from_ = kNone;  ///< the last layer with something of its own below
};

/// Gives the elements that own limits the ids after the void, in their order.
void number_elements(const ColumnWriterOutput& out, const Region& region, const World& world) {
    const std::size_t first_id = world.base_palette.size();
    out.palette.assign(world.base_palette.begin(), world.base_palette.end());
    if (region.elements.empty()) {
        return;
    }
    out.element_ids.assign(region.elements.size(), kNone);
    for (const Limit& limit : out.grid.limits) {
        if (limit.palette_id >= first_id) {
            out.element_ids[limit.palette_id - first_id] = 0;
        }
    }
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

}  // namespace

ColumnRules::ColumnRules(const World& world) {
    for (const Layer& layer : world.stack.layers) {
        layers.push_back({.blend = layer.alone ? 0 : blend256(layer.blend), .alone = layer.alone});
        any_alone = any_alone || layer.alone;
    }
    for (std::size_t k = 1; k < layers.size(); ++k) {
        layers[k].blend_on_below = layers[k - 1].alone ? 0 : layers[k].blend;
    }
}

void write_columns(const ColumnWriterOutput& out, const Region& region, const World& world,
                   const ColumnRules& rules, std::int32_t apron) {
    ColumnGrid& grid = out.grid;
    grid.x_first = -apron;
    grid.z_first = -apron;
    grid.width = region.inner.width + 2 * apron;
    grid.length = region.inner.length + 2 * apron;
    const auto columns =
        static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.length);
    grid.offsets.resize(columns + 1);
    grid.offsets[0] = 0;
    // Two limits a layer and three an element at most, the base's two and the void's.
    const std::size_t column_limits_max =
        2 * rules.layers.size() + 3 * (region.elements.size() + 1) + rules.layers.size();
    std::size_t used = 0;
    std::size_t column_index = 0;
    out.highest_y256 = 0;
    for (std::int32_t z = -apron; z < region.inner.length + apron; ++z) {
        const std::size_t row_limits = column_limits_max * static_cast<std::size_t>(grid.width);
        if (grid.limits.size() < used + row_limits) {
            grid.limits.resize(std::max(used + row_limits, 2 * grid.limits.size()));
        }
        for (std::int32_t x = -apron; x < region.inner.width + apron; ++x) {
            const bool inner =
                x >= 0 && z >= 0 && x < region.inner.width && z < region.inner.length;
            const ColumnSource source{
                .region = region,
                .at = static_cast<std::size_t>((z + 1) * region.shape.stride() + x + 1),
                .flow_at = inner ? static_cast<std::size_t>(z * region.flow_stride + x) : 0,
                .has_flow = inner};
            Limit* const begin = grid.limits.data() + used;
            Limit* const end = region.has_element[source.at] != 0 || rules.any_alone
                                   ? ColumnWalk(begin, source, rules).write(x + 1, z + 1)
                                   : write_plain_column(begin, source, rules);
            used += static_cast<std::size_t>(end - begin);
            grid.offsets[++column_index] = static_cast<std::uint32_t>(used);
            if (inner) {
                out.highest_y256 = std::max(out.highest_y256, end[-1].y256);
            }
        }
    }
    grid.limits.resize(used);
    number_elements(out, region, world);
}

}  // namespace terrane
