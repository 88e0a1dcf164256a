// Reads a world file in one pass over its tables: general parameters, grid, materials, affinities,
// then what only holds between them. Every fault is noted and reading goes on, so that a designer
// sees all of them at once; only a TOML syntax error stands alone, for nothing after it has
// meaning.
#include "generator/world/world_file.h"

#include "generator/world/world_affinities.h"
#include "generator/world/world_definition.h"
#include "generator/world/world_landscape.h"
#include "generator/world/world_materials.h"
#include "generator/world/world_table.h"

#include <toml++/toml.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

namespace terrane {
namespace {

struct Areas {
    std::optional<double> vein;
    std::optional<double> cave;
};

Areas read_terrain(const toml::table& source, WorldFaults& faults, TerrainParameters& terrain) {
    WorldTable table(source, "terrain", faults);
    constexpr NumberBounds kLengths{.least = 0, .most = kLengthScaleMax};
    constexpr NumberBounds kDensities{.least = 0, .most = kDensityMax};
    const auto number = [&](std::string_view key, NumberBounds bounds) {
        return table.number(key, bounds, Need::required);
    };
    terrain.depth = number("depth", {.least = kDepthMin, .most = kDepthMax}).value_or(0);
    terrain.scale = number("scale", {.least = kScaleMin, .most = kScaleMax}).value_or(0);
    terrain.octaves = static_cast<std::int32_t>(
        table.integer("octaves", {.least = kOctavesMin, .most = kOctavesMax}, Need::optional)
            .value_or(1));
    terrain.layer_thickness = number("layer_thickness", kLengths).value_or(0);
    terrain.layer_similarity =
        number("layer_similarity", {.least = 0, .most = kLayerSimilarityMax}).value_or(0);
    terrain.roughness = number("roughness", kLengths).value_or(0);
    const Areas areas = {.vein = number("vein_area", kLengths),
                         .cave = number("cave_area", kLengths)};
    terrain.vein_area = areas.vein.value_or(0);
    terrain.cave_area = areas.cave.value_or(0);
    terrain.vein_thickness = number("vein_thickness", kLengths).value_or(0);
    terrain.cave_thickness = number("cave_thickness", kLengths).value_or(0);
    terrain.vein_density = number("vein_density", kDensities).value_or(0);
    terrain.cave_density = number("cave_density", kDensities).value_or(0);
    table.finish();
    return areas;
}

void read_chunk_sides(WorldTable& table, Grid& grid) {
    const std::string allowed = "it must be [N, M, L], three integers from " +
                                std::to_string(kChunkSideMin) + " to " +
                                std::to_string(kChunkSideMax) + " with N = L";
    const toml::array* sides = table.array("chunk", allowed, Need::required);
    if (sides == nullptr) {
        return;
    }
    if (sides->size() != 3) {
        table.fault("chunk", "has " + std::to_string(sides->size()) + " values; " + allowed);
        return;
    }
    std::array<std::int32_t, 3> read{};
    for (std::size_t i = 0; i < read.size(); ++i) {
        const auto* side = (*sides)[i].as_integer();
        if (side == nullptr) {
            table.fault("chunk", "holds " + std::string(type_text((*sides)[i])) + "; " + allowed);
            return;
        }
        if (side->get() < kChunkSideMin || side->get() > kChunkSideMax) {
            table.fault("chunk", "has a side of " + std::to_string(side->get()) + "; " + allowed);
            return;
        }
        read[i] = static_cast<std::int32_t>(side->get());
    }
    if (read[0] != read[2]) {
        table.fault("chunk", "has N = " + std::to_string(read[0]) +
                                 " and L = " + std::to_string(read[2]) + "; " + allowed);
        return;
    }
    grid.side = read[0];
    grid.height = read[1];
}

std::optional<std::int64_t> read_grid(const toml::table& source, WorldFaults& faults, Grid& grid) {
    WorldTable table(source, "grid", faults);
    read_chunk_sides(table, grid);
    const auto plot = table.integer("plot", {.least = kPlotMin, .most = kPlotMax}, Need::required);
    grid.plot = static_cast<std::int32_t>(plot.value_or(kPlotMin));
    grid.voxel_size_m =
        table
            .number("voxel_size_m", {.least = kVoxelSizeMinM, .most = kVoxelSizeMaxM},
                    Need::optional)
            .value_or(1.0);
    table.finish();
    return plot;
}

/// An element must not reach beyond the plots next to its own.
void check_areas(const toml::table& terrain, const Areas& areas, std::int64_t plot,
                 WorldFaults& faults) {
    const WorldTable table(terrain, "terrain", faults);
    const auto area_max = static_cast<double>(2 * plot - 2);
    const auto check = [&](std::string_view key, std::optional<double> area) {
        if (area && *area > area_max) {
            table.fault(key, "is " + number_text(*area) + "; it must be at most 2 * plot - 2, " +
                                 number_text(area_max) + " with plot = " + std::to_string(plot));
        }
    };
    check("vein_area", areas.vein);
    check("cave_area", areas.cave);
}

void read_root(const toml::table& root_source, WorldFaults& faults,
               const std::filesystem::path& texture_folder, WorldFileResult& result) {
    WorldDefinition& world = result.definition;
    WorldTable root(root_source, "", faults);
    world.format = static_cast<std::int32_t>(
        root.integer("format", {.least = kWorldFileFormatMin, .most = kWorldFileFormatMax},
                     Need::required)
            .value_or(kWorldFileFormatMax));  // what is written is then not refused for the format
    world.name = root.text("name", kNameBytesMax, Need::required).value_or("");
    world.seed =
        static_cast<std::uint64_t>(root.integer("seed",
                                                {.least = std::numeric_limits<std::int64_t>::min(),
                                                 .most = std::numeric_limits<std::int64_t>::max()},
                                                Need::required)
                                       .value_or(0));
    const toml::table* terrain =
        root.table("terrain", "it must be a table of the general parameters", Need::required);
    const toml::table* grid =
        root.table("grid", "it must be a table with chunk, plot and voxel_size_m", Need::required);
    const toml::array* materials =
        root.array("material", "it must be a [[material]] for each material", Need::required);
    const toml::table* affinity =
        root.table("affinity", "it must be a table of affinities", Need::optional);
    const LandscapeTables landscape = find_landscape(root, world.format);
    root.finish();

    Areas areas;
    if (terrain != nullptr) {
        result.terrain_line = static_cast<int>(terrain->source().begin.line);
        result.terrain_column = static_cast<int>(terrain->source().begin.column);
        areas = read_terrain(*terrain, faults, world.terrain);
    }
    const auto plot =
        grid != nullptr ? read_grid(*grid, faults, world.grid) : std::optional<std::int64_t>();
    if (terrain != nullptr && plot) {
        check_areas(*terrain, areas, *plot, faults);
    }
    read_landscape(landscape, faults, world);
    if (materials != nullptr) {
        read_materials(*materials, texture_folder, faults, world);
        read_affinities(affinity, faults, world);
    }
}

/// The bytes of a file, or what is wrong with it.
struct FileText {
    std::string text;
    std::string wrong;
};

FileText read_text(const std::filesystem::path& path) {
    std::error_code error;
    if (std::filesystem::is_directory(path, error)) {
        return {.text = {}, .wrong = "is a folder; it must be a TOML file"};
    }
    std::ifstream in(path, std::ios::binary);
    if (!in) {
        return {.text = {}, .wrong = "cannot be opened; it must be a TOML file that can be read"};
    }
    std::string text(kWorldFileBytesMax + 1, '\0');
    in.read(text.data(), static_cast<std::streamsize>(text.size()));
    if (in.bad()) {
        return {.text = {}, .wrong = "cannot be read; it must be a TOML file that can be read"};
    }
    text.resize(static_cast<std::size_t>(in.gcount()));
    return {.text = std::move(text), .wrong = {}};
}

}  // namespace

std::string WorldFileFault::text() const {
    return file + ":" + std::to_string(line) + ":" + std::to_string(column) + ": " + key + ": " +
           message;
}

WorldFileResult load_world_file(const std::filesystem::path& path) {
    const FileText file = read_text(path);
    if (!file.wrong.empty()) {
        WorldFaults faults(path.string());
        faults.add(1, 1, "file", file.wrong);
        return {.definition = {}, .faults = faults.take_sorted()};
    }
    return parse_world_file(file.text, path.string(), path.parent_path());
}

WorldFileResult parse_world_file(std::string_view text, std::string_view name,
                                 const std::filesystem::path& texture_folder) {
    WorldFileResult result;
    WorldFaults faults(name);
    if (text.size() > kWorldFileBytesMax) {
        faults.add(
            1, 1, "file",
            "is too long; at most " + std::to_string(kWorldFileBytesMax) + " bytes are allowed");
        result.faults = faults.take_sorted();
        return result;
    }
    try {
        const toml::table root = toml::parse(text);
        read_root(root, faults, texture_folder, result);
    } catch (const toml::parse_error& error) {  // the library's only way to say so
        faults.add(error.source(), "syntax", std::string(error.description()));
    }
    result.faults = faults.take_sorted();
    return result;
}

}  // namespace terrane
