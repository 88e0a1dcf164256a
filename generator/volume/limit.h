// Limits: how a column is stored. Source: the paper, section 3 (volume representation).
//
// A column is a list of limits, bottom first. Between two limits composition and flow are
// interpolated linearly; two limits at one height make a sharp frontier; above the last one it is
// void for ever. Heights are 1/256 voxel.
#pragma once

#include "generator/world/composition.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <span>
#include <utility>
#include <vector>

namespace terrane {

inline constexpr std::int32_t kUnitsPerVoxel = 256;  ///< limit heights are 1/256 voxel

/// Internal material flow: a direction of length 127, or 0 for void and caves.
struct Flow {
    std::int8_t x;
    std::int8_t y;
    std::int8_t z;

    friend bool operator==(const Flow&, const Flow&) = default;
};

/// Without member initialisers, so that a buffer about to be overwritten costs nothing to grow.
struct Limit {
    std::int32_t y256;
    std::uint16_t palette_id;
    Flow flow;

    friend bool operator==(const Limit&, const Limit&) = default;
};

/// Leaves new elements uninitialised where std::allocator would zero them.
template <typename T>
struct UninitializedAllocator : std::allocator<T> {
    template <typename U>
    struct rebind {
        using other = UninitializedAllocator<U>;
    };

    template <typename U>
    void construct(U* place) noexcept {
        ::new (static_cast<void*>(place)) U;
    }

    template <typename U, typename... Arguments>
    void construct(U* place, Arguments&&... arguments) {
        ::new (static_cast<void*>(place)) U{std::forward<Arguments>(arguments)...};
    }
};

using Limits = std::vector<Limit, UninitializedAllocator<Limit>>;

/// A rectangle of columns with their limits, stored one behind the other (CSR). Column (x, z) of
/// the rectangle has local coordinates x_first <= x < x_first + width, likewise z over length; rows
/// run along x, z is the slow index.
struct ColumnGrid {
    std::int32_t x_first = 0;
    std::int32_t z_first = 0;
    std::int32_t width = 0;
    std::int32_t length = 0;
    std::vector<std::uint32_t> offsets;  ///< width * length + 1
    Limits limits;

    std::size_t index_of(std::int32_t x, std::int32_t z) const {
        return static_cast<std::size_t>(z - z_first) * static_cast<std::size_t>(width) +
               static_cast<std::size_t>(x - x_first);
    }

    std::span<const Limit> column(std::int32_t x, std::int32_t z) const {
        const std::size_t i = index_of(x, z);
        return std::span(limits).subspan(offsets[i], offsets[i + 1] - offsets[i]);
    }

    friend bool operator==(const ColumnGrid&, const ColumnGrid&) = default;
};

}  // namespace terrane
