// A triangle mesh of one chunk: what the mesher gives and the encoders take.
//
// Positions are 1/256 voxel, relative to the chunk's own corner (x, z) and floor (y); the same
// crossing has the same world position in every chunk that shares it.
#pragma once

#include <glm/vec3.hpp>

#include <cstdint>
#include <vector>

namespace terrane {

struct Mesh {
    std::vector<glm::i32vec3> positions256;  ///< one per vertex
    std::vector<glm::vec3> normals;          ///< unit length, out of the solid
    std::vector<glm::u8vec3> colors;         ///< linear light, 0..255
    std::vector<std::uint8_t> material_ids;  ///< main material, index into the definition
    std::vector<std::uint32_t> indices;      ///< triangles, counter-clockwise seen from outside

    std::size_t vertex_count() const { return positions256.size(); }

    std::size_t triangle_count() const { return indices.size() / 3; }

    void clear() {
        positions256.clear();
        normals.clear();
        colors.clear();
        material_ids.clear();
        indices.clear();
    }
};

}  // namespace terrane
