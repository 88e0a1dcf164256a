#include "generator/terrain/element.h"

#include "generator/terrain/choose_composition.h"
#include "generator/terrain/layer_stack.h"
#include "generator/terrain/random.h"
#include "generator/terrain/world.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <tuple>
#include <vector>

namespace terrane {
namespace {

struct ElementPlace {
    PlotPos plot;
    ElementType type = ElementType::vein;
    std::int32_t number = 0;
    std::int32_t origin_gap = -1;  ///< given in the origin plot, drawn (-1) elsewhere
};

std::optional<Element> draw_element(const World& world, const ElementPlace& place) {
    const WorldDefinition& definition = world.definition;
    const TerrainParameters& terrain = definition.terrain;
    const bool is_cave = place.type == ElementType::cave;
    Element element;
    element.plot = place.plot;
    element.type = place.type;
    element.number = place.number;
    element.id = key(definition.seed, Tag::element, place.plot.x, place.plot.z,
                     static_cast<std::uint64_t>(place.type), place.number);
    RandomStream random(element.id);

    const std::int32_t gaps = world.stack.gap_count();
    const double gap_draw = random.unit();
    element.gap = place.origin_gap >= 0
                      ? place.origin_gap
                      : std::min(gaps - 1, static_cast<std::int32_t>(gap_draw * gaps));
    const double area = is_cave ? terrain.cave_area : terrain.vein_area;
    const double base_side = area / 2 * (1 + random.unit());
    element.center_x = static_cast<float>(random.unit() * definition.grid.plot);
    element.center_z = static_cast<float>(random.unit() * definition.grid.plot);

    const Layer& below = world.stack.layers[static_cast<std::size_t>(element.gap)];
    const auto composition =
        choose_composition(random, definition, is_cave ? Filling::cave : Filling::vein,
                           &below.composition, 1 - below.top() / terrain.depth);
    if (!composition) {
        return std::nullopt;
    }
    const DrawnProperties drawn = draw_properties(random, definition, *composition);
    const double relative_area = mixed_property(definition, *composition, [](const Material& m) {
        return m.kind == MaterialKind::vein || m.kind == MaterialKind::cave ? m.area : 1.0;
    });
    element.side = static_cast<float>(base_side * relative_area);
    element.thickness = static_cast<float>(
        drawn.thickness * (is_cave ? terrain.cave_thickness : terrain.vein_thickness));
    element.roughness = std::min(1.0, drawn.roughness);
    element.content = {.composition = *composition,
                       .kind = is_cave ? PaletteKind::cave : PaletteKind::vein,
                       .alone = is_alone(definition, *composition)};
    if (!is_cave && !element.content.alone) {
        element.blend = blend256(
            mixed_property(definition, *composition, [](const Material& m) { return m.blend; }));
    }
    return element;
}

void draw_origin_elements(std::vector<Element>& out, const World& world, ElementType type,
                          const std::vector<std::int32_t>& counts) {
    std::int32_t number = 0;
    for (std::size_t gap = 0; gap < counts.size(); ++gap) {
        for (std::int32_t i = 0; i < counts[gap]; ++i) {
            auto element = draw_element(world, {.plot = {},
                                                .type = type,
                                                .number = number++,
                                                .origin_gap = static_cast<std::int32_t>(gap)});
            if (element) {
                out.push_back(*element);
            }
        }
    }
}

}  // namespace

bool comes_before(const Element& a, const Element& b) {
    return std::tie(a.gap, a.id, a.plot, a.type, a.number) <
           std::tie(b.gap, b.id, b.plot, b.type, b.number);
}

void draw_plot(std::vector<Element>& out, const World& world, PlotPos plot) {
    out.clear();
    if (world.stack.gap_count() == 0) {
        return;
    }
    if (plot == PlotPos{}) {
        draw_origin_elements(out, world, ElementType::vein, world.stack.origin_veins);
        draw_origin_elements(out, world, ElementType::cave, world.stack.origin_caves);
        return;
    }
    RandomStream random(key(world.definition.seed, Tag::plot, plot.x, plot.z));
    const double a = random.unit();
    const double b = random.unit();
    const double c = random.unit();
    const double d = random.unit();
    const auto veins = static_cast<std::int32_t>(world.stack.reference_veins * (0.5 + a) + b);
    const auto caves = static_cast<std::int32_t>(world.stack.reference_caves * (0.5 + c) + d);
    const auto draw = [&](ElementType type, std::int32_t count) {
        for (std::int32_t i = 0; i < count; ++i) {
            auto element = draw_element(world, {.plot = plot, .type = type, .number = i});
            if (element) {
                out.push_back(*element);
            }
        }
    };
    draw(ElementType::vein, veins);
    draw(ElementType::cave, caves);
}

}  // namespace terrane
