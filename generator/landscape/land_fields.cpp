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

/// Copies what `from` has of row z of `to`; whole blocks, that run over into columns which come
/// later.
void copy_row(LandFields& to, const LandFields& from, LandFields::Raster raster, std::int64_t z) {
    const RectangleShape& a = from.shape;
    const RectangleShape& b = to.shape;
    if (z < a.z0 || z >= a.z0 + a.length) {
        return;
    }
    const std::int64_t x0 = std::max(a.x0, b.x0);
    const std::int64_t count = std::min(a.x0 + a.width, b.x0 + b.width) - x0;
    const float* const first = (from.*raster).data() + (z - a.z0) * a.stride() + (x0 - a.x0);
    float* const out = (to.*raster).data() + (z - b.z0) * b.stride() + (x0 - b.x0);
    for (std::int64_t i = 0; i < count; i += kVectorPad) {
        std::copy_n(first + i, kVectorPad, out + i);
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
    strip_.shape = {};
    if (missing.width > 0 && missing.length > 0) {
        make(strip_, constants, missing, kernels, buffers);
    }
    const std::size_t rasters = constants.has_relief ? LandFields::kRasters.size() : 1;
    for (std::size_t r = 0; r < rasters; ++r) {
        (fields_.*LandFields::kRasters[r]).resize(shape.padded_size());
    }
    fields_.shape = shape;
    const bool begins_before = missing.x0 > shape.x0 || missing.width == 0;
    const LandFields& left = begins_before ? before_ : strip_;
    const LandFields& right = begins_before ? strip_ : before_;
    for (std::size_t r = 0; r < rasters; ++r) {
        for (std::int64_t z = shape.z0; z < shape.z0 + shape.length; ++z) {
            copy_row(fields_, left, LandFields::kRasters[r], z);
            copy_row(fields_, right, LandFields::kRasters[r], z);
        }
    }
    fields_.is_smooth = before_.is_smooth;
    return fields_;
}

}  // namespace terrane
