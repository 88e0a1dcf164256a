#include "generator/world/world_materials.h"

#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "generator/world/world_table.h"
#include "protocol/base/nearest_word.h"

#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr std::array kKinds = {MaterialKind::void_, MaterialKind::base, MaterialKind::regular,
                               MaterialKind::vein,  MaterialKind::cave, MaterialKind::soil,
                               MaterialKind::sand,  MaterialKind::snow, MaterialKind::water};
constexpr NumberBounds kShare{.least = 0, .most = 1};

/// What the materials have in common: what may stand only once, and how many there are of a kind.
struct Seen {
    std::set<std::int64_t> ids;
    std::set<std::string> names;
    std::map<MaterialKind, std::size_t> kinds;
    bool all_kinds_known = true;
    std::map<std::string, std::vector<std::byte>> textures;
    std::size_t textures_bytes = 0;
    std::int32_t format = 1;
};

/// Kinds that lie on a landscape's ground: format 2 only, one of each.
bool is_cover(MaterialKind kind) {
    return kind == MaterialKind::soil || kind == MaterialKind::sand || kind == MaterialKind::snow ||
           kind == MaterialKind::water;
}

std::optional<Rgb8> rgb_from_hex(std::string_view text) {
    if (text.size() != 7 || text[0] != '#') {
        return std::nullopt;
    }
    std::array<unsigned, 6> digits{};
    for (std::size_t i = 0; i < digits.size(); ++i) {
        const auto digit =
            std::string_view("0123456789abcdef")
                .find(static_cast<char>(text[i + 1] | (text[i + 1] >= 'A' ? 32 : 0)));
        if (digit == std::string_view::npos) {
            return std::nullopt;
        }
        digits[i] = static_cast<unsigned>(digit);
    }
    const auto channel = [&](std::size_t i) {
        return static_cast<std::uint8_t>(digits[i] * 16 + digits[i + 1]);
    };
    return Rgb8{.r = channel(0), .g = channel(2), .b = channel(4)};
}

std::optional<MaterialKind> read_kind(WorldTable& table) {
    const auto text = table.text("kind", kNameBytesMax, Need::required);
    if (!text) {
        return std::nullopt;
    }
    std::vector<std::string> words;
    for (const MaterialKind kind : kKinds) {
        if (*text == to_string(kind)) {
            return kind;
        }
        words.emplace_back(to_string(kind));
    }
    table.fault("kind", "is " + in_quotes(*text) +
                            "; it must be void, base, regular, vein or cave, in format 2 also "
                            "soil, sand, snow or water; the nearest is " +
                            in_quotes(nearest_word(*text, words)));
    return std::nullopt;
}

Rgb8 read_color(WorldTable& table) {
    const auto text = table.text("color", kNameBytesMax, Need::required);
    const auto color = text ? rgb_from_hex(*text) : std::nullopt;
    if (text && !color) {
        table.fault("color", "is " + in_quotes(*text) +
                                 "; it must be \"#rrggbb\", two hexadecimal digits a channel");
    }
    return color.value_or(Rgb8{});
}

/// The texture's bytes, or nothing and what is wrong.
std::optional<std::vector<std::byte>> read_texture_file(const std::filesystem::path& path,
                                                        std::string& wrong) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) {
        wrong = "there is no such file beside the world file";
        return std::nullopt;
    }
    const auto size_bytes = std::filesystem::file_size(path, error);
    if (error || size_bytes > kTextureBytesMax) {
        wrong = "is too long; at most " + std::to_string(kTextureBytesMax) + " bytes are allowed";
        return std::nullopt;
    }
    std::vector<std::byte> bytes(size_bytes);
    std::ifstream in(path, std::ios::binary);
    in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (!in || static_cast<std::size_t>(in.gcount()) != bytes.size()) {
        wrong = "cannot be read";
        return std::nullopt;
    }
    return bytes;
}

std::string read_texture(WorldTable& table, const std::filesystem::path& folder, Seen& seen) {
    const auto name = table.text("texture", kNameBytesMax, Need::optional);
    if (!name) {
        return {};
    }
    if (name->starts_with('/') || name->find("..") != std::string::npos) {
        table.fault("texture", in_quotes(*name) +
                                   " leaves the world file's folder; it must be a file beside it, "
                                   "without a leading slash or \"..\"");
        return {};
    }
    if (seen.textures.contains(*name)) {
        return *name;
    }
    std::string wrong;
    auto bytes = read_texture_file(folder / *name, wrong);
    if (!bytes) {
        table.fault("texture", in_quotes(*name) + ": " + wrong);
        return {};
    }
    if (bytes->size() > kTexturesBytesMax - seen.textures_bytes) {
        table.fault("texture", in_quotes(*name) +
                                   ": the world's textures are too long together; at "
                                   "most " +
                                   std::to_string(kTexturesBytesMax) + " bytes are allowed");
        return {};
    }
    seen.textures_bytes += bytes->size();
    seen.textures.emplace(*name, std::move(*bytes));
    return *name;
}

/// Properties that the kind gives no meaning are checked if they are there, and then left at zero.
void read_properties(WorldTable& table, std::optional<MaterialKind> kind, std::int32_t format,
                     Material& material) {
    const bool alone = table.flag("alone").value_or(false);
    material.alone = alone && kind != MaterialKind::void_;
    const MaterialKeys keys = kind ? keys_of(*kind, material.alone) : MaterialKeys{};
    const auto share = [&](std::string_view key, bool applies, double& value) {
        const auto read = table.number(key, kShare, applies ? Need::required : Need::optional);
        value = applies ? read.value_or(0) : 0;
    };
    const auto range = [&](std::string_view key, bool applies, Range& value) {
        const auto read = table.range(key, applies ? Need::required : Need::optional);
        value = applies ? read.value_or(Range{}) : Range{};
    };
    const auto area = table.number("area", kShare, Need::optional);
    material.area = keys.area ? area.value_or(0) : 0;
    range("depth", keys.depth, material.depth);
    range("thickness", keys.thickness, material.thickness);
    range("roughness", keys.roughness, material.roughness);
    share("similarity", keys.similarity, material.similarity);
    share("blend", keys.blend, material.blend);
    if (format >= 2) {
        const auto hardness = table.number("hardness", kShare, Need::optional);
        const auto soluble = table.number("soluble", kShare, Need::optional);
        material.hardness = keys.hardness ? hardness.value_or(0.5) : 0.5;
        material.soluble = keys.hardness ? soluble.value_or(0) : 0;
    }
}

Material read_material(const toml::table& source, const std::filesystem::path& texture_folder,
                       WorldFaults& faults, Seen& seen) {
    WorldTable table(source, "material", faults);
    Material material;
    const auto id = table.integer("id",
                                  {.least = std::numeric_limits<std::int64_t>::min(),
                                   .most = std::numeric_limits<std::int64_t>::max()},
                                  Need::required);
    if (id && !seen.ids.insert(*id).second) {
        table.fault("id", std::to_string(*id) + " is taken; every material needs an id of its own");
    }
    const auto name = table.text("name", kNameBytesMax, Need::required);
    if (name && !seen.names.insert(*name).second) {
        table.fault("name", in_quotes(*name) + " is taken; every material needs a name of its own");
    }
    const auto kind = read_kind(table);
    if (!kind) {
        seen.all_kinds_known = false;
    } else if (++seen.kinds[*kind] == 2 && kind == MaterialKind::void_) {
        table.fault("kind", "is \"void\" a second time; exactly one void material is allowed");
    } else if (is_cover(*kind) && seen.format < 2) {
        table.fault("kind", "is " + in_quotes(to_string(*kind)) +
                                "; such materials need format = 2 at the file's head");
    } else if (is_cover(*kind) && seen.kinds[*kind] == 2) {
        table.fault("kind", "is " + in_quotes(to_string(*kind)) +
                                " a second time; one such material is allowed");
    }
    material.id = id.value_or(0);
    material.name = name.value_or("");
    material.kind = kind.value_or(MaterialKind::regular);
    material.color = read_color(table);
    material.texture = read_texture(table, texture_folder, seen);
    read_properties(table, kind, seen.format, material);
    table.finish();
    return material;
}

void check_kinds(const toml::array& source, const Seen& seen, WorldFaults& faults) {
    if (!seen.all_kinds_known) {
        return;  // the one that is missing may be the one that is misspelt
    }
    const toml::source_region& where = source.empty() ? source.source() : source.get(0)->source();
    const auto require = [&](MaterialKind kind, std::string_view needed) {
        if (!seen.kinds.contains(kind)) {
            faults.add(where, "material",
                       "no material is of kind " + in_quotes(to_string(kind)) + "; " +
                           std::string(needed));
        }
    };
    require(MaterialKind::void_, "exactly one is needed");
    require(MaterialKind::base, "at least one is needed");
    require(MaterialKind::regular, "at least one is needed");
}

}  // namespace

void read_materials(const toml::array& source, const std::filesystem::path& texture_folder,
                    WorldFaults& faults, WorldDefinition& world) {
    Seen seen;
    seen.format = world.format;
    for (const toml::node& node : source) {
        const toml::table* table = node.as_table();
        if (table == nullptr) {
            faults.add(node.source(), "material",
                       "is " + std::string(type_text(node)) +
                           "; it must be a [[material]] for each material");
            seen.all_kinds_known = false;
            continue;
        }
        world.materials.push_back(read_material(*table, texture_folder, faults, seen));
    }
    if (source.size() > kMaterialsMax) {
        faults.add(source.get(kMaterialsMax)->source(), "material",
                   "there are " + std::to_string(source.size()) + " materials; at most " +
                       std::to_string(kMaterialsMax) + " are allowed");
    }
    check_kinds(source, seen, faults);
    std::stable_sort(world.materials.begin(), world.materials.end(),
                     [](const Material& a, const Material& b) { return a.id < b.id; });
    for (const Material& material : world.materials) {
        const auto texture = seen.textures.extract(material.texture);
        if (!texture.empty()) {
            world.textures.push_back(
                {.name = material.texture, .bytes = std::move(texture.mapped())});
        }
    }
}

}  // namespace terrane
