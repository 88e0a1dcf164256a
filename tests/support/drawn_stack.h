// Stacks drawn by hand for tests: a string is one column, a letter a voxel, bottom first.
//
// 'a'..'z' are layers, 'A'..'Z' veins, '#' a cave and '.' the void; a run of one letter becomes two
// limits, so every frontier is sharp. Material i is called by its letter's palette position.
#pragma once

#include "generator/volume/stack.h"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

/// Layers a..c (palette 0..2), the void (3), veins A and B of one equal composition (4, 5), a cave
/// (6).
inline Palette drawn_palette() {
    const auto entry = [](std::uint16_t material, PaletteKind kind) {
        PaletteEntry made;
        made.composition.add(material, 1.0);
        made.kind = kind;
        return made;
    };
    Palette palette = {entry(0, PaletteKind::layer), entry(1, PaletteKind::layer),
                       entry(2, PaletteKind::layer), entry(3, PaletteKind::void_),
                       entry(4, PaletteKind::vein),  entry(4, PaletteKind::vein),
                       entry(5, PaletteKind::cave)};
    palette[1].composition = {};
    palette[1].composition.add(1, 0.75);
    palette[1].composition.add(0, 0.25);
    return palette;
}

inline std::uint16_t drawn_id(char letter) {
    return static_cast<std::uint16_t>(std::string_view("abc.AB#").find(letter));
}

inline Flow drawn_flow(char letter) {
    switch (letter) {
        case '.':
        case '#':
            return {};
        case 'a':
            return {.x = 127, .y = 0, .z = 0};
        case 'b':
            return {.x = 100, .y = -6, .z = 78};
        default:
            return {.x = -90, .y = 3, .z = -90};
    }
}

/// Sharp limits of the drawing, with the void on top.
inline std::vector<Limit> drawn_column(std::string_view drawing) {
    std::vector<Limit> limits;
    const auto add = [&](std::size_t y, char letter) {
        const Limit limit = {.y256 = static_cast<std::int32_t>(y) * kUnitsPerVoxel,
                             .palette_id = drawn_id(letter),
                             .flow = drawn_flow(letter)};
        if (limits.empty() || limits.back() != limit) {
            limits.push_back(limit);
        }
    };
    std::size_t begin = 0;
    while (begin < drawing.size()) {
        const std::size_t found = drawing.find_first_not_of(drawing[begin], begin);
        const std::size_t end = found == drawing.npos ? drawing.size() : found;
        add(begin, drawing[begin]);
        add(end, drawing[begin]);
        begin = end;
    }
    add(drawing.size(), '.');
    return limits;
}

/// A stack of side N whose (N+2) x (N+2) columns, apron included, are `columns` in raster order,
/// repeated as often as needed. The apron's flow is 0, as the generator leaves it.
inline Stack stack_of_columns(std::int32_t side, const std::vector<std::vector<Limit>>& columns,
                              Palette palette = drawn_palette()) {
    Stack stack;
    stack.position = {.lod = 0, .x = -3, .z = 5};
    stack.side = side;
    stack.palette = std::move(palette);
    stack.columns.x_first = stack.columns.z_first = -1;
    stack.columns.width = stack.columns.length = side + 2;
    stack.columns.offsets.push_back(0);
    std::size_t next = 0;
    for (std::int32_t z = -1; z <= side; ++z) {
        for (std::int32_t x = -1; x <= side; ++x) {
            const bool inside = x >= 0 && x < side && z >= 0 && z < side;
            for (Limit limit : columns[next % columns.size()]) {
                if (!inside) {
                    limit.flow = {};
                } else if (limit.y256 > stack.highest_y256) {
                    stack.highest_y256 = limit.y256;
                }
                stack.columns.limits.push_back(limit);
            }
            stack.columns.offsets.push_back(
                static_cast<std::uint32_t>(stack.columns.limits.size()));
            ++next;
        }
    }
    return stack;
}

inline Stack drawn_stack(std::int32_t side, const std::vector<std::string>& drawings) {
    std::vector<std::vector<Limit>> columns;
    for (const std::string& drawing : drawings) {
        columns.push_back(drawn_column(drawing));
    }
    return stack_of_columns(side, columns);
}

}  // namespace terrane
