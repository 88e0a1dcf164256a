#include "generator/volume/column_codec.h"

#include "generator/volume/plane_coder.h"
#include "generator/volume/signatures.h"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace terrane {
namespace {

constexpr std::int32_t kBlendMost = 256;

std::uint32_t bits_of(std::int32_t value) {
    return static_cast<std::uint32_t>(value);
}

/// One slot of one run: limits first, first + stride, ... `count` of them.
struct SlotCells {
    std::uint32_t z = 0;
    std::uint32_t x = 0;
    std::uint32_t first = 0;
    std::uint32_t stride = 0;
    std::uint32_t count = 0;
    std::uint32_t slot = 0;
};

SlotCells cells_of(const SignatureRun& run, std::size_t slot, std::size_t stride) {
    return {.z = run.z,
            .x = run.x,
            .first = run.first_limit + static_cast<std::uint32_t>(slot),
            .stride = static_cast<std::uint32_t>(stride),
            .count = run.length,
            .slot = static_cast<std::uint32_t>(slot)};
}

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

/// What was predicted otherwise than it is: (cells since the last one, value) pairs.
class Exceptions {
  public:
    void agree(std::size_t cells) { since_ += cells; }

    void add(std::uint64_t value) {
        ++count_;
        ByteWriter(bytes_).varint(since_);
        ByteWriter(bytes_).varint(value);
        since_ = 0;
    }

    void append_to(Bytes& out) const {
        ByteWriter(out).varint(count_);
        ByteWriter(out).raw(bytes_);
    }

  private:
    Bytes bytes_;
    std::size_t count_ = 0;
    std::size_t since_ = 0;
};

/// Reads them back while the cells are walked in the same order.
class ExceptionReader {
  public:
    explicit ExceptionReader(ByteReader& in) : in_(in) {
        const auto count = in.varint();
        left_ = count.value_or(0);
        ok_ = count.has_value();
        load();
    }

    /// Steps over so many cells if none of them is an exception.
    bool skip(std::size_t cells) {
        if (pending_ && until_ < cells) {
            return false;
        }
        until_ -= cells;
        return true;
    }

    /// The value that replaces the prediction of this cell, if any.
    std::optional<std::uint64_t> next() {
        if (!pending_ || until_ != 0) {
            --until_;
            return std::nullopt;
        }
        const std::uint64_t value = value_;
        load();
        return value;
    }

    /// All read, and the bytes were not cut short.
    bool finished() const { return ok_ && left_ == 0 && !pending_; }

  private:
    void load() {
        pending_ = false;
        if (!ok_ || left_ == 0) {
            return;
        }
        const auto until = in_.varint();
        const auto value = in_.varint();
        if (!until || !value) {
            ok_ = false;
            return;
        }
        --left_;
        until_ = *until;
        value_ = *value;
        pending_ = true;
    }

    ByteReader& in_;
    std::uint64_t left_ = 0;
    bool ok_ = false;
    bool pending_ = false;
    std::uint64_t until_ = 0;
    std::uint64_t value_ = 0;
};

/// The paper's 4.3: a layer blends over its own local thickness times its blend value.
std::int32_t blended(std::int32_t bottom, std::int32_t top, std::int32_t blend) {
    const std::int64_t thickness = std::int64_t{top} - bottom;
    const std::int64_t end = bottom + std::max<std::int64_t>(1, (thickness * blend + 128) >> 8);
    return static_cast<std::int32_t>(std::min<std::int64_t>(end, top));
}

std::int32_t predicted_height(const Limit* limit, const HeightSlot& slot) {
    return slot.role == HeightRole::floor ? limit[-1].y256
                                          : blended(limit[-1].y256, limit[1].y256, slot.blend);
}

/// The blend of each palette entry, found from the thickest interval that shows it; 0 if none does.
std::vector<std::int32_t> fit_blends(const SignatureRuns& runs, const Palette& palette,
                                     std::span<const Limit> limits) {
    constexpr std::int64_t kThickEnough = 1024;  // then there is only one blend that fits
    std::vector<std::int32_t> blends(palette.size(), 0);
    std::vector<std::int64_t> thickest(palette.size(), 0);
    for (const SignatureRun& run : runs.runs) {
        const auto ids = runs.table[run.signature];
        for (std::size_t slot = 1; slot + 1 < ids.size(); ++slot) {
            const std::uint16_t id = ids[slot];
            if (ids[slot - 1] == id || ids[slot + 1] != id || thickest[id] >= kThickEnough ||
                !may_blend(palette[ids[slot - 1]], palette[id])) {
                continue;
            }
            for (std::uint32_t i = 0; i < run.length; ++i) {
                const Limit* limit = &limits[run.first_limit + i * ids.size() + slot];
                const std::int64_t thickness = std::int64_t{limit[1].y256} - limit[-1].y256;
                const std::int64_t end = std::int64_t{limit[0].y256} - limit[-1].y256;
                if (thickness > thickest[id]) {
                    thickest[id] = thickness;
                    // The least B with (thickness * B + 128) >> 8 >= end.
                    const std::int64_t blend = (256 * end - 128 + thickness - 1) / thickness;
                    blends[id] =
                        static_cast<std::int32_t>(std::clamp<std::int64_t>(blend, 0, kBlendMost));
                }
            }
        }
    }
    return blends;
}

PlaneCells height_planes(const SignatureRuns& runs, const SlotRoles& roles) {
    PlaneCells planes(roles.height_plane_count);
    const auto for_each = [&](auto visit) {
        for (const SignatureRun& run : runs.runs) {
            const std::size_t begin = runs.table.offsets[run.signature];
            const std::size_t slots = runs.table.offsets[run.signature + 1] - begin;
            for (std::size_t slot = 0; slot < slots; ++slot) {
                const HeightSlot& height = roles.heights[begin + slot];
                if (height.role == HeightRole::plane) {
                    visit(height.plane, run, slot, slots);
                }
            }
        }
    };
    for_each([&](std::uint32_t plane, const auto&...) { planes.count(plane); });
    planes.counted();
    for_each([&](std::uint32_t plane, const SignatureRun& run, std::size_t slot,
                 std::size_t slots) { planes.add(plane, cells_of(run, slot, slots)); });
    return planes;
}

/// Marks the plane's cells and gives `get` or `set` each cell with its limit.
template <typename Limits, typename Visit>
void visit_plane(Plane& plane, std::span<const SlotCells> parts, Limits limits, Visit visit) {
    for (const SlotCells& part : parts) {
        std::uint32_t* cells = plane.row(part.z) + part.x;
        for (std::uint32_t i = 0; i < part.count; ++i) {
            visit(cells[i], limits[part.first + std::size_t{i} * part.stride]);
        }
    }
}

void mark_plane(Plane& plane, std::span<const SlotCells> parts) {
    plane.clear();
    for (const SlotCells& part : parts) {
        plane.mark(part.z, part.x, part.count);
    }
}

/// Calls visit(first limit, stride, count, slot) for the limits of each run and slot whose heights
/// are derived, in an order in which the limits they are derived from come first.
template <typename Limits, typename Visit>
void for_each_derived_height(const SignatureRuns& runs, const SlotRoles& roles, Limits limits,
                             Visit visit) {
    for (const SignatureRun& run : runs.runs) {
        const std::size_t begin = runs.table.offsets[run.signature];
        const std::size_t slots = runs.table.offsets[run.signature + 1] - begin;
        for (std::size_t slot = 0; slot < slots; ++slot) {
            const HeightSlot& height = roles.heights[begin + slot];
            if (height.role != HeightRole::plane) {
                visit(limits.data() + run.first_limit + slot, slots, run.length, height);
            }
        }
    }
}

std::uint32_t height_residual(const Limit* limit, const HeightSlot& slot) {
    return bits_of(limit->y256) - bits_of(predicted_height(limit, slot));
}

void add_height_exceptions(Exceptions& exceptions, const Limit* limit, std::size_t stride,
                           std::size_t count, const HeightSlot& slot) {
    std::uint32_t any = 0;
    for (std::size_t i = 0; i < count; ++i) {
        any |= height_residual(limit + i * stride, slot);
    }
    if (any == 0) {
        exceptions.agree(count);
        return;
    }
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint32_t residual = height_residual(limit + i * stride, slot);
        if (residual == 0) {
            exceptions.agree(1);
        } else {
            exceptions.add(zigzag(static_cast<std::int32_t>(residual)));
        }
    }
}

void encode_heights_section(Bytes& out, const SignatureRuns& runs, const SlotRoles& roles,
                            std::span<const Limit> limits, Plane& plane) {
    const PlaneCells planes = height_planes(runs, roles);
    for (std::size_t i = 0; i < planes.size(); ++i) {
        mark_plane(plane, planes[i]);
        visit_plane(plane, planes[i], limits,
                    [](std::uint32_t& cell, const Limit& limit) { cell = bits_of(limit.y256); });
        encode_heights(out, plane);
    }
    Exceptions exceptions;
    for_each_derived_height(
        runs, roles, limits,
        [&](const Limit* limit, std::size_t stride, std::size_t count, const HeightSlot& slot) {
            add_height_exceptions(exceptions, limit, stride, count, slot);
        });
    exceptions.append_to(out);
}

bool decode_heights_section(std::span<Limit> limits, ByteReader& in, const SignatureRuns& runs,
                            const SlotRoles& roles, Plane& plane) {
    const PlaneCells planes = height_planes(runs, roles);
    for (std::size_t i = 0; i < planes.size(); ++i) {
        mark_plane(plane, planes[i]);
        if (!decode_heights(plane, in)) {
            return false;
        }
        visit_plane(plane, planes[i], limits, [](std::uint32_t cell, Limit& limit) {
            limit.y256 = static_cast<std::int32_t>(cell);
        });
    }
    ExceptionReader exceptions(in);
    for_each_derived_height(
        runs, roles, limits,
        [&](Limit* limit, std::size_t stride, std::size_t count, const HeightSlot& slot) {
            const bool plain = exceptions.skip(count);
            for (std::size_t i = 0; i < count; ++i, limit += stride) {
                const std::int64_t residual = plain ? 0 : unzigzag(exceptions.next().value_or(0));
                limit->y256 = static_cast<std::int32_t>(bits_of(predicted_height(limit, slot)) +
                                                        static_cast<std::uint32_t>(residual));
            }
        });
    return exceptions.finished();
}

/// The runs cut at the apron's inner border, so that a run is inside or outside of it as a whole.
struct FlowRun {
    SignatureRun run;
    bool inside = false;
};

std::vector<FlowRun> flow_runs(const SignatureRuns& runs, const ColumnsLayout& layout) {
    const auto apron = static_cast<std::uint32_t>(layout.apron);
    const std::uint32_t x_end = static_cast<std::uint32_t>(layout.width) - apron;
    const std::uint32_t z_end = static_cast<std::uint32_t>(layout.length) - apron;
    std::vector<FlowRun> cut;
    cut.reserve(runs.runs.size() + 2 * static_cast<std::size_t>(layout.length));
    for (const SignatureRun& run : runs.runs) {
        const auto slots = static_cast<std::uint32_t>(runs.table[run.signature].size());
        const bool row_inside = run.z >= apron && run.z < z_end;
        std::uint32_t x = run.x;
        const std::uint32_t end = run.x + run.length;
        for (const std::uint32_t border : {row_inside ? apron : 0, row_inside ? x_end : 0, end}) {
            const std::uint32_t to = std::min(border, end);
            if (to > x) {
                SignatureRun part = run;
                part.first_limit += (x - run.x) * slots;
                part.x = x;
                part.length = to - x;
                cut.push_back({.run = part, .inside = row_inside && x >= apron && x < x_end});
                x = to;
            }
        }
    }
    return cut;
}

/// Calls visit(run, slot, slots, role) for each slot of each run.
template <typename Visit>
void for_each_flow_slot(const SignatureRuns& runs, std::span<const FlowRun> cut,
                        const SlotRoles& roles, Visit visit) {
    for (const FlowRun& part : cut) {
        const std::size_t begin = runs.table.offsets[part.run.signature];
        const std::size_t slots = runs.table.offsets[part.run.signature + 1] - begin;
        for (std::size_t slot = 0; slot < slots; ++slot) {
            visit(part.run, slot, slots, part.inside ? roles.flows[begin + slot] : FlowSlot{});
        }
    }
}

PlaneCells flow_planes(const SignatureRuns& runs, std::span<const FlowRun> cut,
                       const SlotRoles& roles) {
    PlaneCells planes(roles.flow_plane_count);
    for_each_flow_slot(runs, cut, roles,
                       [&](const SignatureRun&, std::size_t, std::size_t, const FlowSlot& flow) {
                           if (flow.role == FlowRole::plane) {
                               planes.count(flow.source);
                           }
                       });
    planes.counted();
    for_each_flow_slot(
        runs, cut, roles,
        [&](const SignatureRun& run, std::size_t slot, std::size_t slots, const FlowSlot& flow) {
            if (flow.role == FlowRole::plane) {
                planes.add(flow.source, cells_of(run, slot, slots));
            }
        });
    return planes;
}

/// Calls visit(first limit of the run, stride, count, slot, role) for each run and slot whose flow
/// is derived.
template <typename Limits, typename Visit>
void for_each_derived_flow(const SignatureRuns& runs, std::span<const FlowRun> cut,
                           const SlotRoles& roles, Limits limits, Visit visit) {
    for_each_flow_slot(
        runs, cut, roles,
        [&](const SignatureRun& run, std::size_t slot, std::size_t slots, const FlowSlot& flow) {
            if (flow.role != FlowRole::plane) {
                visit(limits.data() + run.first_limit, slots, run.length, slot, flow);
            }
        });
}

Flow predicted_flow(const Limit* column, const FlowSlot& flow) {
    return flow.role == FlowRole::zero ? Flow{} : column[flow.source].flow;
}

std::uint32_t pack(Flow flow) {
    return static_cast<std::uint32_t>(static_cast<std::uint8_t>(flow.x)) |
           static_cast<std::uint32_t>(static_cast<std::uint8_t>(flow.y)) << 8U |
           static_cast<std::uint32_t>(static_cast<std::uint8_t>(flow.z)) << 16U;
}

Flow unpack(std::uint64_t bits) {
    return {.x = static_cast<std::int8_t>(bits),
            .y = static_cast<std::int8_t>(bits >> 8U),
            .z = static_cast<std::int8_t>(bits >> 16U)};
}

constexpr std::int8_t Flow::* kFlowParts[] = {&Flow::x, &Flow::y, &Flow::z};

void add_flow_exceptions(Exceptions& exceptions, const Limit* column, std::size_t stride,
                         std::size_t count, std::size_t slot, const FlowSlot& role) {
    std::uint32_t any = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const Limit* at = column + i * stride;
        any |= pack(at[slot].flow) ^ pack(predicted_flow(at, role));
    }
    if (any == 0) {
        exceptions.agree(count);
        return;
    }
    for (std::size_t i = 0; i < count; ++i) {
        const Limit* at = column + i * stride;
        if (at[slot].flow == predicted_flow(at, role)) {
            exceptions.agree(1);
        } else {
            exceptions.add(pack(at[slot].flow));
        }
    }
}

void encode_flow_section(Bytes& out, const SignatureRuns& runs, const SlotRoles& roles,
                         std::span<const Limit> limits, Plane& plane, const ColumnsLayout& layout) {
    const std::vector<FlowRun> cut = flow_runs(runs, layout);
    const PlaneCells planes = flow_planes(runs, cut, roles);
    for (std::size_t i = 0; i < planes.size(); ++i) {
        mark_plane(plane, planes[i]);
        for (const auto part : kFlowParts) {
            visit_plane(plane, planes[i], limits, [part](std::uint32_t& cell, const Limit& limit) {
                cell = bits_of(limit.flow.*part);
            });
            encode_bytes(out, plane);
        }
    }
    Exceptions exceptions;
    for_each_derived_flow(runs, cut, roles, limits,
                          [&](const Limit* column, std::size_t stride, std::size_t count,
                              std::size_t slot, const FlowSlot& role) {
                              add_flow_exceptions(exceptions, column, stride, count, slot, role);
                          });
    exceptions.append_to(out);
}

bool decode_flow_section(std::span<Limit> limits, ByteReader& in, const SignatureRuns& runs,
                         const SlotRoles& roles, Plane& plane, const ColumnsLayout& layout) {
    const std::vector<FlowRun> cut = flow_runs(runs, layout);
    const PlaneCells planes = flow_planes(runs, cut, roles);
    for (std::size_t i = 0; i < planes.size(); ++i) {
        mark_plane(plane, planes[i]);
        for (const auto part : kFlowParts) {
            if (!decode_bytes(plane, in)) {
                return false;
            }
            visit_plane(plane, planes[i], limits, [part](std::uint32_t cell, Limit& limit) {
                limit.flow.*part = static_cast<std::int8_t>(cell);
            });
        }
    }
    ExceptionReader exceptions(in);
    for_each_derived_flow(runs, cut, roles, limits,
                          [&](Limit* column, std::size_t stride, std::size_t count,
                              std::size_t slot, const FlowSlot& role) {
                              const bool plain = exceptions.skip(count);
                              for (std::size_t i = 0; i < count; ++i, column += stride) {
                                  const auto other = plain ? std::nullopt : exceptions.next();
                                  column[slot].flow =
                                      other ? unpack(*other) : predicted_flow(column, role);
                              }
                          });
    return exceptions.finished();
}

void fill_columns(ColumnGrid& columns, const SignatureRuns& runs) {
    columns.limits.resize(runs.limit_count);
    columns.offsets.assign(1, 0);
    Limit* next = columns.limits.data();
    std::uint32_t offset = 0;
    for (const SignatureRun& run : runs.runs) {
        const auto ids = runs.table[run.signature];
        for (std::uint32_t i = 0; i < run.length; ++i) {
            for (const std::uint16_t id : ids) {
                *next++ = {.y256 = 0, .palette_id = id, .flow = {}};
            }
            offset += static_cast<std::uint32_t>(ids.size());
            columns.offsets.push_back(offset);
        }
    }
}

}  // namespace

void encode_columns(Bytes& out, const ColumnGrid& columns, const Palette& palette,
                    const ColumnsLayout& layout) {
    const SignatureRuns runs = find_runs(columns);
    encode_runs(out, runs, static_cast<std::size_t>(layout.width));
    const std::vector<std::int32_t> blends = fit_blends(runs, palette, columns.limits);
    for (const std::int32_t blend : blends) {
        ByteWriter(out).varint(static_cast<std::uint64_t>(blend));
    }
    const SlotRoles roles = roles_of(runs.table, palette, blends);
    const auto plane = std::make_unique<Plane>();
    encode_heights_section(out, runs, roles, columns.limits, *plane);
    if (layout.with_flow) {
        encode_flow_section(out, runs, roles, columns.limits, *plane, layout);
    }
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
    const SlotRoles roles = roles_of(runs.table, palette, blends);
    fill_columns(columns, runs);
    const auto plane = std::make_unique<Plane>();
    if (!decode_heights_section(columns.limits, in, runs, roles, *plane)) {
        return fail(ErrorCode::malformed, "columns: heights are cut short or out of range");
    }
    if (layout.with_flow && !decode_flow_section(columns.limits, in, runs, roles, *plane, layout)) {
        return fail(ErrorCode::malformed, "columns: flow is cut short or out of range");
    }
    return {};
}

}  // namespace terrane
