// Noise at listed columns is that of asking for each alone, whatever the list and the kernel set.
#include "generator/terrain/kernels/kernel_choice.h"
#include "generator/terrain/noise.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace terrane {
namespace {

/// Groups of `together` columns, 8 apart, every `step` columns.
std::vector<std::int64_t> columns_of(std::int64_t first, std::int64_t step, int together,
                                     int groups) {
    std::vector<std::int64_t> columns;
    for (int group = 0; group < groups; ++group) {
        for (int n = 0; n < together; ++n) {
            columns.push_back(first + group * step + n * 8);
        }
    }
    return columns;
}

TEST(NoiseGrid, IsTheNoiseOfEachColumn) {
    constexpr std::int64_t kFar = std::int64_t{1} << 40;
    NoiseBuffers buffers;
    const std::vector<std::vector<std::int64_t>> lists = {
        columns_of(-96, 8, 1, 10),       // next to each other
        columns_of(kFar + 5, 8, 1, 70),  // likewise, many
        columns_of(-kFar, 64, 3, 34),    // in groups
        columns_of(17, 32, 3, 60),       // more than one piece
        columns_of(-5, 1024, 1, 3),      // far apart
        {42}};
    for (const double period : {2.5, 34.5, 138.0, 900.0}) {
        const Noise noise = Noise::make(7, period, 3);
        for (const auto& xs : lists) {
            for (const auto& zs : {lists[0], lists[2], lists[3]}) {
                const auto stride =
                    static_cast<std::size_t>(padded_width(static_cast<std::int32_t>(xs.size())));
                for (const KernelSet& set : available_kernel_sets()) {
                    std::vector<float> grid(stride * zs.size() + kVectorPad, -77.0F);
                    noise_grid(grid.data(), noise, xs, zs, *set.kernels, buffers);
                    for (std::size_t z = 0; z < zs.size(); ++z) {
                        for (std::size_t x = 0; x < xs.size(); ++x) {
                            ASSERT_EQ(grid[z * stride + x], noise_at(noise, xs[x], zs[z]))
                                << set.name << ", period " << period << ": " << x << "," << z;
                        }
                    }
                }
            }
        }
    }
}

}  // namespace
}  // namespace terrane
