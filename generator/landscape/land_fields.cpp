#include "generator/landscape/land_fields.h"

#include <algorithm>
#include <utility>

namespace terrane {
namespace {

/// Columns first..end - 1 of one axis.
struct Interval {
    std::int64_t first = 0;
    std::int64_t end = 0;

    std::int64_t count() const { return end - first; }

    friend bool operator==(const Interval&, const Interval&) = default;
};

/// What of `wanted` is missing of what is `known`, if that is one interval; else all of it.
Interval missing_of(const Interval& wanted, const Interval& known) {
    if (known.first <= wanted.first && known.end > wanted.first) {
        return {.first = std::min(known.end, wanted.end), .end = wanted.end};
    }
    if (known.end >= wanted.end && known.first < wanted.end) {
        return {.first = wanted.first, .end = known.first};
    }
    return wanted;
}

/// The part of `shape` that must be made beside what is `known`: a strip or all of it.
RectangleShape missing_of(const RectangleShape& shape, const RectangleShape& known) {
    RectangleShape missing = shape;
    if (shape.step != 1 || known.step != 1) {
        return missing;
    }
    const auto along_x = [](const RectangleShape& of) {
        return Interval{.first = of.x0, .end = of.x0 + of.width};
    };
    const auto along_z = [](const RectangleShape& of) {
        return Interval{.first = of.z0, .end = of.z0 + of.length};
    };
    if (along_z(shape) == along_z(known)) {
        const Interval x = missing_of(along_x(shape), along_x(known));
        missing.x0 = x.first;
        missing.width = static_cast<std::int32_t>(x.count());
    } else if (along_x(shape) == along_x(known)) {
        const Interval z = missing_of(along_z(shape), along_z(known));
        missing.z0 = z.first;
        missing.length = static_cast<std::int32_t>(z.count());
    }
    return missing;
}

/// Copies what `from` has of the columns of `to`.
void copy_common(LandFields& to, const LandFields& from, LandFields::Raster raster) {
    const RectangleShape& a = from.shape;
    const RectangleShape& b = to.shape;
    const std::int64_t x0 = std::max(a.x0, b.x0);
    const std::int64_t x1 = std::min(a.x0 + a.width, b.x0 + b.width);
    const std::int64_t z1 = std::min(a.z0 + a.length, b.z0 + b.length);
    for (std::int64_t z = std::max(a.z0, b.z0); z < z1; ++z) {
        const float* const first = (from.*raster).data() + (z - a.z0) * a.stride() + (x0 - a.x0);
        std::copy(first, first + (x1 - x0),
                  (to.*raster).data() + (z - b.z0) * b.stride() + (x0 - b.x0));
    }
}

}  // namespace

void LandFieldBuilder::make(LandFields& out, const LandFieldConstants& constants,
                            const RectangleShape& shape, const RowKernels& kernels,
                            NoiseBuffers& buffers) {
    out.shape = shape;
    const std::size_t size = shape.padded_size();
    out.folds.resize(size);
    fold_rectangle(out.folds.data(), constants.folds, shape, kernels, buffers);
    if (!constants.has_relief) {
        return;
    }
    out.raw.resize(size);
    out.fine.resize(size);
    relief_builder_.build(relief_, constants.relief, shape, kernels, buffers);
    erode(out.raw.data(), out.fine.data(), relief_, constants.erosion, shape, kernels, erosion_);
    for (std::size_t i = 0; i < size; ++i) {
        out.raw[i] = relief_.ground[i] + relief_.mountain[i] * out.raw[i];
        out.fine[i] = relief_.mountain[i] * out.fine[i];
    }
    std::swap(out.crest, relief_.crest);
    std::swap(out.river, relief_.river);
    std::swap(out.wander_x, relief_.wander_x);
    std::swap(out.wander_z, relief_.wander_z);
    out.is_smooth = relief_.is_smooth;
}

const LandFields& LandFieldBuilder::build(const LandFieldConstants& constants,
                                          const RectangleShape& shape, const RowKernels& kernels,
                                          NoiseBuffers& buffers) {
    if (constants.has_relief) {
        relief_builder_.find_rivers(constants.relief, shape);
    }
    std::swap(fields_, before_);
    const RectangleShape missing = missing_of(shape, before_.shape);
    // Nothing is known until all is: memory may run out on the way.
    fields_.shape = {};
    if (padded_width(missing.width) * missing.length >= padded_width(shape.width) * shape.length) {
        make(fields_, constants, shape, kernels, buffers);
        return fields_;
    }
    if (missing.width > 0 && missing.length > 0) {
        make(strip_, constants, missing, kernels, buffers);
    }
    const std::size_t rasters = constants.has_relief ? LandFields::kRasters.size() : 1;
    for (std::size_t r = 0; r < rasters; ++r) {
        (fields_.*LandFields::kRasters[r]).resize(shape.padded_size());
    }
    fields_.shape = shape;
    for (std::size_t r = 0; r < rasters; ++r) {
        copy_common(fields_, before_, LandFields::kRasters[r]);
        if (missing.width > 0 && missing.length > 0) {
            copy_common(fields_, strip_, LandFields::kRasters[r]);
        }
    }
    fields_.is_smooth = before_.is_smooth;
    return fields_;
}

}  // namespace terrane
