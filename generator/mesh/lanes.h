// Small vectors of the compilers' own, for four columns or two vertices at a time: the same code
// and the same bits on every machine, and one instruction each where the processor has it.
#pragma once

#include <bit>
#include <cstdint>

namespace terrane {

using Lanes = std::int32_t __attribute__((vector_size(16)));
using HalfLanes = std::int16_t __attribute__((vector_size(16)));

/// Bit i is set where lane i of a mask is.
inline unsigned bits_of(Lanes mask) {
#ifdef __SSE2__
    using FloatLanes = float __attribute__((vector_size(16)));
    return static_cast<unsigned>(__builtin_ia32_movmskps(std::bit_cast<FloatLanes>(mask)));
#else
    return static_cast<unsigned>((mask[0] & 1) | (mask[1] & 2) | (mask[2] & 4) | (mask[3] & 8));
#endif
}

/// Products of neighbouring lanes, added two and two.
inline Lanes paired(HalfLanes a, HalfLanes b) {
#ifdef __SSE2__
    return std::bit_cast<Lanes>(__builtin_ia32_pmaddwd128(a, b));
#else
    Lanes sums{};
    for (int i = 0; i < 4; ++i) {
        sums[i] = a[2 * i] * b[2 * i] + a[2 * i + 1] * b[2 * i + 1];
    }
    return sums;
#endif
}

/// x, y, z of a position in 1/256 voxel, each without what is above 16 bits: enough for distances
/// between vertices of neighbouring cells.
using PackedPosition = std::uint64_t;

inline PackedPosition packed_position(std::int32_t x, std::int32_t y, std::int32_t z) {
    const auto low = [](std::int32_t v) {
        return std::uint64_t{static_cast<std::uint16_t>(static_cast<std::uint32_t>(v))};
    };
    return low(x) | low(y) << 16U | low(z) << 32U;
}

/// True if a to b is not longer than c to d; all less than 128 voxels apart.
inline bool is_first_shorter(PackedPosition a, PackedPosition b, PackedPosition c,
                             PackedPosition d) {
    using Pair = std::uint64_t __attribute__((vector_size(16)));
    using Wrapping = std::uint16_t __attribute__((vector_size(16)));
    const auto apart = std::bit_cast<HalfLanes>(std::bit_cast<Wrapping>(Pair{a, c}) -
                                                std::bit_cast<Wrapping>(Pair{b, d}));
    const Lanes squares = paired(apart, apart);
    return squares[0] + squares[1] <= squares[2] + squares[3];
}

}  // namespace terrane
