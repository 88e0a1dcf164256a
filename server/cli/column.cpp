#include "server/cli/column.h"

#include "generator/terrain/generate_stack.h"
#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "protocol/base/result.h"
#include "server/cli/arguments.h"
#include "server/cli/open_world.h"
#include "server/cli/program.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <array>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace terrane {
namespace {

/// What lies on a landscape's ground, and its water, are named by their material: in the palette
/// soil is a vein, and water a void or a cave.
std::string_view kind_name(const PaletteEntry& entry, std::span<const Material> materials) {
    const auto shares = entry.composition.shares();
    if (!shares.empty()) {
        const MaterialKind kind = materials[shares[0].material].kind;
        if (kind == MaterialKind::soil || kind == MaterialKind::sand ||
            kind == MaterialKind::snow || kind == MaterialKind::water) {
            return to_string(kind);
        }
    }
    switch (entry.kind) {
        case PaletteKind::layer:
            return "layer";
        case PaletteKind::void_:
            return "void";
        case PaletteKind::vein:
            return "vein";
        case PaletteKind::cave:
            return "cave";
    }
    return "";
}

std::string percentages(const Composition& composition, std::span<const Material> materials) {
    std::string text;
    for (const Share& share : composition.shares()) {
        std::array<char, 32> number{};
        std::snprintf(number.data(), number.size(), "%.1f %% ", share.concentration * 100);
        text += text.empty() ? "" : ", ";
        text += composition.count > 1 ? number.data() : "";
        text += materials[share.material].name;
    }
    return text;
}

int run_column(const std::string& path, const std::string& at, bool as_json) {
    const auto position = parse_column(at);
    if (!position) {
        std::fprintf(stderr, "terrane: --at: %s\n", position.error().message.c_str());
        return kExitWrongUse;
    }
    const auto world = open_world(path);
    if (!world) {
        return kExitWrongUse;
    }
    StackGenerator generator(*world);
    ColumnSet set;
    const auto made =
        generator.generate(set, {.x0 = position->x, .z0 = position->z, .width = 1, .length = 1});
    if (!made) {
        std::fprintf(stderr, "terrane: --at %s: %s\n", at.c_str(), made.error().message.c_str());
        return made.error().code == ErrorCode::out_of_range ? kExitWrongUse : kExitFailed;
    }
    const ColumnReport report = {.position = *position,
                                 .limits = set.columns.column(0, 0),
                                 .palette = set.palette,
                                 .materials = world->definition.materials};
    std::puts((as_json ? column_json(report) : column_text(report)).c_str());
    return kExitDone;
}

}  // namespace

std::string column_json(const ColumnReport& column) {
    nlohmann::ordered_json json = {{"x", column.position.x},
                                   {"z", column.position.z},
                                   {"limits", nlohmann::ordered_json::array()}};
    for (const Limit& limit : column.limits) {
        nlohmann::ordered_json composition = nlohmann::ordered_json::object();
        for (const Share& share : column.palette[limit.palette_id].composition.shares()) {
            composition[column.materials[share.material].name] = share.concentration;
        }
        json["limits"].push_back({{"y256", limit.y256},
                                  {"flow", {limit.flow.x, limit.flow.y, limit.flow.z}},
                                  {"composition", std::move(composition)}});
    }
    return json.dump();
}

std::string column_text(const ColumnReport& column) {
    std::string text = "column " + std::to_string(column.position.x) + "," +
                       std::to_string(column.position.z) + ", limits bottom first\n" +
                       "     height   flow             kind   composition";
    for (const Limit& limit : column.limits) {
        const PaletteEntry& entry = column.palette[limit.palette_id];
        const std::string kind(kind_name(entry, column.materials));
        std::array<char, 80> line{};
        std::snprintf(line.data(), line.size(), "\n%11.3f   %4d %4d %4d   %-5s  ",
                      static_cast<double>(limit.y256) / kUnitsPerVoxel, limit.flow.x, limit.flow.y,
                      limit.flow.z, kind.c_str());
        text += line.data() + percentages(entry.composition, column.materials);
    }
    return text;
}

void add_column_command(CLI::App& app, int& exit_code) {
    struct Options {
        std::string world;
        std::string at;
        bool as_json = false;
    };

    const auto options = std::make_shared<Options>();
    CLI::App* column = app.add_subcommand("column", "Print one column's limits, bottom first");
    column->add_option("--world", options->world, "World file")->required();
    column->add_option("--at", options->at, "Column X,Z, in voxels; may be negative")->required();
    column->add_flag("--json", options->as_json, "One JSON object on one line");
    column->footer(
        "Between two limits composition and flow are interpolated; two limits at one height make "
        "a\n"
        "sharp frontier. Heights are in voxels, in JSON (y256) in 1/256 voxel.\n"
        "Exit code: 0 done, 2 a bad world file or a column outside of |x|, |z| < 2^53.\n"
        "Examples:\n"
        "  terrane column --world generator/worlds/basin.toml --at 120,-40\n"
        "  terrane column --world generator/worlds/basin.toml --at -5,3 --json | jq .limits");
    column->callback([options, &exit_code] {
        exit_code = run_column(options->world, options->at, options->as_json);
    });
}

}  // namespace terrane
