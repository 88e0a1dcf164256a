// Which lattice edges the surface crosses and which cells it passes through, as bits: 64 heights of
// a column at a time.
//
// An edge belongs to the tile and height range that hold its first point, so that every quad of the
// world is made exactly once. The lowest cells lie one point below the first owned one:
// they are shared with the range below.
#pragma once

#include "generator/mesh/solid_mask.h"
#include "generator/mesh/surface_nets.h"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {

using Word = std::uint64_t;

/// Words laid out like SolidMask's: [z][word][x].
struct WordGrid {
    std::size_t words = 0;
    std::size_t width = 0;
    std::vector<Word> bits;

    void reset(std::size_t width_columns, std::size_t length_columns, std::size_t words_each) {
        words = words_each;
        width = width_columns;
        bits.resize(width_columns * length_columns * words_each);
    }

    Word* row(std::size_t z, std::size_t word) { return bits.data() + (z * words + word) * width; }

    const Word* row(std::size_t z, std::size_t word) const {
        return bits.data() + (z * words + word) * width;
    }
};

/// The owned crossed edges, by their first point: upwards, along x, along z. The apron's are 0.
struct EdgeMasks {
    WordGrid upright;
    WordGrid along_x;
    WordGrid along_z;
};

/// Cell i lies between columns i and i + 1, of N + 2 in a row; there are N + 1 of them.
struct Cells {
    WordGrid used;
    std::vector<std::uint32_t> first_vertex;  ///< index of the lowest vertex of a word, like `used`
    std::size_t vertex_count = 0;
};

/// The heights that edges may start at.
struct Window {
    std::int32_t first_y = 0;  ///< voxels; owned points are first_y <= y < last_y
    std::int32_t last_y = 0;
    std::int32_t origin256 = 0;  ///< where the mesh's y = 0 is

    bool is_empty() const { return first_y >= last_y; }
};

/// `range` cut to the heights where anything can cross; empty if there are none.
Window window_of(const SolidColumns& columns, HeightRange range);

/// Overwrites `out` with the words in which columns of the window may differ from one another or
/// from themselves a voxel higher, in steps of 64 voxels from one under the window: stacks are
/// solid through and through for most of their height.
void find_words(std::vector<std::int32_t>& out, const SolidColumns& columns, const Window& window);

/// Overwrites `out`.
void find_edges(EdgeMasks& out, const SolidMask& solid, const Window& window);

/// Marks the cells around every owned edge: four beside an upright one, and beside a level one two
/// with their floor and two with their ceiling at its height. Numbers their vertices cell column by
/// cell column, upwards in each.
void find_cells(Cells& out, const EdgeMasks& edges, const SolidMask& solid);

std::size_t count_edges(const EdgeMasks& edges);

}  // namespace terrane
