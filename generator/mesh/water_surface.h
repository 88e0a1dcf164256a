// The water's own surface: where water meets air, beside the ground's surface and apart from it.
//
// Water is a hollow for who walks, so the ground's mesh has its bed. At level 0 every wet column
// has a square over it, as wide as the column; a corner lies at the mean of those of the four
// columns around it whose water stands at nearly one level, so that rivers slope without steps and
// all stacks that share the corner make the same one. Where the ground or the water next door lies
// lower, a strip hangs down to it. Above level 0 open water is stretched between the columns
// themselves, as the height field is, and runs out under its banks.
#pragma once

#include "generator/mesh/mesh.h"
#include "generator/mesh/shade.h"
#include "generator/volume/stack.h"
#include "generator/world/world_definition.h"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace terrane {

/// Heights first <= y < last, in voxels.
struct HeightRange {
    std::int64_t first = 0;
    std::int64_t last = 0;

    friend bool operator==(const HeightRange&, const HeightRange&) = default;
};

/// One worker's; belongs to one thread at a time. Once its buffers have grown to the wettest stack
/// seen, it allocates nothing. Of worlds without water it appends nothing.
class WaterSurface {
  public:
    explicit WaterSurface(const WorldDefinition& definition);

    /// Appends the surfaces that lie in the heights, at -256 <= y <= 256 * (last - first), in 1/256
    /// voxel over heights.first.
    void append(Mesh& out, const Stack& stack, HeightRange heights);

    /// For a stack above level 0: the open water of all heights.
    void append_coarse(Mesh& out, const Stack& stack);

  private:
    struct Corner {
        std::int32_t y256 = 0;
        std::uint32_t vertex = 0;
        std::uint32_t next = 0;  ///< another of the same place
    };

    bool find_wet_entries(const Palette& palette);
    /// False if nothing is wet.
    bool find_levels(const Stack& stack);
    std::span<const std::int32_t> levels_of(const Stack& stack, std::int32_t x,
                                            std::int32_t z) const;
    std::int32_t corner_height(const Stack& stack, std::int32_t x, std::int32_t z,
                               std::int32_t level256, HeightRange heights) const;
    void forget_corners(std::int32_t side);
    std::uint32_t corner(Mesh& out, std::int32_t x, std::int32_t z, std::int32_t y256,
                         std::int32_t side);
    std::uint32_t add_vertex(Mesh& out, glm::i32vec3 position, glm::vec3 normal) const;
    void add_strips(Mesh& out, const Stack& stack, std::int32_t x, std::int32_t z,
                    std::int32_t level256, const std::array<std::int32_t, 4>& heights256,
                    std::int32_t floor256) const;
    std::int32_t rest_under(const Stack& stack, std::int32_t x, std::int32_t z,
                            std::int32_t level256) const;

    std::optional<std::uint16_t> material_;
    Shade shade_;
    enum class Content : std::uint8_t { solid, air, water };
    std::vector<Content> contents_;  ///< by palette id
    std::vector<std::uint32_t> level_begin_;
    std::vector<std::int32_t> levels256_;
    std::vector<std::uint32_t> first_corner_;
    std::vector<Corner> corners_;
};

}  // namespace terrane
