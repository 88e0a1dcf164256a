#include "generator/mesh/surface_cells.h"

#include "generator/mesh/solid_mask.h"
#include "generator/mesh/water_surface.h"
#include "generator/volume/limit.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {
namespace {

void mark_cells(WordGrid& out, const EdgeMasks& edges, const SolidMask& solid) {
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
            // Where the next word is elsewhere, no edge is just above; row 0 holds the apron, where
            // none are owned.
            const bool goes_on = solid.goes_on(word);
            const std::size_t z_above = goes_on ? z : 0;
            const std::size_t word_above = goes_on ? word + 1 : 0;
            const Word* const x0_above = edges.along_x.row(z_above, word_above);
            const Word* const x1_above = edges.along_x.row(goes_on ? z + 1 : 0, word_above);
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

/// The owned points among the bits of the word at y.
Word owned_bits(const Window& window, std::int32_t y) {
    const auto below = [y](std::int32_t end) {
        const std::int32_t count = end - y;
        return count <= 0 ? Word{0} : count >= 64 ? ~Word{0} : (Word{1} << count) - 1;
    };
    return below(window.last_y) & ~below(window.first_y);
}

}  // namespace

Window window_of(const SolidColumns& columns, HeightRange range) {
    const std::int64_t first = std::max<std::int64_t>(range.first, columns.lowest256 >> 8);
    const std::int64_t last = std::min<std::int64_t>(range.last, (columns.highest256 >> 8) + 1);
    if (first >= last) {
        return {};
    }
    return {.first_y = static_cast<std::int32_t>(first),
            .last_y = static_cast<std::int32_t>(last),
            .origin256 = static_cast<std::int32_t>(range.first * kUnitsPerVoxel)};
}

void find_words(std::vector<std::int32_t>& out, const SolidColumns& columns, const Window& window) {
    // Points one below the first owned one to one above the last are looked at.
    const std::int32_t first_y = window.first_y - 1;
    const std::int32_t count = (window.last_y + 1 - first_y + 63) / 64;
    out.assign(static_cast<std::size_t>(count), INT32_MAX);
    // Columns differ only between their ends: from a cave's floor to its ceiling, and from the
    // lowest top to the highest. A point more each way makes room for the cells around.
    const auto mark = [&](std::int32_t low256, std::int32_t high256) {
        const std::int32_t from = std::max(((low256 >> 8) - 1 - first_y) >> 6, 0);
        const std::int32_t to = std::min(((high256 >> 8) + 2 - first_y) >> 6, count - 1);
        for (std::int32_t word = from; word <= to; ++word) {
            out[static_cast<std::size_t>(word)] = first_y + 64 * word;
        }
    };
    mark(columns.lowest_top256, columns.highest256);
    const SolidEnd* end = columns.many_ends.data();
    for (std::size_t i = 0; i < columns.many.size(); i += 2) {
        const std::size_t ends = columns.many[i + 1];
        for (std::size_t cave = 0; cave + 1 < ends; cave += 2) {
            mark(end[cave].y256, end[cave + 1].y256);
        }
        end += ends;
    }
    std::erase(out, INT32_MAX);
}

void find_edges(EdgeMasks& out, const SolidMask& solid, const Window& window) {
    const std::size_t width = solid.width;
    const std::size_t side = width - 2;
    for (WordGrid* grid : {&out.upright, &out.along_x, &out.along_z}) {
        grid->reset(width, width, solid.words());
        std::fill_n(grid->row(0, 0), width * solid.words(), Word{0});
        std::fill_n(grid->row(side + 1, 0), width * solid.words(), Word{0});
    }
    for (std::size_t z = 1; z <= side; ++z) {
        for (std::size_t word = 0; word < solid.words(); ++word) {
            const Word owned = owned_bits(window, solid.word_y[word]);
            const Word* const here = solid.row(z, word);
            const Word* const next_z = solid.row(z + 1, word);
            // Where the next word is elsewhere, nothing changes from this one's last bit upwards.
            const bool goes_on = solid.goes_on(word);
            const Word* const above = solid.row(z, goes_on ? word + 1 : word);
            const int carried = goes_on ? 0 : 63;  // the bit of `above` that is the next
            Word* const upright = out.upright.row(z, word);
            Word* const along_x = out.along_x.row(z, word);
            Word* const along_z = out.along_z.row(z, word);
            for (WordGrid* grid : {&out.upright, &out.along_x, &out.along_z}) {
                grid->row(z, word)[0] = 0;
                grid->row(z, word)[side + 1] = 0;
            }
            for (std::size_t x = 1; x <= side; ++x) {
                upright[x] = (here[x] ^ (here[x] >> 1 | above[x] >> carried << 63)) & owned;
                along_x[x] = (here[x] ^ here[x + 1]) & owned;
                along_z[x] = (here[x] ^ next_z[x]) & owned;
            }
        }
    }
}

void find_cells(Cells& out, const EdgeMasks& edges, const SolidMask& solid) {
    mark_cells(out.used, edges, solid);
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
