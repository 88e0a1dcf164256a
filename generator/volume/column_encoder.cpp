#include "generator/volume/column_encoder.h"

#include "generator/volume/column_codec.h"
#include "generator/volume/derived_heights.h"
#include "generator/volume/exceptions.h"
#include "generator/volume/limit.h"
#include "generator/volume/plane_coder.h"
#include "generator/volume/plane_set.h"
#include "generator/volume/signatures.h"
#include "generator/volume/slot_rows.h"
#include "generator/world/composition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/clones.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

namespace terrane {
namespace {

/// The least B with (thickness * B + 128) >> 8 >= end, within 0..256.
std::int32_t fitting_blend(std::int64_t thickness, std::int64_t end) {
    const std::int64_t blend = (256 * end - 128 + thickness - 1) / thickness;
    return static_cast<std::int32_t>(std::clamp<std::int64_t>(blend, 0, kBlendMost));
}

/// The blend of each palette entry, found from the first interval that is thick enough, else from
/// the thickest; 0 if none shows it.
class BlendFitter {
  public:
    std::span<const std::int32_t> fit(const SignatureRuns& runs, const Palette& palette,
                                      std::span<const Limit> limits) {
        blends_.assign(palette.size(), 0);
        thickest_.assign(palette.size(), 0);
        settled_.assign(runs.table.size(), 0);
        for (const SignatureRun& run : runs.runs) {
            if (settled_[run.signature] == 0) {
                settled_[run.signature] =
                    look_at(run, runs.table[run.signature], palette, limits) ? 1 : 0;
            }
        }
        return blends_;
    }

  private:
    static constexpr std::int64_t kThickEnough = 256;  ///< then only one blend fits

    /// Whether nothing more can be learned from this signature.
    bool look_at(const SignatureRun& run, std::span<const std::uint16_t> ids,
                 const Palette& palette, std::span<const Limit> limits) {
        bool settled = true;
        for (std::size_t slot = 1; slot + 1 < ids.size(); ++slot) {
            const std::uint16_t id = ids[slot];
            if (ids[slot - 1] == id || ids[slot + 1] != id || thickest_[id] >= kThickEnough ||
                !may_blend(palette[ids[slot - 1]], palette[id])) {
                continue;
            }
            for (std::size_t i = 0; i < run.length && thickest_[id] < kThickEnough; ++i) {
                learn(id, &limits[run.first_limit + i * ids.size() + slot]);
            }
            settled = settled && thickest_[id] >= kThickEnough;
        }
        return settled;
    }

    void learn(std::uint16_t id, const Limit* middle) {
        const std::int64_t bottom = (middle - 1)->y256;
        const std::int64_t thickness = (middle + 1)->y256 - bottom;
        if (thickness > thickest_[id]) {
            thickest_[id] = thickness;
            blends_[id] = fitting_blend(thickness, middle->y256 - bottom);
        }
    }

    std::vector<std::int32_t> blends_;
    std::vector<std::int64_t> thickest_;
    std::vector<std::uint8_t> settled_;  ///< by signature
};

// Comparisons of a slot's values with what they are derived from: whole blocks, the last of which
// may run over, so they may find a difference where there is none.

TERRANE_CLONES
bool rows_differ(const std::uint32_t* a, const std::uint32_t* b, std::size_t count) {
    const std::size_t padded = whole_blocks(count);
    std::uint32_t differ = 0;
    for (std::size_t i = 0; i < padded; ++i) {
        differ |= a[i] ^ b[i];
    }
    return differ != 0;
}

/// As blended() has it, in 32 bits; too thick an interval for that counts as a difference.
TERRANE_CLONES
bool blends_differ(const std::uint32_t* middle, const std::uint32_t* bottom,
                   const std::uint32_t* top, std::uint32_t blend, std::size_t count) {
    constexpr unsigned kThicknessBits = 22;
    const std::size_t padded = whole_blocks(count);
    std::uint32_t differ = 0;
    for (std::size_t i = 0; i < padded; ++i) {
        const std::uint32_t thickness = top[i] - bottom[i];
        const std::uint32_t part = std::max(1U, (thickness * blend + 128U) >> 8U);
        const std::uint32_t end = bottom[i] + std::min(part, thickness);
        differ |= (end ^ middle[i]) | thickness >> kThicknessBits;
    }
    return differ != 0;
}

void copy_cells(std::uint32_t* to, const std::uint32_t* from, std::size_t count) {
    for (std::size_t i = 0; i < count; i += kPlaneBlock) {
        std::memcpy(to + i, from + i, kPlaneBlock * sizeof *to);
    }
}

using FlowRow = std::array<std::uint32_t, SlotRows::kStride>;

/// `words` as SlotRows::flow_words() has them.
void add_flow_exceptions(Exceptions& exceptions, const std::uint32_t* words,
                         const FlowRow& predicted, std::size_t count) {
    FlowRow flows;
    pack_flows(flows.data(), words, count);
    for (std::size_t i = 0; i < count; ++i) {
        if (flows[i] == predicted[i]) {
            exceptions.agree(1);
        } else {
            exceptions.add(flows[i]);
        }
    }
}

}  // namespace

struct ColumnEncoder::Buffers {
    RunFinder run_finder;
    SignatureRuns runs;
    BlendFitter blend_fitter;
    RoleFinder role_finder;
    SlotRoles roles;
    SlotRows rows;
    PlaneSet height_planes;
    PlaneSet flow_planes;
    Exceptions height_exceptions;
    Exceptions flow_exceptions;
    PlaneCodes codes;

    /// Columns first <= x < end of a run.
    struct Part {
        std::uint32_t first = 0;
        std::uint32_t end = 0;
    };

    std::span<const HeightSlot> heights_of(const SignatureRun& run) const {
        return std::span(roles.heights)
            .subspan(runs.table.offsets[run.signature], runs.table.slots(run.signature));
    }

    std::span<const FlowSlot> flows_of(const SignatureRun& run) const {
        return std::span(roles.flows)
            .subspan(runs.table.offsets[run.signature], runs.table.slots(run.signature));
    }

    /// The part of a run that is not apron; empty if all is.
    static Part inner_part(const SignatureRun& run, const ColumnsLayout& layout) {
        const auto apron = static_cast<std::uint32_t>(layout.apron);
        const std::uint32_t x_end = static_cast<std::uint32_t>(layout.width) - apron;
        const std::uint32_t run_end = run.x + run.length;
        if (run.z < apron || run.z >= static_cast<std::uint32_t>(layout.length) - apron) {
            return {.first = run_end, .end = run_end};
        }
        const std::uint32_t first = std::min(std::max(run.x, apron), run_end);
        return {.first = first, .end = std::max(first, std::min(run_end, x_end))};
    }

    void place_planes(const ColumnsLayout& layout) {
        height_planes.begin(roles.height_plane_count);
        flow_planes.begin(layout.with_flow ? roles.flow_plane_count : 0);
        for (const SignatureRun& run : runs.runs) {
            for (const HeightSlot& slot : heights_of(run)) {
                if (slot.role == HeightRole::plane) {
                    height_planes.announce(slot.plane, run.z);
                }
            }
            const Part inner = inner_part(run, layout);
            if (!layout.with_flow || inner.first == inner.end) {
                continue;
            }
            for (const FlowSlot& slot : flows_of(run)) {
                if (slot.role == FlowRole::plane) {
                    flow_planes.announce(slot.source, run.z);
                }
            }
        }
        height_planes.place(static_cast<std::size_t>(layout.width));
        flow_planes.place(static_cast<std::size_t>(layout.width));
    }

    void put_heights(const SignatureRun& run) {
        const auto slots = heights_of(run);
        constexpr std::size_t kSlotDistance = SlotRows::kWords * SlotRows::kStride;
        for (std::size_t s = 0; s < slots.size(); ++s) {
            const HeightSlot& slot = slots[s];
            const std::uint32_t* const heights = rows.heights(s);
            const std::uint32_t* const below = heights - kSlotDistance;
            if (slot.role == HeightRole::plane) {
                copy_cells(height_planes.cells(slot.plane, run.z, run.x, run.length), heights,
                           run.length);
            } else if (slot.role == HeightRole::floor
                           ? rows_differ(heights, below, run.length)
                           : blends_differ(heights, below, heights + kSlotDistance,
                                           static_cast<std::uint32_t>(slot.blend), run.length)) {
                for (std::size_t i = 0; i < run.length; ++i) {
                    const std::uint32_t residual =
                        heights[i] - predicted_height(heights + i, kSlotDistance, slot);
                    if (residual == 0) {
                        height_exceptions.agree(1);
                    } else {
                        height_exceptions.add(zigzag(static_cast<std::int32_t>(residual)));
                    }
                }
            } else {
                height_exceptions.agree(run.length);
            }
        }
    }

    /// Columns of the apron: no flow is expected.
    void put_no_flows(const SignatureRun& run, Part part, std::span<const Limit> limits) {
        const std::size_t slots = runs.table.slots(run.signature);
        const std::size_t columns = part.end - part.first;
        const auto those =
            limits.subspan(run.first_limit + (part.first - run.x) * slots, columns * slots);
        if (!any_flow(those.data(), those.size())) {
            flow_exceptions.agree(those.size());
            return;
        }
        for (std::size_t s = 0; s < slots; ++s) {
            add_flow_exceptions(flow_exceptions, rows.flow_words(s) + (part.first - run.x),
                                FlowRow{}, columns);
        }
    }

    void put_inner_flows(const SignatureRun& run, Part part) {
        const auto slots = flows_of(run);
        const std::size_t columns = part.end - part.first;
        const std::size_t offset = part.first - run.x;
        for (std::size_t s = 0; s < slots.size(); ++s) {
            const FlowSlot& slot = slots[s];
            const std::uint32_t* const words = rows.flow_words(s) + offset;
            if (slot.role == FlowRole::plane) {
                pack_flows(flow_planes.cells(slot.source, run.z, part.first, columns), words,
                           columns);
                continue;
            }
            const bool copies = slot.role == FlowRole::copy;
            const std::uint32_t* const source =
                copies ? rows.flow_words(slot.source) + offset : nullptr;
            if (copies ? flows_differ(words, source, columns)
                       : flows_differ_from_zero(words, columns)) {
                FlowRow predicted{};
                if (copies) {
                    pack_flows(predicted.data(), source, columns);
                }
                add_flow_exceptions(flow_exceptions, words, predicted, columns);
            } else {
                flow_exceptions.agree(columns);
            }
        }
    }

    /// Run by run, cut at the apron's inner border, slot by slot.
    void put_flows(const SignatureRun& run, const ColumnsLayout& layout,
                   std::span<const Limit> limits) {
        const Part inner = inner_part(run, layout);
        if (run.x < inner.first) {
            put_no_flows(run, {.first = run.x, .end = inner.first}, limits);
        }
        if (inner.first < inner.end) {
            put_inner_flows(run, inner);
        }
        if (inner.end < run.x + run.length) {
            put_no_flows(run, {.first = inner.end, .end = run.x + run.length}, limits);
        }
    }
};

ColumnEncoder::ColumnEncoder() : buffers_(std::make_unique<Buffers>()) {}

ColumnEncoder::~ColumnEncoder() = default;
ColumnEncoder::ColumnEncoder(ColumnEncoder&&) noexcept = default;
ColumnEncoder& ColumnEncoder::operator=(ColumnEncoder&&) noexcept = default;

void ColumnEncoder::encode(Bytes& out, const ColumnGrid& columns, const Palette& palette,
                           const ColumnsLayout& layout) {
    Buffers& b = *buffers_;
    const std::span limits = columns.limits;
    b.run_finder.find(b.runs, columns);
    b.run_finder.encode(out, b.runs, static_cast<std::size_t>(layout.width));
    const auto blends = b.blend_fitter.fit(b.runs, palette, limits);
    for (const std::int32_t blend : blends) {
        ByteWriter(out).varint(static_cast<std::uint64_t>(blend));
    }
    b.role_finder.find(b.roles, b.runs.table, palette, blends);
    b.place_planes(layout);
    b.height_exceptions.clear();
    b.flow_exceptions.clear();
    for (const SignatureRun& run : b.runs.runs) {
        b.rows.fill(limits.data() + run.first_limit, b.runs.table.slots(run.signature), run.length);
        b.put_heights(run);
        if (layout.with_flow) {
            b.put_flows(run, layout, limits);
        }
    }
    for (std::size_t plane = 0; plane < b.height_planes.size(); ++plane) {
        encode_heights(out, b.height_planes.view(plane), b.codes);
    }
    b.height_exceptions.append_to(out);
    if (layout.with_flow) {
        for (std::size_t plane = 0; plane < b.flow_planes.size(); ++plane) {
            encode_flows(out, b.flow_planes.view(plane), b.codes);
        }
        b.flow_exceptions.append_to(out);
    }
}

}  // namespace terrane
