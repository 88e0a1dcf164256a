#include "generator/volume/signatures.h"

#include "generator/volume/limit.h"
#include "generator/volume/slot_rows.h"
#include "generator/world/composition.h"
#include "protocol/base/bytes.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

// What stands for the signature of a run in the bytes.
constexpr std::uint64_t kSameAsAbove = 0;
constexpr std::uint64_t kNextNew = 1;
constexpr std::uint64_t kFirstId = 2;

bool shows(std::span<const Limit> column, std::span<const std::uint16_t> signature) {
    return std::equal(column.begin(), column.end(), signature.begin(), signature.end(),
                      [](const Limit& limit, std::uint16_t id) { return limit.palette_id == id; });
}

std::uint64_t hash_of(std::span<const Limit> column) {
    std::uint64_t hash = column.size();
    for (const Limit& limit : column) {
        hash = (hash ^ limit.palette_id) * 0x9E3779B97F4A7C15U;
        hash ^= hash >> 32U;
    }
    return hash;
}

/// The signature of each column of the row above.
class RowAbove {
  public:
    RowAbove(std::vector<std::uint32_t>& memory, std::size_t width) : signatures_(memory) {
        signatures_.assign(width, kNone);
    }

    std::uint32_t at(std::size_t x) const { return signatures_[x]; }

    void set(const SignatureRun& run) {
        std::fill_n(signatures_.begin() + static_cast<std::ptrdiff_t>(run.x), run.length,
                    run.signature);
    }

  private:
    std::vector<std::uint32_t>& signatures_;
};

/// Numbers the planes: one per palette entry and class of limit, in order of first use.
class PlaneNumbers {
  public:
    void reset(std::size_t palette_size) {
        often_.assign(palette_size * kClassesOften, kNone);
        rare_.clear();
        count_ = 0;
    }

    std::uint32_t number(std::uint16_t palette_id, std::uint32_t limit_class) {
        std::uint32_t& plane =
            limit_class < kClassesOften
                ? often_[palette_id * kClassesOften + limit_class]
                : rare_.try_emplace({palette_id, limit_class}, kNone).first->second;
        if (plane == kNone) {
            plane = count_++;
        }
        return plane;
    }

    std::uint32_t count() const { return count_; }

  private:
    static constexpr std::size_t kClassesOften = 4;
    std::vector<std::uint32_t> often_;
    std::map<std::pair<std::uint16_t, std::uint32_t>, std::uint32_t> rare_;
    std::uint32_t count_ = 0;
};

// Classes of limits that get a plane: the same class of one palette entry is one surface.
constexpr std::uint32_t kClassBottom = 0;  ///< the column's first, with its interval above it
constexpr std::uint32_t kClassCut = 1;     ///< the column's last: a blend whose top is cut off
constexpr std::uint32_t kClassTop = 2;     ///< + how many tops of this entry lie below

bool decode_table(SignatureTable& table, ByteReader& in, const RunBounds& bounds) {
    const auto count = in.varint();
    if (!count || *count > bounds.width * bounds.length) {
        return false;
    }
    for (std::uint64_t i = 0; i < *count; ++i) {
        const auto slots = in.varint();
        if (!slots || *slots == 0 || *slots > in.remaining() ||  // a slot is at least a byte
            table.palette_ids.size() + *slots > bounds.limits_max) {
            return false;
        }
        for (std::uint64_t slot = 0; slot < *slots; ++slot) {
            const auto id = in.varint();
            if (!id || *id >= bounds.palette_size) {
                return false;
            }
            table.palette_ids.push_back(static_cast<std::uint16_t>(*id));
        }
        table.offsets.push_back(static_cast<std::uint32_t>(table.palette_ids.size()));
    }
    return true;
}

}  // namespace

struct RoleFinder::Buffers {
    void reset(const Palette& of_palette, std::span<const std::int32_t> of_blends) {
        palette = &of_palette;
        blends = of_blends;
        planes.reset(of_palette.size());
        flow_planes.assign(of_palette.size(), kNone);
        flow_plane_count = 0;
        tops.assign(of_palette.size(), 0);
        first_slots.assign(of_palette.size(), kNone);
    }

    void add(SlotRoles& roles, std::span<const std::uint16_t> ids) {
        std::uint32_t layer = kNone;  // the nearest slot of a layer below
        for (std::size_t slot = 0; slot < ids.size(); ++slot) {
            roles.heights.push_back(height_slot(ids, slot));
            roles.flows.push_back(flow_slot(ids[slot], layer));
            if (first_slots[ids[slot]] == kNone) {
                first_slots[ids[slot]] = static_cast<std::uint32_t>(slot);
            }
            if ((*palette)[ids[slot]].kind == PaletteKind::layer) {
                layer = static_cast<std::uint32_t>(slot);
            }
        }
        for (const std::uint16_t id : ids) {
            tops[id] = 0;
            first_slots[id] = kNone;
        }
        roles.height_plane_count = planes.count();
        roles.flow_plane_count = flow_plane_count;
    }

    HeightSlot height_slot(std::span<const std::uint16_t> ids, std::size_t slot) {
        const std::uint16_t id = ids[slot];
        const bool last = slot + 1 == ids.size();
        const bool interval_above = !last && ids[slot + 1] == id;
        if (slot == 0 && interval_above) {
            return {.plane = planes.number(id, kClassBottom)};
        }
        if (slot == 0 || ids[slot - 1] == id) {
            return {.plane = planes.number(id, kClassTop + tops[id]++)};
        }
        if (blends[id] == 0 || !may_blend((*palette)[ids[slot - 1]], (*palette)[id])) {
            return {.role = HeightRole::floor};
        }
        if (last) {
            return {.plane = planes.number(id, kClassCut)};
        }
        return interval_above ? HeightSlot{.role = HeightRole::blend, .blend = blends[id]}
                              : HeightSlot{.role = HeightRole::floor};
    }

    FlowSlot flow_slot(std::uint16_t id, std::uint32_t layer) {
        if (!(*palette)[id].is_solid()) {
            return {};
        }
        if (first_slots[id] != kNone) {
            return {.role = FlowRole::copy, .source = first_slots[id]};
        }
        if ((*palette)[id].kind == PaletteKind::vein && layer != kNone) {
            return {.role = FlowRole::copy, .source = layer};
        }
        if (flow_planes[id] == kNone) {
            flow_planes[id] = flow_plane_count++;
        }
        return {.role = FlowRole::plane, .source = flow_planes[id]};
    }

    const Palette* palette = nullptr;
    std::span<const std::int32_t> blends;
    PlaneNumbers planes;
    std::vector<std::uint32_t> flow_planes;  ///< by palette id
    std::uint32_t flow_plane_count = 0;
    std::vector<std::uint32_t> tops;         ///< by palette id, within one signature
    std::vector<std::uint32_t> first_slots;  ///< likewise
};

bool may_blend(const PaletteEntry& below, const PaletteEntry& above) {
    return below.kind == PaletteKind::layer && !below.alone && above.is_solid() && !above.alone;
}

RoleFinder::RoleFinder() : buffers_(std::make_unique<Buffers>()) {}

RoleFinder::~RoleFinder() = default;

void RoleFinder::find(SlotRoles& roles, const SignatureTable& table, const Palette& palette,
                      std::span<const std::int32_t> blends) {
    roles.heights.clear();
    roles.flows.clear();
    buffers_->reset(palette, blends);
    for (std::size_t i = 0; i < table.size(); ++i) {
        buffers_->add(roles, table[i]);
    }
    roles.height_plane_count = buffers_->planes.count();
    roles.flow_plane_count = buffers_->flow_plane_count;
}

void RunFinder::insert(std::uint32_t signature) {
    const std::size_t mask = buckets_.size() - 1;
    std::size_t at = static_cast<std::size_t>(hashes_[signature]) & mask;
    while (buckets_[at] != 0) {
        at = (at + 1) & mask;
    }
    buckets_[at] = signature + 1;
}

std::uint32_t RunFinder::number_of(SignatureTable& table, std::span<const Limit> column) {
    const std::uint64_t hash = hash_of(column);
    const std::size_t mask = buckets_.size() - 1;
    for (std::size_t at = static_cast<std::size_t>(hash) & mask; buckets_[at] != 0;
         at = (at + 1) & mask) {
        const std::uint32_t known = buckets_[at] - 1;
        if (hashes_[known] == hash && shows(column, table[known])) {
            return known;
        }
    }
    const auto added = static_cast<std::uint32_t>(table.size());
    for (const Limit& limit : column) {
        table.palette_ids.push_back(limit.palette_id);
    }
    table.offsets.push_back(static_cast<std::uint32_t>(table.palette_ids.size()));
    hashes_.push_back(hash);
    if (2 * hashes_.size() > buckets_.size()) {
        buckets_.assign(2 * buckets_.size(), 0);
        for (std::uint32_t i = 0; i < added; ++i) {
            insert(i);
        }
    }
    insert(added);
    return added;
}

void RunFinder::find(SignatureRuns& found, const ColumnGrid& columns) {
    constexpr std::size_t kBucketsAtFirst = 256;
    found.table.clear();
    found.runs.clear();
    hashes_.clear();
    buckets_.assign(kBucketsAtFirst, 0);
    const auto width = static_cast<std::uint32_t>(columns.width);
    const auto length = static_cast<std::uint32_t>(columns.length);
    RowAbove above(above_, width);
    const std::span limits = columns.limits;
    const std::uint32_t* offset = columns.offsets.data();
    for (std::uint32_t z = 0; z < length; ++z, offset += width) {
        const std::size_t row_begin = found.runs.size();
        for (std::uint32_t x = 0; x < width;) {
            const std::uint32_t begin = offset[x];
            const std::uint32_t slots = offset[x + 1] - begin;
            std::uint32_t end = x + 1;
            while (end < width && offset[end + 1] - offset[end] == slots) {
                ++end;
            }
            const auto shown = limits.subspan(begin, slots);
            const auto alike =
                static_cast<std::uint32_t>(count_alike(shown.data(), slots, end - x));
            const std::uint32_t upper = above.at(x);
            const bool same = upper != kNone && shows(shown, found.table[upper]);
            found.runs.push_back({.signature = same ? upper : number_of(found.table, shown),
                                  .z = z,
                                  .x = x,
                                  .length = alike,
                                  .first_limit = begin});
            x += alike;
        }
        for (std::size_t run = row_begin; run < found.runs.size(); ++run) {
            above.set(found.runs[run]);
        }
    }
    found.limit_count = limits.size();
}

void RunFinder::encode(Bytes& out, const SignatureRuns& runs, std::size_t width) {
    ByteWriter writer(out);
    writer.varint(runs.table.size());
    for (std::size_t i = 0; i < runs.table.size(); ++i) {
        writer.varint(runs.table[i].size());
        for (const std::uint16_t id : runs.table[i]) {
            writer.varint(id);
        }
    }
    RowAbove above(above_, width);
    std::uint32_t next_new = 0;
    for (const SignatureRun& run : runs.runs) {
        if (run.signature == next_new) {
            writer.varint(kNextNew);
            ++next_new;
        } else if (run.signature == above.at(run.x)) {
            writer.varint(kSameAsAbove);
        } else {
            writer.varint(kFirstId + run.signature);
        }
        writer.varint(run.x + run.length == width ? 0 : run.length);
        above.set(run);
    }
}

bool decode_runs(SignatureRuns& runs, ByteReader& in, const RunBounds& bounds) {
    if (!decode_table(runs.table, in, bounds)) {
        return false;
    }
    std::vector<std::uint32_t> memory;
    RowAbove above(memory, bounds.width);
    std::uint32_t next_new = 0;
    for (std::uint32_t z = 0; z < bounds.length; ++z) {
        for (std::uint32_t x = 0; x < bounds.width;) {
            const auto token = in.varint();
            const auto length = in.varint();
            if (!token || !length || *length > bounds.width - x) {
                return false;
            }
            std::uint64_t signature = *token == kSameAsAbove ? above.at(x) : *token - kFirstId;
            if (*token == kNextNew) {
                signature = next_new++;
            }
            if (signature >= runs.table.size()) {
                return false;
            }
            const SignatureRun run = {.signature = static_cast<std::uint32_t>(signature),
                                      .z = z,
                                      .x = x,
                                      .length = *length == 0
                                                    ? static_cast<std::uint32_t>(bounds.width) - x
                                                    : static_cast<std::uint32_t>(*length),
                                      .first_limit = static_cast<std::uint32_t>(runs.limit_count)};
            runs.limit_count += run.length * runs.table[signature].size();
            if (runs.limit_count > bounds.limits_max) {
                return false;
            }
            above.set(run);
            runs.runs.push_back(run);
            x += run.length;
        }
    }
    return next_new == runs.table.size();  // a signature that no run uses only takes memory
}

}  // namespace terrane
