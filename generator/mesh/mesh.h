// A triangle mesh of one chunk: what the mesher gives and the encoders take.
//
// Positions are 1/256 voxel, relative to the chunk's own corner (x, z) and floor (y); the same
// crossing has the same world position in every chunk that shares it.
#pragma once

#include <glm/vec3.hpp>

#include <algorithm>
#include <cstdint>
#include <vector>

namespace terrane {

/// What a surface is of. No triangle has corners of water and others; one that has corners of a
/// cave and of the ground is ground.
enum class MeshPart : std::uint8_t {
    ground = 0,
    cave = 1,  ///< under kCaveRoofVoxels of rock or more: not seen from above the ground; and level
               ///< 1's walls, see height_field.h
    water = 2,  ///< the water's own surface: to be seen, not to be walked on
};

inline constexpr std::int32_t kCaveRoofVoxels = 24;

struct Mesh {
    std::vector<glm::i32vec3> positions256;  ///< one per vertex
    std::vector<glm::vec3> normals;          ///< unit length, out of the solid
    std::vector<glm::u8vec3> colors;         ///< linear light, 0..255
    std::vector<std::uint8_t> material_ids;  ///< main material, index into the definition
    /// One per vertex; none at all in worlds without a landscape: ground.
    std::vector<MeshPart> parts;
    std::vector<std::uint32_t> indices;  ///< triangles, counter-clockwise seen from outside

    std::size_t vertex_count() const { return positions256.size(); }

    std::size_t triangle_count() const { return indices.size() / 3; }

    MeshPart part(std::size_t vertex) const {
        return parts.empty() ? MeshPart::ground : parts[vertex];
    }

    /// Of triangle i: the least of its corners', so that what joins a cave to the ground is ground.
    MeshPart part_of_triangle(std::size_t i) const {
        return std::min({part(indices[3 * i]), part(indices[3 * i + 1]), part(indices[3 * i + 2])});
    }

    void clear() {
        positions256.clear();
        normals.clear();
        colors.clear();
        material_ids.clear();
        parts.clear();
        indices.clear();
    }
};

}  // namespace terrane
