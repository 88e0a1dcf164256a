// What a terrain designer wrote: a world file's values, checked. Plain data, immutable once made.
//
// Source: Santamaría-Ibirika et al., "Procedural approach to volumetric terrain generation", 2013:
// material data (4.1.1) and general parameters (4.1.2). The file format is in WORLD_FILE.md.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace terrane {

inline constexpr std::size_t kMaterialsMax = 256;
inline constexpr std::int32_t kHeightBoundMax = 16384;  ///< voxels
inline constexpr std::int32_t kChunkSideMin = 4;        ///< columns or voxels
inline constexpr std::int32_t kChunkSideMax = 64;       ///< columns or voxels

enum class MaterialKind : std::uint8_t { void_, base, regular, vein, cave };

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

/// A texture's bytes as they lie beside the world file; they enter the fingerprint.
struct Texture {
    std::string name;
    std::vector<std::byte> bytes;

    friend bool operator==(const Texture&, const Texture&) = default;
};

struct WorldDefinition {
    std::string name;
    std::uint64_t seed = 0;  ///< the file's signed integer, cast
    TerrainParameters terrain;
    Grid grid;
    std::vector<Material> materials;  ///< ascending id; at most kMaterialsMax
    /// Affinities between materials by index, row-major materials x materials, symmetric:
    /// 0..1, or -1 for "never together".
    std::vector<double> same_layer;
    std::vector<double> next_layer;
    std::vector<Texture> textures;  ///< each distinct name once, in order of first use

    double same_layer_affinity(std::size_t a, std::size_t b) const {
        return same_layer[a * materials.size() + b];
    }

    double next_layer_affinity(std::size_t a, std::size_t b) const {
        return next_layer[a * materials.size() + b];
    }

    friend bool operator==(const WorldDefinition&, const WorldDefinition&) = default;
};

}  // namespace terrane
