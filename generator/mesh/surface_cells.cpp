#include "generator/mesh/surface_cells.h"

#include <algorithm>
#include <bit>

namespace terrane {
namespace {

void mark_cells(WordGrid& out, const EdgeMasks& edges) {
    const std::size_t width = edges.upright.width;
    const std::size_t words = edges.upright.words;
    out.reset(width, width - 1, words);
    for (std::size_t z = 0; z + 1 < width; ++z) {
        for (std::size_t word = 0; word < words; ++word) {
            const Word* const upright0 = edges.upright.row(z, word);
            const Word* const upright1 = edges.upright.row(z + 1, word);
            const Word* const x0 = edges.along_x.row(z, word);
            const Word* const x1 = edges.along_x.row(z + 1, word);
            const Word* const z0 = edges.along_z.row(z, word);
            // Above the last word nothing is owned; row 0 holds the apron, which is empty.
            const bool is_last = word + 1 == words;
            const std::size_t z_above = is_last ? 0 : z;
            const std::size_t word_above = is_last ? 0 : word + 1;
            const Word* const x0_above = edges.along_x.row(z_above, word_above);
            const Word* const x1_above = edges.along_x.row(is_last ? 0 : z + 1, word_above);
            const Word* const z0_above = edges.along_z.row(z_above, word_above);
            Word* const used = out.row(z, word);
            used[width - 1] = 0;
            for (std::size_t x = 0; x + 1 < width; ++x) {
                const Word level = x0[x] | x1[x] | z0[x] | z0[x + 1];
                const Word above = x0_above[x] | x1_above[x] | z0_above[x] | z0_above[x + 1];
                used[x] = upright0[x] | upright0[x + 1] | upright1[x] | upright1[x + 1] | level |
                          level >> 1 | above << 63;
            }
        }
    }
}

void number_vertices(Cells& cells) {
    const std::size_t width = cells.used.width;
    const std::size_t words = cells.used.words;
    cells.first_vertex.resize(cells.used.bits.size());
    std::uint32_t next = 0;
    for (std::size_t z = 0; z + 1 < width; ++z) {
        for (std::size_t x = 0; x + 1 < width; ++x) {
            for (std::size_t word = 0; word < words; ++word) {
                const std::size_t at = (z * words + word) * width + x;
                cells.first_vertex[at] = next;
                next += static_cast<std::uint32_t>(std::popcount(cells.used.bits[at]));
            }
        }
    }
    cells.vertex_count = next;
}

}  // namespace

Word Window::owned(std::size_t word) const {
    const auto below = [word](std::size_t end) {
        const std::size_t base = word * 64;
        return end <= base ? Word{0} : end >= base + 64 ? ~Word{0} : (Word{1} << (end - base)) - 1;
    };
    return below(points + 1) & ~below(1);
}

/// `range` cut to the heights where anything can cross; no points if there are none.
Window window_of(const SolidColumns& columns, HeightRange range) {
    const std::int64_t first = std::max<std::int64_t>(range.first, columns.lowest256 >> 8);
    const std::int64_t last = std::min<std::int64_t>(range.last, (columns.highest256 >> 8) + 1);
    if (first >= last) {
        return {};
    }
    return {.bit0_y = static_cast<std::int32_t>(first - 1),
            .points = static_cast<std::size_t>(last - first),
            .origin256 = static_cast<std::int32_t>((range.first - (first - 1)) * kUnitsPerVoxel)};
}

void find_edges(EdgeMasks& out, const SolidMask& solid, const Window& window) {
    const std::size_t width = solid.width;
    const std::size_t side = width - 2;
    for (WordGrid* grid : {&out.upright, &out.along_x, &out.along_z}) {
        grid->reset(width, width, solid.words);
        std::fill_n(grid->row(0, 0), width * solid.words, Word{0});
        std::fill_n(grid->row(side + 1, 0), width * solid.words, Word{0});
    }
    for (std::size_t z = 1; z <= side; ++z) {
        for (std::size_t word = 0; word < solid.words; ++word) {
            const Word owned = window.owned(word);
            const Word* const here = solid.row(z, word);
            const Word* const next_z = solid.row(z + 1, word);
            // The last word's last bit is never owned, so what is carried into it does not matter.
            const Word* const above = solid.row(z, std::min(word + 1, solid.words - 1));
            Word* const upright = out.upright.row(z, word);
            Word* const along_x = out.along_x.row(z, word);
            Word* const along_z = out.along_z.row(z, word);
            for (WordGrid* grid : {&out.upright, &out.along_x, &out.along_z}) {
                grid->row(z, word)[0] = 0;
                grid->row(z, word)[side + 1] = 0;
            }
            for (std::size_t x = 1; x <= side; ++x) {
                upright[x] = (here[x] ^ (here[x] >> 1 | above[x] << 63)) & owned;
                along_x[x] = (here[x] ^ here[x + 1]) & owned;
                along_z[x] = (here[x] ^ next_z[x]) & owned;
            }
        }
    }
}

void find_cells(Cells& out, const EdgeMasks& edges) {
    mark_cells(out.used, edges);
    number_vertices(out);
}

std::size_t count_edges(const EdgeMasks& edges) {
    int count = 0;
    for (std::size_t i = 0; i < edges.upright.bits.size(); ++i) {
        count += std::popcount(edges.upright.bits[i]) + std::popcount(edges.along_x.bits[i]) +
                 std::popcount(edges.along_z.bits[i]);
    }
    return static_cast<std::size_t>(count);
}

}  // namespace terrane
