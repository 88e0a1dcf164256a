// World files: TOML in, a checked WorldDefinition or every fault at once out. See WORLD_FILE.md.
#pragma once

#include "generator/world/world_definition.h"
#include "protocol/base/hash.h"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

/// What a world file may hold. Lengths in voxels; each pair is the least and the most allowed.
inline constexpr std::int64_t kWorldFileFormatMin = 1;
inline constexpr std::int64_t kWorldFileFormatMax = 2;
inline constexpr std::size_t kWorldFileBytesMax = std::size_t{1} << 20U;
inline constexpr std::size_t kTextureBytesMax = std::size_t{4} << 20U;
/// All textures of a world together: a build holds them in memory.
inline constexpr std::size_t kTexturesBytesMax = std::size_t{64} << 20U;
inline constexpr std::size_t kNameBytesMax = 128;
inline constexpr double kDepthMin = 2;
inline constexpr double kDepthMax = 4096;
inline constexpr double kScaleMin = 2;
inline constexpr double kScaleMax = 1 << 20;
inline constexpr std::int64_t kOctavesMin = 1;
inline constexpr std::int64_t kOctavesMax = 6;
/// Of thickness, roughness and area: each is at least 0.
inline constexpr double kLengthScaleMax = 4096;
inline constexpr double kDensityMax = 64;
inline constexpr double kLayerSimilarityMax = 16;
inline constexpr std::int64_t kPlotMin = 4;
inline constexpr std::int64_t kPlotMax = 4096;
inline constexpr double kVoxelSizeMinM = 0.001;
inline constexpr double kVoxelSizeMaxM = 1000;

/// Of format 2. Lengths that are not named here are 0 to kLengthScaleMax.
inline constexpr double kReliefHeightMax = 2048;
inline constexpr double kValleyMin = 64;
inline constexpr double kValleyMax = 2048;
inline constexpr double kProvinceMin = 256;
inline constexpr double kProvinceMax = 65536;
inline constexpr double kRiversMax = 16;
inline constexpr double kGulliesMax = 512;
inline constexpr double kGullyScaleMin = 16;
inline constexpr double kCliffsMax = 0.8;
inline constexpr std::int64_t kOverhangMax = 6;
inline constexpr double kSoilMax = 64;
inline constexpr double kFoldMax = 1024;
inline constexpr double kFoldLengthMin = 32;
inline constexpr double kFaultDensityMax = 16;
inline constexpr double kFaultThrowMax = 512;
inline constexpr double kFaultLengthMin = 16;
inline constexpr double kFaultDipMin = 1;
inline constexpr double kFaultDipMax = 8;
inline constexpr double kSheetMax = 64;
inline constexpr std::int64_t kCaveCellMin = 32;  ///< or 0: no caves
inline constexpr std::int64_t kCaveCellMax = 512;
inline constexpr double kCaveRadiusMax = 24;
inline constexpr std::int64_t kCaveLevelsMax = 8;

/// One thing wrong in a world file; line and column count from 1. A fault of the whole file stands
/// at line 1, column 1, a missing key at its table.
struct WorldFileFault {
    std::string file;
    int line = 0;
    int column = 0;
    std::string key;
    std::string message;  ///< what is wrong, what is allowed

    /// "file:line:column: key: message"
    std::string text() const;
};

/// Either `faults` is empty and `definition` is whole, or `faults` has everything that is wrong, in
/// the order of the file.
struct WorldFileResult {
    WorldDefinition definition;
    std::vector<WorldFileFault> faults;
    /// Where [terrain] stands: faults found only when the world is built are reported there.
    int terrain_line = 1;
    int terrain_column = 1;

    bool ok() const { return faults.empty(); }
};

/// Reads the file and its textures (names relative to its folder). A file that cannot be read is a
/// fault like any other.
WorldFileResult load_world_file(const std::filesystem::path& path);

/// Parses text as if it were the file `name`; textures are looked for in `texture_folder`.
WorldFileResult parse_world_file(std::string_view text, std::string_view name,
                                 const std::filesystem::path& texture_folder);

/// The canonical world file: parsed values in a fixed order, comments and spacing gone, keys that
/// do not apply to a material's kind left out. Parsing it gives the same definition.
std::string canonical_world_file(const WorldDefinition& definition);

/// XXH3-128 of the canonical form, the textures' bytes and the generator version.
Hash128 world_fingerprint(const WorldDefinition& definition);

/// A kind as it stands in a world file: "void", "base", "regular", "vein", "cave", "soil", "sand",
/// "snow" or "water".
std::string_view to_string(MaterialKind kind);

/// Which of a material's keys mean anything; the others are accepted and ignored.
struct MaterialKeys {
    bool area = false;
    bool depth = false;
    bool thickness = false;
    bool roughness = false;
    bool similarity = false;
    bool blend = false;
    bool hardness = false;  ///< and soluble; format 2 only
};

/// An `alone` material never blends.
MaterialKeys keys_of(MaterialKind kind, bool alone);

}  // namespace terrane
