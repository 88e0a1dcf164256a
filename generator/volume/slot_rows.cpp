#include "generator/volume/slot_rows.h"

#include "generator/volume/limit.h"
#include "generator/volume/plane_coder.h"
#include "protocol/base/clones.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>

namespace terrane {
namespace {

constexpr std::size_t kTile = kPlaneBlock;
using Tile = std::uint32_t __attribute__((vector_size(kTile * sizeof(std::uint32_t))));
static_assert(kTile == 8, "transpose_columns is written out for eight");

const std::uint32_t* words_of(const Limit* limit) {
    // NOLINTNEXTLINE(bugprone-casting-through-void): read by memcpy only
    return static_cast<const std::uint32_t*>(static_cast<const void*>(limit));
}

// The masks of count_alike and any_flow, for eight limits.
constexpr std::size_t kLimitsAtOnce = 8;
constexpr std::size_t kWordsAtOnce = kLimitsAtOnce * SlotRows::kWords;

struct WordMasks {
    alignas(64) std::array<std::uint32_t, kWordsAtOnce> words;
};

constexpr WordMasks masks_of(std::uint32_t second, std::uint32_t third) {
    WordMasks masks{};
    for (std::size_t i = 0; i < kWordsAtOnce; i += SlotRows::kWords) {
        masks.words[i + 1] = second;
        masks.words[i + 2] = third;
    }
    return masks;
}

constexpr WordMasks kIdMasks = masks_of(0xFFFFU, 0);
constexpr WordMasks kFlowMasks = masks_of(0xFFFF0000U, 0xFFU);

std::uint32_t word_at(const std::uint32_t* words, std::size_t i) {
    std::uint32_t word = 0;
    std::memcpy(&word, words + i, sizeof word);
    return word;
}

using WordGroup = std::array<std::uint32_t, kWordsAtOnce>;

std::uint32_t any_of(const WordGroup& words) {
    std::uint32_t any = 0;
    for (std::size_t i = 0; i < kWordsAtOnce; ++i) {
        any |= words[i];
    }
    return any;
}

/// Whether any of columns 1.. shows other ids than column 0, of at least kLimitsAtOnce limits each.
/// Groups of limits, the last of which reaches back so that it ends with the column.
TERRANE_CLONES
bool any_other(const std::uint32_t* first, std::size_t column_words, std::size_t columns) {
    const std::size_t last_group = column_words - kWordsAtOnce;
    WordGroup differ{};
    const std::uint32_t* column = first + column_words;
    for (std::size_t i = 1; i < columns; ++i, column += column_words) {
        for (std::size_t begin = 0; begin < last_group; begin += kWordsAtOnce) {
            for (std::size_t w = 0; w < kWordsAtOnce; ++w) {
                differ[w] |=
                    (word_at(first, begin + w) ^ word_at(column, begin + w)) & kIdMasks.words[w];
            }
        }
        for (std::size_t w = 0; w < kWordsAtOnce; ++w) {
            differ[w] |= (word_at(first, last_group + w) ^ word_at(column, last_group + w)) &
                         kIdMasks.words[w];
        }
    }
    return any_of(differ) != 0;
}

TERRANE_CLONES
bool any_flow_word(const std::uint32_t* limits, std::size_t words) {
    WordGroup flows{};
    for (std::size_t begin = 0; begin < words; begin += kWordsAtOnce) {
        for (std::size_t i = 0; i < kWordsAtOnce; ++i) {
            flows[i] |= word_at(limits, begin + i) & kFlowMasks.words[i];
        }
    }
    return any_of(flows) != 0;
}

// Two vectors' values interleaved, in each half of the vectors; and the halves of two vectors. By
// reference, since how vectors are passed depends on the instruction set; all of it is inlined.

void interleave_32(Tile& low, Tile& high, const Tile& a, const Tile& b) {
    low = __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
    high = __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
}

void interleave_64(Tile& low, Tile& high, const Tile& a, const Tile& b) {
    low = __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13);
    high = __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
}

void swap_halves(Tile& low, Tile& high, const Tile& a, const Tile& b) {
    low = __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11);
    high = __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
}

/// Eight columns of `words` words each, to rows; `words` is a multiple of eight. In tiles of eight
/// by eight that stay in registers: hence no array and no helper that takes vectors.
TERRANE_CLONES
void transpose_columns(std::uint32_t* to, const std::array<const std::uint32_t*, kTile>& from,
                       std::size_t words) {
    const auto load = [](Tile& tile, const std::uint32_t* at) {
        std::memcpy(&tile, at, sizeof tile);
    };
    const auto store = [&](std::size_t word, const Tile& tile) {
        std::memcpy(to + word * SlotRows::kStride, &tile, sizeof tile);
    };
    for (std::size_t word = 0; word < words; word += kTile) {
        Tile a0, a1, a2, a3, a4, a5, a6, a7;
        load(a0, from[0] + word);
        load(a1, from[1] + word);
        load(a2, from[2] + word);
        load(a3, from[3] + word);
        load(a4, from[4] + word);
        load(a5, from[5] + word);
        load(a6, from[6] + word);
        load(a7, from[7] + word);
        Tile b0, b1, b2, b3, b4, b5, b6, b7;
        interleave_32(b0, b1, a0, a1);
        interleave_32(b2, b3, a2, a3);
        interleave_32(b4, b5, a4, a5);
        interleave_32(b6, b7, a6, a7);
        Tile c0, c1, c2, c3, c4, c5, c6, c7;
        interleave_64(c0, c1, b0, b2);
        interleave_64(c2, c3, b1, b3);
        interleave_64(c4, c5, b4, b6);
        interleave_64(c6, c7, b5, b7);
        swap_halves(b0, b4, c0, c4);
        swap_halves(b1, b5, c1, c5);
        swap_halves(b2, b6, c2, c6);
        swap_halves(b3, b7, c3, c7);
        store(word, b0);
        store(word + 1, b1);
        store(word + 2, b2);
        store(word + 3, b3);
        store(word + 4, b4);
        store(word + 5, b5);
        store(word + 6, b6);
        store(word + 7, b7);
    }
}

}  // namespace

void SlotRows::fill(const Limit* first, std::size_t slots, std::size_t columns) {
    const std::size_t words = kWords * slots;
    if (words_.size() < words * kStride) {
        words_.resize(words * kStride);
    }
    const std::uint32_t* const from = words_of(first);
    const std::size_t whole = words / kTile * kTile;
    for (std::size_t column = 0; column < columns; column += kTile) {
        std::array<const std::uint32_t*, kTile> sources;
        for (std::size_t i = 0; i < kTile; ++i) {
            sources[i] = from + std::min(column + i, columns - 1) * words;
        }
        std::uint32_t* const to = words_.data() + column;
        transpose_columns(to, sources, whole);
        for (std::size_t word = whole; word < words; ++word) {
            for (std::size_t i = 0; i < kTile; ++i) {
                to[word * kStride + i] = word_at(sources[i], word);
            }
        }
    }
}

TERRANE_CLONES
void pack_flows(std::uint32_t* __restrict packed, const std::uint32_t* __restrict words,
                std::size_t columns) {
    const std::size_t padded = whole_blocks(columns);
    for (std::size_t i = 0; i < padded; ++i) {
        packed[i] = words[i] >> 16U | (words[SlotRows::kStride + i] & 0xFFU) << 16U;
    }
}

TERRANE_CLONES
bool flows_differ(const std::uint32_t* a, const std::uint32_t* b, std::size_t columns) {
    constexpr std::size_t kSecond = SlotRows::kStride;
    const std::size_t padded = whole_blocks(columns);
    std::uint32_t differ = 0;
    for (std::size_t i = 0; i < padded; ++i) {
        differ |= (a[i] ^ b[i]) >> 16U | ((a[kSecond + i] ^ b[kSecond + i]) & 0xFFU);
    }
    return differ != 0;
}

TERRANE_CLONES
bool flows_differ_from_zero(const std::uint32_t* words, std::size_t columns) {
    const std::size_t padded = whole_blocks(columns);
    std::uint32_t differ = 0;
    for (std::size_t i = 0; i < padded; ++i) {
        differ |= words[i] >> 16U | (words[SlotRows::kStride + i] & 0xFFU);
    }
    return differ != 0;
}

std::size_t count_alike(const Limit* first, std::size_t slots, std::size_t columns) {
    if (columns > 1 && slots >= kLimitsAtOnce &&
        !any_other(words_of(first), SlotRows::kWords * slots, columns)) {
        return columns;  // the rule
    }
    const auto same_id = [](const Limit& a, const Limit& b) {
        return a.palette_id == b.palette_id;
    };
    for (std::size_t column = 1; column < columns; ++column) {
        if (!std::equal(first, first + slots, first + column * slots, same_id)) {
            return column;
        }
    }
    return columns;
}

bool any_flow(const Limit* first, std::size_t count) {
    const std::size_t grouped = count / kLimitsAtOnce * kLimitsAtOnce;
    for (std::size_t i = grouped; i < count; ++i) {
        if (first[i].flow != Flow{}) {
            return true;
        }
    }
    return grouped > 0 && any_flow_word(words_of(first), SlotRows::kWords * grouped);
}

}  // namespace terrane
