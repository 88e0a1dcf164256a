#include "server/report/survey.h"

#include "generator/terrain/element.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/region.h"
#include "generator/terrain/world.h"
#include "generator/volume/limit.h"
#include "generator/volume/voxel.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/result.h"
#include "server/report/numbers.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {
namespace {

struct Thicknesses {
    std::vector<double> veins;
    std::vector<double> caves;
};

/// Adds one column to the survey.
void add_column(Survey& survey, Thicknesses& thick, std::span<const Limit> limits,
                const Palette& palette) {
    double vein = 0;
    double cave = 0;
    double top = 0;
    std::vector<double> tops(survey.layer_tops.size(), -1);
    for (std::size_t i = 0; i + 1 < limits.size(); ++i) {
        const double begin = limits[i].y256 / 256.0;
        const double end = limits[i + 1].y256 / 256.0;
        const PaletteEntry& content = palette[limits[i].palette_id];
        if (end > begin) {
            vein += content.kind == PaletteKind::vein ? end - begin : 0;
            cave += content.kind == PaletteKind::cave ? end - begin : 0;
            top = content.is_solid() ? end : top;
        }
        // A layer's last limit stands at its top, or its thickness is nothing here.
        if (limits[i].palette_id < tops.size()) {
            tops[limits[i].palette_id] = begin;
        }
    }
    double below = 0;
    for (std::size_t layer = 0; layer < tops.size(); ++layer) {
        below = std::max(below, tops[layer]);
        survey.layer_tops[layer].push_back(below);
    }
    survey.surface.push_back(top);
    if (vein > 0) {
        thick.veins.push_back(vein);
    }
    if (cave > 0) {
        thick.caves.push_back(cave);
    }
}

}  // namespace

Result<Survey> survey(const World& world) {
    StackGenerator generator(world);
    ColumnSet set;
    if (auto made = generator.generate(
            set, {.x0 = 1000, .z0 = 1000, .width = kSurveySide, .length = kSurveySide});
        !made) {
        return tl::unexpected(made.error());
    }
    Survey survey;
    survey.layer_tops.resize(world.stack.layers.size());
    survey.layer_count = static_cast<double>(world.stack.layers.size());
    Thicknesses thick;
    for (std::int32_t z = 0; z < kSurveySide; ++z) {
        for (std::int32_t x = 0; x < kSurveySide; ++x) {
            add_column(survey, thick, set.columns.column(x, z), set.palette);
        }
    }
    const auto columns = static_cast<double>(survey.surface.size());
    survey.vein_share = static_cast<double>(thick.veins.size()) / columns;
    survey.cave_share = static_cast<double>(thick.caves.size()) / columns;
    survey.vein_thickness = summarize(thick.veins).mean;
    survey.cave_thickness = summarize(thick.caves).mean;
    std::vector<Element> elements;
    draw_plot(elements, world, {.x = 1, .z = 0});
    for (const Element& element : elements) {
        (element.type == ElementType::vein ? survey.vein_count : survey.cave_count) += 1;
    }
    return survey;
}

Result<std::vector<std::uint16_t>> main_materials(const World& world,
                                                  const ColumnRectangle& rectangle,
                                                  std::int32_t height) {
    StackGenerator generator(world);
    ColumnSet set;
    if (auto made = generator.generate(set, rectangle); !made) {
        return tl::unexpected(made.error());
    }
    const auto width = static_cast<std::size_t>(rectangle.width);
    const auto layers = static_cast<std::size_t>(height);
    std::vector<std::uint16_t> out(width * layers * static_cast<std::size_t>(rectangle.length));
    std::vector<Voxel> voxels(layers);
    for (std::int32_t z = 0; z < rectangle.length; ++z) {
        for (std::int32_t x = 0; x < rectangle.width; ++x) {
            expand_column(voxels, set.columns.column(x, z), set.palette, 0);
            for (std::size_t y = 0; y < layers; ++y) {
                const auto shares = voxels[y].shares();
                const auto most = std::ranges::max_element(shares, {}, &Share::concentration);
                const auto& material = world.definition.materials[most->material];
                const bool empty = !is_solid(material.kind);
                out[(static_cast<std::size_t>(z) * layers + y) * width +
                    static_cast<std::size_t>(x)] =
                    empty ? std::uint16_t{0} : static_cast<std::uint16_t>(most->material + 1);
            }
        }
    }
    return out;
}

}  // namespace terrane
