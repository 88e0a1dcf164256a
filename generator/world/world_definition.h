// What a terrain designer wrote: a world file's values, checked. Plain data, immutable once made.
//
// Source: Santamaría-Ibirika et al., "Procedural approach to volumetric terrain generation", 2013:
// material data (4.1.1) and general parameters (4.1.2). The file format is in WORLD_FILE.md.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace terrane {

inline constexpr std::size_t kMaterialsMax = 256;
inline constexpr std::int32_t kHeightBoundMax = 16384;  ///< voxels
inline constexpr std::int32_t kChunkSideMin = 4;        ///< columns or voxels
inline constexpr std::int32_t kChunkSideMax = 64;       ///< columns or voxels

/// The last four lie on the ground of a landscape (format 2); one of each at most.
enum class MaterialKind : std::uint8_t {
    void_,
    base,
    regular,
    vein,
    cave,
    soil,
    sand,
    snow,
    water
};

/// Whether one can stand on it.
constexpr bool is_solid(MaterialKind kind) {
    return kind != MaterialKind::void_ && kind != MaterialKind::cave && kind != MaterialKind::water;
}

/// Least, best and most of a property; 0 <= least <= best <= most <= 1.
struct Range {
    double least = 0;
    double best = 0;
    double most = 0;

    friend bool operator==(const Range&, const Range&) = default;
};

/// sRGB as written in the file.
struct Rgb8 {
    std::uint8_t r = 0;
    std::uint8_t g = 0;
    std::uint8_t b = 0;

    friend bool operator==(const Rgb8&, const Rgb8&) = default;
};

struct Material {
    std::int64_t id = 0;  ///< unique; fixes the order in which materials are considered
    std::string name;     ///< unique
    Rgb8 color;
    std::string texture;  ///< file name beside the world file, or empty
    MaterialKind kind = MaterialKind::regular;
    bool alone = false;  ///< never mixed with another material
    double area = 0;     ///< vein and cave: share of the general area
    Range depth;         ///< 0 surface, 1 bottom
    Range thickness;
    Range roughness;
    double similarity = 0;
    double blend = 0;
    double hardness = 0.5;  ///< 0..1: how a layer of it stands against rivers (format 2)
    double soluble = 0;     ///< 0..1: how gladly caves form in it (format 2)

    friend bool operator==(const Material&, const Material&) = default;
};

/// Section 4.1.2 of the paper; lengths in voxels.
struct TerrainParameters {
    double depth = 0;
    double scale = 0;
    std::int32_t octaves = 1;
    double layer_thickness = 0;
    double layer_similarity = 1;
    double roughness = 0;
    double vein_area = 0;
    double cave_area = 0;
    double vein_thickness = 0;
    double cave_thickness = 0;
    double vein_density = 0;
    double cave_density = 0;

    friend bool operator==(const TerrainParameters&, const TerrainParameters&) = default;
};

struct Grid {
    std::int32_t side = 32;    ///< N = L: columns along x and z of a chunk, 4..64
    std::int32_t height = 32;  ///< M: voxels along y of a chunk, 4..64
    std::int32_t plot = 160;   ///< columns along a plot's side, 4..4096
    double voxel_size_m = 1.0;

    friend bool operator==(const Grid&, const Grid&) = default;
};

/// Format 2: what became of the stack. Every default leaves it as it was laid down.
struct StructureParameters {
    double fold = 0;              ///< voxels: half the height of the folds
    double fold_length = 400;     ///< columns from crest to crest
    double fold_direction = 0.1;  ///< turns from +x: across the crests
    double fault_density = 0;     ///< fractures in 512 x 512 columns
    double fault_throw = 0;       ///< voxels
    double fault_length = 400;    ///< columns from the middle to the tip
    double fault_dip = 3;         ///< tangent of their slope
    double sheet = 0;             ///< voxels: thickness of mineral sheets on fractures
    bool lift = true;             ///< veins and caves lift what is above them, as in format 1

    friend bool operator==(const StructureParameters&, const StructureParameters&) = default;
};

/// Format 2: the surface that rivers cut.
struct ReliefParameters {
    double height = 0;        ///< voxels from river to crest; 0 is off: the stack's own top
    double ground = 0;        ///< voxels: mean height of the rivers
    double fall = 0;          ///< voxels: their range
    double valley = 192;      ///< columns between rivers
    double province = 1536;   ///< columns from plains to mountains
    double plateau = 0;       ///< 0 crests, 1 table tops
    double rivers = 0;        ///< columns: half the width of a small river
    double gullies = 0;       ///< voxels
    double gully_scale = 96;  ///< columns
    std::int32_t gully_octaves = 4;
    double cliffs = 0;          ///< 0..0.8: how far hardness shapes the slopes
    std::int32_t overhang = 0;  ///< columns: how far hard layers may lean out
    std::optional<double> sea_level;
    std::optional<double> snow_line;
    double soil = 0;  ///< voxels

    friend bool operator==(const ReliefParameters&, const ReliefParameters&) = default;
};

/// Format 2: caves that join to systems.
struct CaveParameters {
    std::int32_t cell = 0;  ///< columns between two nodes; 0 is off
    double radius = 4;      ///< voxels
    double density = 0.7;   ///< chance that there is a node in a cell
    double connect = 0.75;  ///< chance of a tube to the next node
    double shaft = 0.25;    ///< chance of a shaft to the level above
    double chamber = 0.2;   ///< chance that a node is a chamber
    double sink = 0.1;      ///< chance that a node of the highest level opens to the sky
    std::int32_t levels = 4;
    double water_table = 3;  ///< voxels below the river: what is deeper is flooded

    friend bool operator==(const CaveParameters&, const CaveParameters&) = default;
};

/// A texture's bytes as they lie beside the world file; they enter the fingerprint.
struct Texture {
    std::string name;
    std::vector<std::byte> bytes;

    friend bool operator==(const Texture&, const Texture&) = default;
};

struct WorldDefinition {
    std::int32_t format = 1;  ///< of the file; 1 has no structure, relief and caves
    std::string name;
    std::uint64_t seed = 0;  ///< the file's signed integer, cast
    TerrainParameters terrain;
    StructureParameters structure;
    ReliefParameters relief;
    CaveParameters caves;
    Grid grid;
    std::vector<Material> materials;  ///< ascending id; at most kMaterialsMax
    /// Affinities between materials by index, row-major materials x materials, symmetric:
    /// 0..1, or -1 for "never together".
    std::vector<double> same_layer;
    std::vector<double> next_layer;
    std::vector<Texture> textures;  ///< each distinct name once, in order of first use

    /// Whether anything bends, cuts or pierces the stack. If nothing does, columns are format 1's.
    bool has_landscape() const {
        return relief.height > 0 || structure.fold > 0 || structure.fault_density > 0 ||
               caves.cell > 0;
    }

    double same_layer_affinity(std::size_t a, std::size_t b) const {
        return same_layer[a * materials.size() + b];
    }

    double next_layer_affinity(std::size_t a, std::size_t b) const {
        return next_layer[a * materials.size() + b];
    }

    friend bool operator==(const WorldDefinition&, const WorldDefinition&) = default;
};

}  // namespace terrane
