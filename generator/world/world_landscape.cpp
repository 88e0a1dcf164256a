#include "generator/world/world_landscape.h"

#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "generator/world/world_table.h"

#include <toml++/toml.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace terrane {
namespace {

constexpr NumberBounds kLengths{.least = 0, .most = kLengthScaleMax};
constexpr NumberBounds kChances{.least = 0, .most = 1};

/// Optional keys: what is absent or wrong leaves the value as it is.
class OptionalKeys {
  public:
    OptionalKeys(const toml::table& source, std::string_view name, WorldFaults& faults)
        : table_(source, std::string(name), faults) {}

    void number(std::string_view key, NumberBounds bounds, double& value) {
        value = table_.number(key, bounds, Need::optional).value_or(value);
    }

    void level(std::string_view key, std::optional<double>& value) {
        value = table_.number(key, {.least = 0, .most = kHeightBoundMax}, Need::optional);
    }

    void integer(std::string_view key, WholeBounds bounds, std::int32_t& value) {
        value =
            static_cast<std::int32_t>(table_.integer(key, bounds, Need::optional).value_or(value));
    }

    void flag(std::string_view key, bool& value) { value = table_.flag(key).value_or(value); }

    WorldTable& table() { return table_; }

  private:
    WorldTable table_;
};

void read_structure(OptionalKeys keys, StructureParameters& structure) {
    keys.number("fold", {.least = 0, .most = kFoldMax}, structure.fold);
    keys.number("fold_length", {.least = kFoldLengthMin, .most = kScaleMax}, structure.fold_length);
    keys.number("fold_direction", kChances, structure.fold_direction);
    keys.number("fault_density", {.least = 0, .most = kFaultDensityMax}, structure.fault_density);
    keys.number("fault_throw", {.least = 0, .most = kFaultThrowMax}, structure.fault_throw);
    keys.number("fault_length", {.least = kFaultLengthMin, .most = kLengthScaleMax},
                structure.fault_length);
    keys.number("fault_dip", {.least = kFaultDipMin, .most = kFaultDipMax}, structure.fault_dip);
    keys.number("sheet", {.least = 0, .most = kSheetMax}, structure.sheet);
    keys.flag("lift", structure.lift);
    keys.table().finish();
}

void read_relief(OptionalKeys keys, double depth, ReliefParameters& relief) {
    keys.number("height", {.least = 0, .most = kReliefHeightMax}, relief.height);
    keys.number("ground", kLengths, relief.ground);
    keys.number("fall", kLengths, relief.fall);
    keys.number("valley", {.least = kValleyMin, .most = kValleyMax}, relief.valley);
    keys.number("province", {.least = kProvinceMin, .most = kProvinceMax}, relief.province);
    keys.number("plateau", kChances, relief.plateau);
    keys.number("rivers", {.least = 0, .most = kRiversMax}, relief.rivers);
    keys.number("gullies", {.least = 0, .most = kGulliesMax}, relief.gullies);
    keys.number("gully_scale", {.least = kGullyScaleMin, .most = kLengthScaleMax},
                relief.gully_scale);
    keys.integer("gully_octaves", {.least = kOctavesMin, .most = kOctavesMax},
                 relief.gully_octaves);
    keys.number("cliffs", {.least = 0, .most = kCliffsMax}, relief.cliffs);
    keys.integer("overhang", {.least = 0, .most = kOverhangMax}, relief.overhang);
    keys.level("sea_level", relief.sea_level);
    keys.level("snow_line", relief.snow_line);
    keys.number("soil", {.least = 0, .most = kSoilMax}, relief.soil);
    if (relief.height > 0 && depth > 0 && relief.ground + relief.fall > depth) {
        keys.table().fault("ground", "and fall bring rivers to height " +
                                         number_text(relief.ground + relief.fall) +
                                         "; they must run in the layers, whose depth is " +
                                         number_text(depth));
    }
    keys.table().finish();
}

void read_caves(OptionalKeys keys, CaveParameters& caves) {
    keys.integer("cell", {.least = 0, .most = kCaveCellMax}, caves.cell);
    if (caves.cell > 0 && caves.cell < kCaveCellMin) {
        keys.table().fault("cell", "is " + std::to_string(caves.cell) + "; it must be 0 or from " +
                                       std::to_string(kCaveCellMin) + " to " +
                                       std::to_string(kCaveCellMax));
    }
    keys.number("radius", {.least = 1, .most = kCaveRadiusMax}, caves.radius);
    keys.number("density", kChances, caves.density);
    keys.number("connect", kChances, caves.connect);
    keys.number("shaft", kChances, caves.shaft);
    keys.number("chamber", kChances, caves.chamber);
    keys.number("sink", kChances, caves.sink);
    keys.integer("levels", {.least = 1, .most = kCaveLevelsMax}, caves.levels);
    keys.number("water_table", kLengths, caves.water_table);
    keys.table().finish();
}

}  // namespace

LandscapeTables find_landscape(WorldTable& root, std::int32_t format) {
    const auto find = [&](std::string_view key) {
        const toml::table* found =
            root.table(key, "it must be a table of a landscape's parameters", Need::optional);
        if (found != nullptr && format < 2) {
            root.fault(key, "needs format = 2 at the file's head");
            found = nullptr;
        }
        return found;
    };
    return {.structure = find("structure"), .relief = find("relief"), .caves = find("caves")};
}

void read_landscape(const LandscapeTables& tables, WorldFaults& faults, WorldDefinition& world) {
    if (tables.structure != nullptr) {
        read_structure({*tables.structure, "structure", faults}, world.structure);
    }
    if (tables.relief != nullptr) {
        read_relief({*tables.relief, "relief", faults}, world.terrain.depth, world.relief);
    }
    if (tables.caves != nullptr) {
        read_caves({*tables.caves, "caves", faults}, world.caves);
    }
}

}  // namespace terrane
