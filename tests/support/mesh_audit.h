// Checks that meshes of neighbouring chunks make one surface: every edge has as many half-edges one
// way as the other, and a vertex that two chunks share is one vertex.
#pragma once

#include "generator/mesh/mesh.h"
#include "protocol/base/coords.h"

#include <algorithm>
#include <array>
#include <compare>
#include <cstdint>
#include <map>
#include <tuple>
#include <vector>

namespace terrane {

/// Collects the meshes of a box of chunks, side x side columns and height voxels each, and counts.
class MeshAudit {
  public:
    MeshAudit(std::int32_t side, std::int32_t height)
        : side256_(side * 256), height256_(height * 256) {}

    /// Each chunk once. Positions of `mesh` are relative to the chunk.
    void add(const Mesh& mesh, ChunkPos chunk) {
        const std::size_t first = half_edges_.size();
        for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
            for (std::size_t corner = 0; corner < 3; ++corner) {
                const Position a = position(mesh, mesh.indices[i + corner], chunk);
                const Position b = position(mesh, mesh.indices[i + (corner + 1) % 3], chunk);
                if (a == b) {
                    continue;  // rounding may leave an edge without length: it bounds nothing
                }
                half_edges_.push_back(a < b ? HalfEdge{a, b, 1} : HalfEdge{b, a, -1});
            }
        }
        std::vector<HalfEdge> own(half_edges_.begin() + static_cast<std::ptrdiff_t>(first),
                                  half_edges_.end());
        for_each_edge(own, [&](const HalfEdge& edge, std::int32_t balance) {
            if (!is_on_side(edge, chunk)) {
                ++interior_edges;
                open_interior_edges += balance != 0 ? 1 : 0;
            }
        });
        for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
            note_shared(mesh, i, chunk);
        }
        grow(chunk);
    }

    /// Edges with unbalanced half-edges that do not lie on the outside of all that was added.
    std::int64_t open_edges_inside() {
        std::int64_t open = 0;
        for_each_edge(half_edges_, [&](const HalfEdge& edge, std::int32_t balance) {
            open += balance != 0 && !is_on_outside(edge, least_, most_) ? 1 : 0;
        });
        return open;
    }

    std::int64_t interior_edges = 0;  ///< within one chunk, off its sides, floor and ceiling
    std::int64_t open_interior_edges = 0;
    std::int64_t shared_vertices = 0;  ///< made by two chunks or more, each further one counts
    std::int64_t different_vertices = 0;

  private:
    struct Position {
        std::int64_t x, y, z;
        friend auto operator<=>(const Position&, const Position&) = default;
    };

    struct HalfEdge {
        Position a, b;
        std::int32_t direction;
        friend auto operator<=>(const HalfEdge&, const HalfEdge&) = default;
    };

    using Looks = std::tuple<Position, std::array<float, 3>, std::array<int, 4>>;

    Position position(const Mesh& mesh, std::size_t index, ChunkPos chunk) const {
        const glm::i32vec3& p = mesh.positions256[index];
        return {p.x + std::int64_t{chunk.x} * side256_, p.y + std::int64_t{chunk.y} * height256_,
                p.z + std::int64_t{chunk.z} * side256_};
    }

    template <typename Visit>
    static void for_each_edge(std::vector<HalfEdge>& half_edges, Visit visit) {
        std::sort(half_edges.begin(), half_edges.end());
        for (std::size_t i = 0; i < half_edges.size();) {
            std::int32_t balance = 0;
            std::size_t next = i;
            while (next < half_edges.size() && half_edges[next].a == half_edges[i].a &&
                   half_edges[next].b == half_edges[i].b) {
                balance += half_edges[next++].direction;
            }
            visit(half_edges[i], balance);
            i = next;
        }
    }

    /// The cell layer of a height: cells -1 (under the floor) and the last are shared upright.
    static std::int64_t layer(std::int64_t y256) { return floor_div(y256, 256); }

    bool is_on_side(const HalfEdge& edge, ChunkPos chunk) const {
        return is_on_outside(edge, chunk, chunk);
    }

    /// True on the outside of the box of chunks from `least` to `most`.
    bool is_on_outside(const HalfEdge& edge, ChunkPos least, ChunkPos most) const {
        const auto both = [](std::int64_t a, std::int64_t b, std::int64_t value) {
            return a == value && b == value;
        };
        return both(edge.a.x, edge.b.x, least.x * side256_) ||
               both(edge.a.x, edge.b.x, (most.x + 1) * side256_) ||
               both(edge.a.z, edge.b.z, least.z * side256_) ||
               both(edge.a.z, edge.b.z, (most.z + 1) * side256_) ||
               both(layer(edge.a.y), layer(edge.b.y), layer(least.y * height256_) - 1) ||
               both(layer(edge.a.y), layer(edge.b.y), layer((most.y + 1) * height256_) - 1);
    }

    void note_shared(const Mesh& mesh, std::size_t index, ChunkPos chunk) {
        const glm::i32vec3& local = mesh.positions256[index];
        const bool is_shared = local.x == 0 || local.x == side256_ || local.z == 0 ||
                               local.z == side256_ || local.y < 0 || local.y >= height256_ - 256;
        if (!is_shared) {
            return;
        }
        const Position at = position(mesh, index, chunk);
        // One vertex a cell: cells lie between columns, which stand at half voxels.
        const Position cell = {floor_div(at.x - 128, 256), layer(at.y), floor_div(at.z - 128, 256)};
        const glm::vec3& n = mesh.normals[index];
        const glm::u8vec3& c = mesh.colors[index];
        const Looks looks{at, {n.x, n.y, n.z}, {c.x, c.y, c.z, mesh.material_ids[index]}};
        const auto [known, is_new] = shared_.try_emplace(cell, looks);
        if (!is_new) {
            ++shared_vertices;
            different_vertices += known->second != looks ? 1 : 0;
        }
    }

    void grow(ChunkPos chunk) {
        least_ = is_empty_ ? chunk
                           : ChunkPos{0, std::min(least_.x, chunk.x), std::min(least_.y, chunk.y),
                                      std::min(least_.z, chunk.z)};
        most_ = is_empty_ ? chunk
                          : ChunkPos{0, std::max(most_.x, chunk.x), std::max(most_.y, chunk.y),
                                     std::max(most_.z, chunk.z)};
        is_empty_ = false;
    }

    std::int64_t side256_;
    std::int64_t height256_;
    bool is_empty_ = true;
    ChunkPos least_;
    ChunkPos most_;
    std::vector<HalfEdge> half_edges_;
    std::map<Position, Looks> shared_;
};

}  // namespace terrane
