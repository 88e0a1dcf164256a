// Worlds in tests are drawn: rows of letters are a vertical cut through a stack, one letter a
// voxel.
//
// '.' is void, 'o' a cave, other small letters are layers and capitals veins; every letter is a
// material and a composition of its own. Rows come top first and lie on y = 0.
#pragma once

#include "generator/volume/stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/check.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

/// The letters a test draws with, as materials and as a palette in a world's order.
class Letters {
  public:
    explicit Letters(std::string_view letters) {
        std::set<char> layers;
        std::set<char> elements;
        for (const char letter : letters) {
            if (letter != '.') {
                const bool is_element = letter == 'o' || std::isupper(letter) != 0;
                (is_element ? elements : layers).insert(letter);
            }
        }
        for (const char letter : layers) {
            add(letter, PaletteKind::layer, MaterialKind::regular);
        }
        add('.', PaletteKind::void_, MaterialKind::void_);
        for (const char letter : elements) {
            const bool is_cave = letter == 'o';
            add(letter, is_cave ? PaletteKind::cave : PaletteKind::vein,
                is_cave ? MaterialKind::cave : MaterialKind::vein);
        }
    }

    const WorldDefinition& definition() const { return definition_; }

    const Palette& palette() const { return palette_; }

    std::uint16_t id(char letter) const {
        const std::size_t at = order_.find(letter);
        TERRANE_ASSERT(at != std::string::npos);
        return static_cast<std::uint16_t>(at);
    }

    /// The limits of a column given bottom first, sharp, one letter a voxel.
    std::vector<Limit> column(std::string_view bottom_first) const {
        std::vector<Limit> limits;
        const std::size_t top = bottom_first.find_last_not_of('.') + 1;
        std::int32_t y256 = 0;
        for (std::size_t i = 0; i < top; ++i, y256 += kUnitsPerVoxel) {
            if (i == 0 || bottom_first[i] != bottom_first[i - 1]) {
                if (i > 0) {
                    limits.push_back(
                        {.y256 = y256, .palette_id = id(bottom_first[i - 1]), .flow = {}});
                }
                limits.push_back({.y256 = y256, .palette_id = id(bottom_first[i]), .flow = {}});
            }
        }
        if (top > 0) {
            limits.push_back({.y256 = y256, .palette_id = id(bottom_first[top - 1]), .flow = {}});
        }
        limits.push_back({.y256 = y256, .palette_id = id('.'), .flow = {}});
        return limits;
    }

  private:
    void add(char letter, PaletteKind kind, MaterialKind material_kind) {
        const auto index = static_cast<std::uint16_t>(order_.size());
        const auto shade = static_cast<std::uint8_t>(letter);
        Material material;
        material.id = index;
        material.name = std::string(1, letter);
        material.color = {.r = shade,
                          .g = static_cast<std::uint8_t>(2 * shade),
                          .b = index == 0 ? shade : std::uint8_t{9}};
        material.kind = material_kind;
        definition_.materials.push_back(material);
        PaletteEntry entry;
        entry.kind = kind;
        entry.composition.add(index, 1.0);
        palette_.push_back(entry);
        order_ += letter;
    }

    WorldDefinition definition_;
    Palette palette_;
    std::string order_;
};

/// Limits of the column at world coordinates.
using ColumnFunction = std::function<std::vector<Limit>(ColumnPos)>;

/// A stack of N x N columns with its apron, every column asked from `limits_at`.
inline Stack stack_of_columns(StackPos position, std::int32_t side, const Palette& palette,
                              const ColumnFunction& limits_at) {
    Stack stack;
    stack.position = position;
    stack.side = side;
    stack.palette = palette;
    ColumnGrid& grid = stack.columns;
    grid.x_first = -1;
    grid.z_first = -1;
    grid.width = side + 2;
    grid.length = side + 2;
    grid.offsets.push_back(0);
    const ColumnPos first = first_column_of(position, side);
    for (std::int32_t z = -1; z <= side; ++z) {
        for (std::int32_t x = -1; x <= side; ++x) {
            const std::vector<Limit> column = limits_at({.x = first.x + x, .z = first.z + z});
            grid.limits.insert(grid.limits.end(), column.begin(), column.end());
            grid.offsets.push_back(static_cast<std::uint32_t>(grid.limits.size()));
            if (x >= 0 && x < side && z >= 0 && z < side) {
                stack.highest_y256 = std::max(stack.highest_y256, column.back().y256);
            }
        }
    }
    return stack;
}

/// A stack whose every row along x is this cut: N + 2 letters wide, the apron's columns included.
inline Stack stack_of_cut(const Letters& letters, const std::vector<std::string_view>& rows) {
    const auto side = static_cast<std::int32_t>(rows.front().size()) - 2;
    return stack_of_columns({}, side, letters.palette(), [&](ColumnPos at) {
        std::string bottom_first;
        for (auto row = rows.rbegin(); row != rows.rend(); ++row) {
            TERRANE_ASSERT(row->size() == rows.front().size());
            bottom_first += (*row)[static_cast<std::size_t>(at.x + 1)];
        }
        return letters.column(bottom_first);
    });
}

}  // namespace terrane
