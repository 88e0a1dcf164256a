#include "server/report/baselines.h"

#include "generator/baseline/row_perlin.h"

#include <cstddef>
#include <cstdint>

namespace terrane {
namespace {

std::size_t voxels_of(const VoxelBox& box) {
    return static_cast<std::size_t>(box.width) * static_cast<std::size_t>(box.height) *
           static_cast<std::size_t>(box.length);
}

}  // namespace

void VoxelBaseline::generate(const VoxelBox& box) {
    // The scale of the paper-* worlds.
    constexpr double kFrequency = 1.0 / 28;
    voxels_.resize(voxels_of(box));
    std::size_t i = 0;
    for (std::int64_t z = box.z0; z < box.z0 + box.length; ++z) {
        for (std::int64_t y = box.y0; y < box.y0 + box.height; ++y) {
            for (std::int64_t x = box.x0; x < box.x0 + box.width; ++x) {
                const double px = static_cast<double>(x) * kFrequency;
                const double py = static_cast<double>(y) * kFrequency;
                const double pz = static_cast<double>(z) * kFrequency;
                voxels_[i++] = {.material = static_cast<float>(noises_[0].at(px, py, pz)),
                                .flow_x = static_cast<float>(noises_[1].at(px, py, pz)),
                                .flow_y = static_cast<float>(noises_[2].at(px, py, pz)),
                                .flow_z = static_cast<float>(noises_[3].at(px, py, pz))};
            }
        }
    }
}

void RowBaseline::generate(const VoxelBox& box) {
    const std::size_t plane = voxels_of(box);
    values_.resize(noises_.size() * plane);
    for (std::size_t i = 0; i < noises_.size(); ++i) {
        noises_[i].fill(values_.data() + i * plane, box);
    }
}

}  // namespace terrane
