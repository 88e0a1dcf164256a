#include "generator/volume/column_codec.h"

#include "generator/volume/column_encoder.h"
#include "generator/volume/derived_heights.h"
#include "generator/volume/exceptions.h"
#include "generator/volume/limit.h"
#include "generator/volume/plane_coder.h"
#include "generator/volume/signatures.h"
#include "generator/volume/slot_values.h"
#include "generator/world/composition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace terrane {
namespace {

/// One slot of one run, or a part of it: `values` has `count` of them.
struct SlotCells {
    std::uint32_t* values = nullptr;
    std::uint32_t z = 0;
    std::uint32_t x = 0;
    std::uint32_t count = 0;
};

/// Cells sorted by the plane they belong to.
class PlaneCells {
  public:
    explicit PlaneCells(std::size_t planes) : ends_(planes + 1, 0) {}

    void count(std::uint32_t plane) { ++ends_[plane + 1]; }

    void counted() {
        for (std::size_t i = 1; i < ends_.size(); ++i) {
            ends_[i] += ends_[i - 1];
        }
        cells_.resize(ends_.back());
        // From now on ends_[p] is where the next cell of plane p goes: its end once all are added.
    }

    void add(std::uint32_t plane, const SlotCells& cells) { cells_[ends_[plane]++] = cells; }

    std::size_t size() const { return ends_.size() - 1; }

    std::span<const SlotCells> operator[](std::size_t plane) const {
        const std::size_t begin = plane == 0 ? 0 : ends_[plane - 1];
        return std::span(cells_).subspan(begin, ends_[plane] - begin);
    }

  private:
    std::vector<std::size_t> ends_;
    std::vector<SlotCells> cells_;
};

PlaneCells height_planes(const SignatureRuns& runs, const SlotRoles& roles, SlotValues& values) {
    PlaneCells planes(roles.height_plane_count);
    const auto for_each = [&](auto visit) {
        for (const SignatureRun& run : runs.runs) {
            const std::size_t begin = runs.table.offsets[run.signature];
            for (std::size_t slot = 0; slot < runs.table.slots(run.signature); ++slot) {
                const HeightSlot& height = roles.heights[begin + slot];
                if (height.role == HeightRole::plane) {
                    visit(height.plane, run, slot);
                }
            }
        }
    };
    for_each([&](std::uint32_t plane, const auto&...) { planes.count(plane); });
    planes.counted();
    for_each([&](std::uint32_t plane, const SignatureRun& run, std::size_t slot) {
        planes.add(
            plane,
            {.values = values.heights(run, slot), .z = run.z, .x = run.x, .count = run.length});
    });
    return planes;
}

void mark_plane(Plane& plane, std::span<const SlotCells> parts) {
    plane.clear();
    for (const SlotCells& part : parts) {
        plane.view().mark(part.z, part.x, part.count);
    }
}

/// Calls visit(heights, run length, slot) for each run and slot whose heights are derived, in an
/// order in which those they are derived from come first.
template <typename Visit>
void for_each_derived_height(const SignatureRuns& runs, const SlotRoles& roles, SlotValues& values,
                             Visit visit) {
    for (const SignatureRun& run : runs.runs) {
        const std::size_t begin = runs.table.offsets[run.signature];
        for (std::size_t slot = 0; slot < runs.table.slots(run.signature); ++slot) {
            const HeightSlot& height = roles.heights[begin + slot];
            if (height.role != HeightRole::plane) {
                visit(values.heights(run, slot), run.length, height);
            }
        }
    }
}

bool decode_heights_section(SlotValues& values, ByteReader& in, const SignatureRuns& runs,
                            const SlotRoles& roles, Plane& plane) {
    const PlaneCells planes = height_planes(runs, roles, values);
    for (std::size_t i = 0; i < planes.size(); ++i) {
        mark_plane(plane, planes[i]);
        const PlaneView view = plane.view();
        if (!decode_heights(view, in)) {
            return false;
        }
        for (const SlotCells& part : planes[i]) {
            std::copy_n(view.row(part.z) + part.x, part.count, part.values);
        }
    }
    ExceptionReader exceptions(in);
    for_each_derived_height(
        runs, roles, values,
        [&](std::uint32_t* heights, std::size_t length, const HeightSlot& slot) {
            const bool plain = exceptions.skip(length);
            for (std::size_t i = 0; i < length; ++i) {
                const std::int64_t residual = plain ? 0 : unzigzag(exceptions.next().value_or(0));
                heights[i] = predicted_height(heights + i, length, slot) +
                             static_cast<std::uint32_t>(residual);
            }
        });
    return exceptions.finished();
}

/// A run, or the part of it that lies on one side of the apron's inner border.
struct FlowRun {
    const SignatureRun* run = nullptr;
    std::uint32_t x = 0;
    std::uint32_t length = 0;
    bool inside = false;
};

std::vector<FlowRun> flow_runs(const SignatureRuns& runs, const ColumnsLayout& layout) {
    const auto apron = static_cast<std::uint32_t>(layout.apron);
    const std::uint32_t x_end = static_cast<std::uint32_t>(layout.width) - apron;
    const std::uint32_t z_end = static_cast<std::uint32_t>(layout.length) - apron;
    std::vector<FlowRun> cut;
    cut.reserve(runs.runs.size() + 2 * static_cast<std::size_t>(layout.length));
    for (const SignatureRun& run : runs.runs) {
        const bool row_inside = run.z >= apron && run.z < z_end;
        std::uint32_t x = run.x;
        const std::uint32_t end = run.x + run.length;
        for (const std::uint32_t border : {row_inside ? apron : 0, row_inside ? x_end : 0, end}) {
            const std::uint32_t to = std::min(border, end);
            if (to > x) {
                cut.push_back({.run = &run,
                               .x = x,
                               .length = to - x,
                               .inside = row_inside && x >= apron && x < x_end});
                x = to;
            }
        }
    }
    return cut;
}

/// Calls visit(part of a run, slot, role) for each slot of each part.
template <typename Visit>
void for_each_flow_slot(const SignatureRuns& runs, std::span<const FlowRun> cut,
                        const SlotRoles& roles, Visit visit) {
    for (const FlowRun& part : cut) {
        const std::size_t begin = runs.table.offsets[part.run->signature];
        for (std::size_t slot = 0; slot < runs.table.slots(part.run->signature); ++slot) {
            visit(part, slot, part.inside ? roles.flows[begin + slot] : FlowSlot{});
        }
    }
}

std::uint32_t* flows_of(SlotValues& values, const FlowRun& part, std::size_t slot) {
    return values.flows(*part.run, slot) + (part.x - part.run->x);
}

PlaneCells flow_planes(const SignatureRuns& runs, std::span<const FlowRun> cut,
                       const SlotRoles& roles, SlotValues& values) {
    PlaneCells planes(roles.flow_plane_count);
    for_each_flow_slot(runs, cut, roles, [&](const FlowRun&, std::size_t, const FlowSlot& flow) {
        if (flow.role == FlowRole::plane) {
            planes.count(flow.source);
        }
    });
    planes.counted();
    for_each_flow_slot(runs, cut, roles,
                       [&](const FlowRun& part, std::size_t slot, const FlowSlot& flow) {
                           if (flow.role == FlowRole::plane) {
                               planes.add(flow.source, {.values = flows_of(values, part, slot),
                                                        .z = part.run->z,
                                                        .x = part.x,
                                                        .count = part.length});
                           }
                       });
    return planes;
}

/// Calls visit(flows, the flows they are predicted to be, count) for each part and slot whose flow
/// is derived.
template <typename Visit>
void for_each_derived_flow(const SignatureRuns& runs, std::span<const FlowRun> cut,
                           const SlotRoles& roles, SlotValues& values, Visit visit) {
    static constexpr std::array<std::uint32_t, kPlaneSideMax> kZero{};
    for_each_flow_slot(
        runs, cut, roles, [&](const FlowRun& part, std::size_t slot, const FlowSlot& flow) {
            if (flow.role != FlowRole::plane) {
                visit(flows_of(values, part, slot),
                      flow.role == FlowRole::zero ? kZero.data()
                                                  : flows_of(values, part, flow.source),
                      part.length);
            }
        });
}

bool decode_flow_section(SlotValues& values, ByteReader& in, const SignatureRuns& runs,
                         const SlotRoles& roles, Plane& plane, const ColumnsLayout& layout) {
    const std::vector<FlowRun> cut = flow_runs(runs, layout);
    const PlaneCells planes = flow_planes(runs, cut, roles, values);
    for (std::size_t i = 0; i < planes.size(); ++i) {
        mark_plane(plane, planes[i]);
        const PlaneView view = plane.view();
        if (!decode_flows(view, in)) {
            return false;
        }
        for (const SlotCells& part : planes[i]) {
            std::copy_n(view.row(part.z) + part.x, part.count, part.values);
        }
    }
    ExceptionReader exceptions(in);
    for_each_derived_flow(
        runs, cut, roles, values,
        [&](std::uint32_t* flows, const std::uint32_t* predicted, std::size_t count) {
            const bool plain = exceptions.skip(count);
            for (std::size_t i = 0; i < count; ++i) {
                const auto other = plain ? std::nullopt : exceptions.next();
                flows[i] = other ? static_cast<std::uint32_t>(*other) : predicted[i];
            }
        });
    return exceptions.finished();
}

}  // namespace

void encode_columns(Bytes& out, const ColumnGrid& columns, const Palette& palette,
                    const ColumnsLayout& layout) {
    ColumnEncoder().encode(out, columns, palette, layout);
}

Result<void> decode_columns(ColumnGrid& columns, ByteReader& in, const Palette& palette,
                            const ColumnsLayout& layout, std::size_t limits_max) {
    SignatureRuns runs;
    if (!decode_runs(runs, in,
                     {.width = static_cast<std::size_t>(layout.width),
                      .length = static_cast<std::size_t>(layout.length),
                      .palette_size = palette.size(),
                      .limits_max = limits_max})) {
        return fail(ErrorCode::malformed, "columns: signatures are cut short or out of range");
    }
    std::vector<std::int32_t> blends;
    for (std::size_t i = 0; i < palette.size(); ++i) {
        const auto blend = in.varint();
        if (!blend || *blend > kBlendMost) {
            return fail(ErrorCode::malformed, "columns: a blend is not within 0..256");
        }
        blends.push_back(static_cast<std::int32_t>(*blend));
    }
    SlotRoles roles;
    RoleFinder().find(roles, runs.table, palette, blends);
    SlotValues values(runs.limit_count);
    const auto plane = std::make_unique<Plane>();
    if (!decode_heights_section(values, in, runs, roles, *plane)) {
        return fail(ErrorCode::malformed, "columns: heights are cut short or out of range");
    }
    if (layout.with_flow && !decode_flow_section(values, in, runs, roles, *plane, layout)) {
        return fail(ErrorCode::malformed, "columns: flow is cut short or out of range");
    }
    if (!layout.with_flow) {
        values.clear_flows(runs.limit_count);
    }
    join_slots(columns, values, runs);
    return {};
}

}  // namespace terrane
