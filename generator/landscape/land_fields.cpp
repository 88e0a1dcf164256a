#include "generator/landscape/land_fields.h"

#include "generator/landscape/erosion.h"
#include "generator/landscape/fold.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/kernels/vector_pad.h"
#include "generator/terrain/noise.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

namespace terrane {
namespace {

/// Columns first..end - 1 of one axis.
struct Interval {
    std::int64_t first = 0;
    std::int64_t end = 0;

    std::int32_t count() const { return static_cast<std::int32_t>(end - first); }

    bool holds(const Interval& other) const { return first <= other.first && end >= other.end; }
};

Interval along_x(const RectangleShape& shape) {
    return {.first = shape.x0, .end = shape.x0 + shape.width};
}

Interval along_z(const RectangleShape& shape) {
    return {.first = shape.z0, .end = shape.z0 + shape.length};
}

/// What is common to both.
Interval common(const Interval& a, const Interval& b) {
    return {.first = std::max(a.first, b.first), .end = std::min(a.end, b.end)};
}

/// `wanted` without the end that is `known`; nothing if all is, and all if only its middle is.
Interval without(const Interval& wanted, const Interval& known) {
    if (known.first <= wanted.first) {
        return {.first = std::clamp(known.end, wanted.first, wanted.end), .end = wanted.end};
    }
    if (known.end >= wanted.end) {
        return {.first = wanted.first, .end = std::min(known.first, wanted.end)};
    }
    return wanted;
}

/// `shape` without what `known` has of it, if that is a rectangle again.
RectangleShape without(const RectangleShape& shape, const RectangleShape& known) {
    RectangleShape left = shape;
    if (along_z(known).holds(along_z(shape))) {
        const Interval x = without(along_x(shape), along_x(known));
        left.x0 = x.first;
        left.width = x.count();
    } else if (along_x(known).holds(along_x(shape))) {
        const Interval z = without(along_z(shape), along_z(known));
        left.z0 = z.first;
        left.length = z.count();
    }
    return left;
}

bool is_empty(const RectangleShape& shape) {
    return shape.width == 0 || shape.length == 0;
}

/// Columns that are made for a shape, whole blocks of them.
std::int32_t made_for(const RectangleShape& shape) {
    return padded_width(shape.width) * shape.length;
}

/// Without a call (std::copy_n is memmove, which is one): there are many short ones.
void copy_short(float* to, const float* from, std::int32_t count) {
    constexpr std::int32_t kHalf = kVectorPad / 2;
    std::int32_t i = 0;
    for (; i + kVectorPad <= count; i += kVectorPad) {
        std::memcpy(to + i, from + i, kVectorPad * sizeof(float));
    }
    if (i + kHalf <= count) {
        std::memcpy(to + i, from + i, kHalf * sizeof(float));
        i += kHalf;
    }
    for (; i + 2 <= count; i += 2) {
        std::memcpy(to + i, from + i, 2 * sizeof(float));
    }
    if (i < count) {
        to[i] = from[i];
    }
}

/// Copies what `from` has of `to`.
void copy_common(LandFields& to, const LandFields& from, std::size_t rasters) {
    const RectangleShape& a = from.shape;
    const RectangleShape& b = to.shape;
    const Interval x = common(along_x(a), along_x(b));
    const Interval z = common(along_z(a), along_z(b));
    if (x.first >= x.end || z.first >= z.end) {
        return;
    }
    for (std::size_t r = 0; r < rasters; ++r) {
        const float* const first = (from.*LandFields::kRasters[r]).data();
        float* const out = (to.*LandFields::kRasters[r]).data();
        for (std::int64_t row = z.first; row < z.end; ++row) {
            copy_short(out + (row - b.z0) * b.stride() + (x.first - b.x0),
                       first + (row - a.z0) * a.stride() + (x.first - a.x0), x.count());
        }
    }
}

}  // namespace

void LandFieldBuilder::make(LandFields& out, const LandFieldConstants& constants,
                            const RectangleShape& shape, const RowKernels& kernels,
                            NoiseBuffers& buffers) {
    const std::size_t size = shape.padded_size();
    out.folds.resize(size);
    fold_rectangle(out.folds.data(), constants.folds, shape, kernels, buffers);
    if (!constants.has_relief) {
        out.shape = shape;
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
    out.shape = shape;
}

const LandFields& LandFieldBuilder::build(const LandFieldConstants& constants,
                                          const RectangleShape& shape, const RowKernels& kernels,
                                          NoiseBuffers& buffers) {
    if (constants.has_relief) {
        relief_builder_.find_rivers(constants.relief, shape);
    }
    // In the oldest one's place. Nothing is known of it until all is: memory may run out on the
    // way.
    next_ = shape.step == 1 ? (next_ + 1) % kKept : next_;
    LandFields& fields = shape.step == 1 ? kept_[next_] : coarse_;
    fields.shape = {};
    RectangleShape missing = shape;
    sources_.clear();
    for (std::size_t age = 1; age < kKept && shape.step == 1 && !is_empty(missing); ++age) {
        const LandFields& one = kept_[(next_ + kKept - age) % kKept];
        const RectangleShape left = without(missing, one.shape);
        if (made_for(left) < made_for(missing)) {
            sources_.push_back(&one);
            missing = left;
        }
    }
    if (sources_.empty()) {
        make(fields, constants, shape, kernels, buffers);
        return fields;
    }
    if (!is_empty(missing)) {
        make(strip_, constants, missing, kernels, buffers);
        sources_.push_back(&strip_);
    }
    const std::size_t rasters = constants.has_relief ? LandFields::kRasters.size() : 1;
    for (std::size_t r = 0; r < rasters; ++r) {
        (fields.*LandFields::kRasters[r]).resize(shape.padded_size());
    }
    fields.is_smooth = sources_.front()->is_smooth;
    fields.shape = shape;  // nothing can fail from here on
    for (const LandFields* source : sources_) {
        copy_common(fields, *source, rasters);
    }
    return fields;
}

}  // namespace terrane
