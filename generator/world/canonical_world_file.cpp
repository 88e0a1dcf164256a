// The canonical form of a world and the fingerprint made of it.
//
// Fingerprint = XXH3-128 of, in order: "terrane world\n", the generator version (u32), the
// canonical text (varint length, bytes), and for each texture in the order of its first material
// its name and its bytes (varint length, bytes each).
#include "generator/world/generator_version.h"
#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "generator/world/world_table.h"
#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {
namespace {

/// A TOML basic string.
std::string toml_string(std::string_view text) {
    constexpr std::string_view kHex = "0123456789abcdef";
    std::string result = "\"";
    for (const char c : text) {
        const auto byte = static_cast<unsigned char>(c);
        if (c == '"' || c == '\\') {
            result += '\\';
            result += c;
        } else if (byte < 0x20 || byte == 0x7f) {
            result += "\\u00";
            result += kHex[byte >> 4U];
            result += kHex[byte & 15U];
        } else {
            result += c;
        }
    }
    return result + '"';
}

std::string hex_color(Rgb8 color) {
    constexpr std::string_view kHex = "0123456789abcdef";
    std::string result = "#";
    for (const std::uint8_t channel : {color.r, color.g, color.b}) {
        result += kHex[channel >> 4U];
        result += kHex[channel & 15U];
    }
    return result;
}

void add_line(std::string& out, std::string_view key, std::string_view value) {
    out.append(key).append(" = ").append(value).append("\n");
}

void add_number(std::string& out, std::string_view key, double value) {
    add_line(out, key, number_text(value));
}

void add_range(std::string& out, std::string_view key, const Range& range) {
    add_line(out, key,
             "[" + number_text(range.least) + ", " + number_text(range.best) + ", " +
                 number_text(range.most) + "]");
}

void add_terrain(std::string& out, const TerrainParameters& terrain) {
    out += "\n[terrain]\n";
    add_number(out, "depth", terrain.depth);
    add_number(out, "scale", terrain.scale);
    add_line(out, "octaves", std::to_string(terrain.octaves));
    add_number(out, "layer_thickness", terrain.layer_thickness);
    add_number(out, "layer_similarity", terrain.layer_similarity);
    add_number(out, "roughness", terrain.roughness);
    add_number(out, "vein_area", terrain.vein_area);
    add_number(out, "cave_area", terrain.cave_area);
    add_number(out, "vein_thickness", terrain.vein_thickness);
    add_number(out, "cave_thickness", terrain.cave_thickness);
    add_number(out, "vein_density", terrain.vein_density);
    add_number(out, "cave_density", terrain.cave_density);
}

std::string truth_text(bool value) {
    return value ? "true" : "false";
}

void add_relief(std::string& out, const ReliefParameters& relief) {
    out += "\n[relief]\n";
    add_number(out, "height", relief.height);
    add_number(out, "ground", relief.ground);
    add_number(out, "fall", relief.fall);
    add_number(out, "valley", relief.valley);
    add_number(out, "province", relief.province);
    add_number(out, "plateau", relief.plateau);
    add_number(out, "rivers", relief.rivers);
    add_number(out, "gullies", relief.gullies);
    add_number(out, "gully_scale", relief.gully_scale);
    add_line(out, "gully_octaves", std::to_string(relief.gully_octaves));
    add_number(out, "cliffs", relief.cliffs);
    add_line(out, "overhang", std::to_string(relief.overhang));
    if (relief.sea_level) {
        add_number(out, "sea_level", *relief.sea_level);
    }
    if (relief.snow_line) {
        add_number(out, "snow_line", *relief.snow_line);
    }
    add_number(out, "soil", relief.soil);
}

void add_structure(std::string& out, const StructureParameters& structure) {
    out += "\n[structure]\n";
    add_number(out, "fold", structure.fold);
    add_number(out, "fold_length", structure.fold_length);
    add_number(out, "fold_direction", structure.fold_direction);
    add_number(out, "fault_density", structure.fault_density);
    add_number(out, "fault_throw", structure.fault_throw);
    add_number(out, "fault_length", structure.fault_length);
    add_number(out, "fault_dip", structure.fault_dip);
    add_number(out, "sheet", structure.sheet);
    add_line(out, "lift", truth_text(structure.lift));
}

void add_caves(std::string& out, const CaveParameters& caves) {
    out += "\n[caves]\n";
    add_line(out, "cell", std::to_string(caves.cell));
    add_number(out, "radius", caves.radius);
    add_number(out, "density", caves.density);
    add_number(out, "connect", caves.connect);
    add_number(out, "shaft", caves.shaft);
    add_number(out, "chamber", caves.chamber);
    add_number(out, "sink", caves.sink);
    add_line(out, "levels", std::to_string(caves.levels));
    add_number(out, "water_table", caves.water_table);
}

void add_grid(std::string& out, const Grid& grid) {
    const std::string side = std::to_string(grid.side);
    out += "\n[grid]\n";
    add_line(out, "chunk", "[" + side + ", " + std::to_string(grid.height) + ", " + side + "]");
    add_line(out, "plot", std::to_string(grid.plot));
    add_number(out, "voxel_size_m", grid.voxel_size_m);
}

void add_material(std::string& out, const Material& material, std::int32_t format) {
    const MaterialKeys keys = keys_of(material.kind, material.alone);
    out += "\n[[material]]\n";
    add_line(out, "id", std::to_string(material.id));
    add_line(out, "name", toml_string(material.name));
    add_line(out, "color", toml_string(hex_color(material.color)));
    if (!material.texture.empty()) {
        add_line(out, "texture", toml_string(material.texture));
    }
    add_line(out, "kind", toml_string(to_string(material.kind)));
    if (material.kind != MaterialKind::void_) {
        add_line(out, "alone", truth_text(material.alone));
    }
    if (keys.area) {
        add_number(out, "area", material.area);
    }
    if (keys.depth) {
        add_range(out, "depth", material.depth);
    }
    if (keys.thickness) {
        add_range(out, "thickness", material.thickness);
    }
    if (keys.roughness) {
        add_range(out, "roughness", material.roughness);
    }
    if (keys.similarity) {
        add_number(out, "similarity", material.similarity);
    }
    if (keys.blend) {
        add_number(out, "blend", material.blend);
    }
    if (keys.hardness && format >= 2) {
        add_number(out, "hardness", material.hardness);
        add_number(out, "soluble", material.soluble);
    }
}

/// The most frequent affinity, the greatest of those, so that few pairs need a line of their own. A
/// definition does not keep the default its file had: only the resulting matrix means anything.
double usual_affinity(const std::vector<double>& matrix) {
    std::map<double, std::size_t> counts;
    for (const double affinity : matrix) {
        ++counts[affinity];
    }
    double usual = 1;
    std::size_t most = 0;
    for (const auto& [affinity, count] : counts) {
        if (count >= most) {
            most = count;
            usual = affinity;
        }
    }
    return usual;
}

void add_affinity(std::string& out, std::string_view key, const std::vector<Material>& materials,
                  const std::vector<double>& matrix) {
    const double usual = usual_affinity(matrix);
    add_number(out, std::string(key) + "_default", usual);
    out.append(key).append(" = [\n");
    for (std::size_t a = 0; a < materials.size(); ++a) {
        for (std::size_t b = a; b < materials.size(); ++b) {
            const double affinity = matrix[a * materials.size() + b];
            if (affinity != usual) {
                out += "[" + toml_string(materials[a].name) + "," + toml_string(materials[b].name) +
                       "," + number_text(affinity) + "],\n";
            }
        }
    }
    out += "]\n";
}

void add_bytes(ByteWriter& writer, std::span<const std::byte> bytes) {
    writer.varint(bytes.size());
    writer.raw(bytes);
}

}  // namespace

std::string canonical_world_file(const WorldDefinition& definition) {
    std::string out;
    add_line(out, "format", std::to_string(definition.format));
    add_line(out, "name", toml_string(definition.name));
    add_line(out, "seed", std::to_string(static_cast<std::int64_t>(definition.seed)));
    add_terrain(out, definition.terrain);
    if (definition.format >= 2) {
        add_structure(out, definition.structure);
        add_relief(out, definition.relief);
        add_caves(out, definition.caves);
    }
    add_grid(out, definition.grid);
    for (const Material& material : definition.materials) {
        add_material(out, material, definition.format);
    }
    out += "\n[affinity]\n";
    add_affinity(out, "same_layer", definition.materials, definition.same_layer);
    add_affinity(out, "next_layer", definition.materials, definition.next_layer);
    return out;
}

Hash128 world_fingerprint(const WorldDefinition& definition) {
    Bytes bytes;
    ByteWriter writer(bytes);
    writer.raw(bytes_of("terrane world\n"));
    writer.fixed(kGeneratorVersion);
    add_bytes(writer, bytes_of(canonical_world_file(definition)));
    for (const Texture& texture : definition.textures) {
        add_bytes(writer, bytes_of(texture.name));
        add_bytes(writer, texture.bytes);
    }
    return hash128(bytes);
}

}  // namespace terrane
