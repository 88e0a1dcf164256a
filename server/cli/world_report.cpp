#include "server/cli/world_report.h"

#include "generator/terrain/layer_stack.h"
#include "generator/terrain/world.h"
#include "generator/world/composition.h"
#include "generator/world/generator_version.h"
#include "generator/world/world_definition.h"
#include "protocol/base/hash.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <numeric>
#include <string>
#include <vector>

namespace terrane {
namespace {

using Json = nlohmann::ordered_json;

std::int32_t total(const std::vector<std::int32_t>& counts) {
    return std::accumulate(counts.begin(), counts.end(), std::int32_t{0});
}

/// `decimals` digits after the point.
std::string fixed_text(double value, int decimals) {
    std::array<char, 64> buffer{};
    const int size = std::snprintf(buffer.data(), buffer.size(), "%.*f", decimals, value);
    return {buffer.data(), static_cast<std::size_t>(std::clamp(size, 0, 63))};
}

std::string composition_text(const World& world, const Composition& composition) {
    std::string text;
    for (const Share& share : composition.shares()) {
        text += text.empty() ? "" : ", ";
        text += world.definition.materials[share.material].name + " " +
                fixed_text(share.concentration, 3);
    }
    return text;
}

Json composition_json(const World& world, const Composition& composition) {
    Json object = Json::object();
    for (const Share& share : composition.shares()) {
        object[world.definition.materials[share.material].name] = share.concentration;
    }
    return object;
}

void add_right(std::string& out, const std::string& text, std::size_t width) {
    out.append(text.size() < width ? width - text.size() : 0, ' ').append(text);
}

std::string layer_table(const World& world) {
    constexpr std::array kHeads = {"layer",      "bottom", "thickness", "roughness",
                                   "similarity", "blend",  "veins",     "caves"};
    constexpr std::size_t kGap = 2;
    std::string out;
    for (const char* head : kHeads) {
        add_right(out, head, std::string_view(head).size() + kGap);
    }
    out += "  materials\n";
    const LayerStack& stack = world.stack;
    for (std::size_t i = stack.layers.size(); i-- > 0;) {
        const Layer& layer = stack.layers[i];
        const bool has_gap = i < stack.origin_veins.size();
        const std::array<std::string, kHeads.size()> cells = {
            std::to_string(i),
            fixed_text(layer.bottom, 2),
            fixed_text(layer.thickness, 2),
            fixed_text(layer.roughness, 2),
            fixed_text(layer.similarity, 3),
            layer.alone ? "alone" : fixed_text(layer.blend, 3),
            has_gap ? std::to_string(stack.origin_veins[i]) : "-",
            has_gap ? std::to_string(stack.origin_caves[i]) : "-"};
        for (std::size_t c = 0; c < cells.size(); ++c) {
            add_right(out, cells[c], std::string_view(kHeads[c]).size() + kGap);
        }
        out += "  " + composition_text(world, layer.composition) + "\n";
    }
    return out;
}

std::int64_t signed_seed(const World& world) {
    return static_cast<std::int64_t>(world.definition.seed);
}

/// "12", "2.5": as short as it can be said.
std::string short_text(double value) {
    std::array<char, 64> buffer{};
    const int size = std::snprintf(buffer.data(), buffer.size(), "%.4g", value);
    return {buffer.data(), static_cast<std::size_t>(std::clamp(size, 0, 63))};
}

std::string percent_text(double share) {
    return fixed_text(share * 100, 0) + " %";
}

std::string structure_text(const StructureParameters& structure) {
    std::string text;
    if (structure.fold > 0) {
        text += "layers bent into folds about " + short_text(2 * structure.fold) +
                " voxels high, a crest every " + short_text(structure.fold_length) + " columns; ";
    }
    if (structure.fault_density > 0) {
        text += "about " + short_text(structure.fault_density) +
                " fractures in 512 x 512 columns, slipped by up to " +
                short_text(structure.fault_throw) + " voxels";
        text += structure.sheet > 0
                    ? ", some filled up to " + short_text(structure.sheet) + " thick; "
                    : "; ";
    }
    text += text.empty() ? "layers lie as they were laid down; " : "";
    return text + (structure.lift ? "veins lift what is above them"
                                  : "veins lie in the rock without lifting it");
}

bool has_material(const WorldDefinition& definition, MaterialKind kind) {
    return std::any_of(definition.materials.begin(), definition.materials.end(),
                       [&](const Material& material) { return material.kind == kind; });
}

std::string relief_text(const WorldDefinition& definition) {
    const ReliefParameters& relief = definition.relief;
    if (relief.height <= 0) {
        return "none: the ground is the top of the stack";
    }
    const double low = relief.ground - relief.fall;
    std::string text = "crests up to " + short_text(relief.height) +
                       " voxels over rivers, a valley every " + short_text(relief.valley) +
                       " columns, rivers between heights " + short_text(std::max(0.0, low)) +
                       " and " + short_text(relief.ground + relief.fall) +
                       ", plains and mountains " + short_text(relief.province) + " columns apart";
    text += relief.plateau >= 0.5 ? "; table lands" : "; ridges";
    if (relief.ground + relief.fall + relief.height > definition.terrain.depth) {
        text += "; nothing stands above the top of the layers, whose depth is " +
                short_text(definition.terrain.depth);
    }
    if (relief.rivers > 0) {
        text += "; rivers some " + short_text(2 * relief.rivers) + " columns wide and more";
    }
    if ((relief.rivers > 0 || relief.sea_level) && !has_material(definition, MaterialKind::water)) {
        text += ", but dry: no material is of kind water";
    }
    if (relief.gullies > 0) {
        text += "; gullies " + short_text(relief.gullies) + " deep";
    }
    if (relief.cliffs > 0) {
        text += "; hard layers stand as cliffs";
        text += relief.overhang > 0
                    ? " and lean out up to " + std::to_string(relief.overhang) + " columns"
                    : "";
    }
    if (relief.soil > 0) {
        text += "; up to " + short_text(relief.soil) + " of soil";
        text += has_material(definition, MaterialKind::soil)
                    ? ""
                    : ", but none is there: no material is of kind soil";
    }
    if (relief.sea_level) {
        text += "; the sea stands at " + short_text(*relief.sea_level);
    }
    if (relief.snow_line) {
        text += "; snow from " + short_text(*relief.snow_line) + " up";
    }
    return text;
}

std::string caves_text(const CaveParameters& caves) {
    if (caves.cell == 0) {
        return "none but those between the layers";
    }
    return "a place for a node every " + std::to_string(caves.cell) + " columns on up to " +
           std::to_string(caves.levels) + " soluble layers, taken with " +
           percent_text(caves.density) + "; tubes to neighbours with " +
           percent_text(caves.connect) + ", shafts upwards with " + percent_text(caves.shaft) +
           ", chambers with " + percent_text(caves.chamber) + ", openings to the sky with " +
           percent_text(caves.sink) + "; flooded from " + short_text(caves.water_table) +
           " voxels below the rivers down";
}

Json landscape_json(const WorldDefinition& definition) {
    const StructureParameters& structure = definition.structure;
    const ReliefParameters& relief = definition.relief;
    const CaveParameters& caves = definition.caves;
    Json json = {{"structure",
                  {{"fold", structure.fold},
                   {"fold_length", structure.fold_length},
                   {"fold_direction", structure.fold_direction},
                   {"fault_density", structure.fault_density},
                   {"fault_throw", structure.fault_throw},
                   {"fault_length", structure.fault_length},
                   {"fault_dip", structure.fault_dip},
                   {"sheet", structure.sheet},
                   {"lift", structure.lift}}},
                 {"relief",
                  {{"height", relief.height},
                   {"ground", relief.ground},
                   {"fall", relief.fall},
                   {"valley", relief.valley},
                   {"province", relief.province},
                   {"plateau", relief.plateau},
                   {"rivers", relief.rivers},
                   {"gullies", relief.gullies},
                   {"gully_scale", relief.gully_scale},
                   {"gully_octaves", relief.gully_octaves},
                   {"cliffs", relief.cliffs},
                   {"overhang", relief.overhang},
                   {"soil", relief.soil}}},
                 {"caves",
                  {{"cell", caves.cell},
                   {"radius", caves.radius},
                   {"density", caves.density},
                   {"connect", caves.connect},
                   {"shaft", caves.shaft},
                   {"chamber", caves.chamber},
                   {"sink", caves.sink},
                   {"levels", caves.levels},
                   {"water_table", caves.water_table}}}};
    if (relief.sea_level) {
        json["relief"]["sea_level"] = *relief.sea_level;
    }
    if (relief.snow_line) {
        json["relief"]["snow_line"] = *relief.snow_line;
    }
    return json;
}

}  // namespace

std::string world_report_text(const World& world) {
    const WorldDefinition& definition = world.definition;
    const LayerStack& stack = world.stack;
    const std::string side = std::to_string(definition.grid.side);
    std::string out;
    const auto line = [&](const char* head, const std::string& text) {
        out += head;
        out.append(15 - std::string_view(head).size(), ' ').append(text).append("\n");
    };
    line("name", definition.name);
    line("seed", std::to_string(signed_seed(world)));
    line("fingerprint", to_hex(world.fingerprint));
    line("materials", std::to_string(definition.materials.size()));
    line("depth", fixed_text(definition.terrain.depth, 2) + " voxels");
    line("height bound",
         fixed_text(stack.height_bound, 2) + " voxels: nothing solid stands higher");
    line("chunk", side + " x " + std::to_string(definition.grid.height) + " x " + side +
                      " voxels of " + fixed_text(definition.grid.voxel_size_m, 3) + " m");
    line("plot", std::to_string(definition.grid.plot) + " columns a side");
    line("origin plot", std::to_string(total(stack.origin_veins)) + " veins, " +
                            std::to_string(total(stack.origin_caves)) + " caves");
    line("other plots", "0.5 to 1.5 times " + fixed_text(stack.reference_veins, 2) + " veins, " +
                            fixed_text(stack.reference_caves, 2) + " caves");
    if (definition.format >= 2) {
        line("structure", structure_text(definition.structure));
        line("relief", relief_text(definition));
        line("cave systems", caves_text(definition.caves));
    }
    out +=
        "\nLayers, the surface on top; lengths in voxels; veins and caves: of the origin plot, on\n"
        "top of the layer.\n";
    return out + layer_table(world);
}

std::string world_report_json(const World& world) {
    const WorldDefinition& definition = world.definition;
    const LayerStack& stack = world.stack;
    Json layers = Json::array();
    for (const Layer& layer : stack.layers) {
        layers.push_back({{"bottom", layer.bottom},
                          {"thickness", layer.thickness},
                          {"roughness", layer.roughness},
                          {"similarity", layer.similarity},
                          {"blend", layer.blend},
                          {"alone", layer.alone},
                          {"composition", composition_json(world, layer.composition)}});
    }
    Json report = {
        {"name", definition.name},
        {"seed", signed_seed(world)},
        {"fingerprint", to_hex(world.fingerprint)},
        {"generator_version", kGeneratorVersion},
        {"materials", definition.materials.size()},
        {"depth", definition.terrain.depth},
        {"height_bound", stack.height_bound},
        {"chunk", {definition.grid.side, definition.grid.height, definition.grid.side}},
        {"plot", definition.grid.plot},
        {"voxel_size_m", definition.grid.voxel_size_m},
        {"origin",
         {{"veins", total(stack.origin_veins)},
          {"caves", total(stack.origin_caves)},
          {"veins_by_gap", stack.origin_veins},
          {"caves_by_gap", stack.origin_caves}}},
        {"reference", {{"veins", stack.reference_veins}, {"caves", stack.reference_caves}}},
        {"layers", layers}};
    if (definition.format >= 2) {
        report["landscape"] = landscape_json(definition);
    }
    return report.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace terrane
