#include "generator/volume/signatures.h"

#include <algorithm>
#include <limits>
#include <map>
#include <unordered_map>
#include <utility>

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

/// Numbers signatures in order of first use.
class SignatureFinder {
  public:
    explicit SignatureFinder(SignatureTable& table) : table_(table) {}

    std::uint32_t find(std::span<const Limit> column) {
        std::uint64_t hash = column.size();
        for (const Limit& limit : column) {
            hash = (hash ^ limit.palette_id) * 0x9E3779B97F4A7C15U;
            hash ^= hash >> 32U;
        }
        const auto added = static_cast<std::uint32_t>(table_.size());
        const auto [found, is_new] = latest_.try_emplace(hash, added);
        for (std::uint32_t id = is_new ? kNone : found->second; id != kNone; id = older_[id]) {
            if (shows(column, table_[id])) {
                return id;
            }
        }
        older_.push_back(is_new ? kNone : std::exchange(found->second, added));
        for (const Limit& limit : column) {
            table_.palette_ids.push_back(limit.palette_id);
        }
        table_.offsets.push_back(static_cast<std::uint32_t>(table_.palette_ids.size()));
        return added;
    }

  private:
    SignatureTable& table_;
    std::unordered_map<std::uint64_t, std::uint32_t> latest_;  ///< of one hash
    std::vector<std::uint32_t> older_;                         ///< the one before of equal hash
};

/// The signature of each column of the row above.
class RowAbove {
  public:
    explicit RowAbove(std::size_t width) : signatures_(width, kNone) {}

    std::uint32_t at(std::size_t x) const { return signatures_[x]; }

    void set(const SignatureRun& run) {
        std::fill_n(signatures_.begin() + static_cast<std::ptrdiff_t>(run.x), run.length,
                    run.signature);
    }

  private:
    std::vector<std::uint32_t> signatures_;
};

/// Numbers the planes: one per palette entry and class of limit, in order of first use.
class PlaneNumbers {
  public:
    explicit PlaneNumbers(std::size_t palette_size) : often_(palette_size * kClassesOften, kNone) {}

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

class RoleFinder {
  public:
    RoleFinder(const Palette& palette, std::span<const std::int32_t> blends)
        : palette_(palette),
          blends_(blends),
          planes_(palette.size()),
          flow_planes_(palette.size(), kNone),
          tops_(palette.size(), 0),
          first_slots_(palette.size(), kNone) {}

    void add(SlotRoles& roles, std::span<const std::uint16_t> ids) {
        std::uint32_t layer = kNone;  // the nearest slot of a layer below
        for (std::size_t slot = 0; slot < ids.size(); ++slot) {
            roles.heights.push_back(height_slot(ids, slot));
            roles.flows.push_back(flow_slot(ids[slot], layer));
            if (first_slots_[ids[slot]] == kNone) {
                first_slots_[ids[slot]] = static_cast<std::uint32_t>(slot);
            }
            if (palette_[ids[slot]].kind == PaletteKind::layer) {
                layer = static_cast<std::uint32_t>(slot);
            }
        }
        for (const std::uint16_t id : ids) {
            tops_[id] = 0;
            first_slots_[id] = kNone;
        }
        roles.height_plane_count = planes_.count();
        roles.flow_plane_count = flow_plane_count_;
    }

  private:
    HeightSlot height_slot(std::span<const std::uint16_t> ids, std::size_t slot) {
        const std::uint16_t id = ids[slot];
        const bool last = slot + 1 == ids.size();
        const bool interval_above = !last && ids[slot + 1] == id;
        if (slot == 0 && interval_above) {
            return {.plane = planes_.number(id, kClassBottom)};
        }
        if (slot == 0 || ids[slot - 1] == id) {
            return {.plane = planes_.number(id, kClassTop + tops_[id]++)};
        }
        if (blends_[id] == 0 || !may_blend(palette_[ids[slot - 1]], palette_[id])) {
            return {.role = HeightRole::floor};
        }
        if (last) {
            return {.plane = planes_.number(id, kClassCut)};
        }
        return interval_above ? HeightSlot{.role = HeightRole::blend, .blend = blends_[id]}
                              : HeightSlot{.role = HeightRole::floor};
    }

    FlowSlot flow_slot(std::uint16_t id, std::uint32_t layer) {
        if (!palette_[id].is_solid()) {
            return {};
        }
        if (first_slots_[id] != kNone) {
            return {.role = FlowRole::copy, .source = first_slots_[id]};
        }
        if (palette_[id].kind == PaletteKind::vein && layer != kNone) {
            return {.role = FlowRole::copy, .source = layer};
        }
        if (flow_planes_[id] == kNone) {
            flow_planes_[id] = flow_plane_count_++;
        }
        return {.role = FlowRole::plane, .source = flow_planes_[id]};
    }

    const Palette& palette_;
    std::span<const std::int32_t> blends_;
    PlaneNumbers planes_;
    std::vector<std::uint32_t> flow_planes_;  ///< by palette id
    std::uint32_t flow_plane_count_ = 0;
    std::vector<std::uint32_t> tops_;         ///< by palette id, within one signature
    std::vector<std::uint32_t> first_slots_;  ///< likewise
};

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

bool may_blend(const PaletteEntry& below, const PaletteEntry& above) {
    return below.kind == PaletteKind::layer && !below.alone && above.is_solid() && !above.alone;
}

SlotRoles roles_of(const SignatureTable& table, const Palette& palette,
                   std::span<const std::int32_t> blends) {
    SlotRoles roles;
    roles.heights.reserve(table.palette_ids.size());
    roles.flows.reserve(table.palette_ids.size());
    RoleFinder finder(palette, blends);
    for (std::size_t i = 0; i < table.size(); ++i) {
        finder.add(roles, table[i]);
    }
    return roles;
}

SignatureRuns find_runs(const ColumnGrid& columns) {
    SignatureRuns found;
    SignatureFinder finder(found.table);
    RowAbove above(static_cast<std::size_t>(columns.width));
    const std::span limits = columns.limits;
    std::uint32_t column = 0;
    for (std::uint32_t z = 0; z < static_cast<std::uint32_t>(columns.length); ++z) {
        const std::size_t row_begin = found.runs.size();
        for (std::uint32_t x = 0; x < static_cast<std::uint32_t>(columns.width); ++x, ++column) {
            const std::uint32_t begin = columns.offsets[column];
            const auto shown = limits.subspan(begin, columns.offsets[column + 1] - begin);
            if (found.runs.size() > row_begin &&
                shows(shown, found.table[found.runs.back().signature])) {
                ++found.runs.back().length;
                continue;
            }
            const std::uint32_t upper = above.at(x);
            const bool same = upper != kNone && shows(shown, found.table[upper]);
            found.runs.push_back({.signature = same ? upper : finder.find(shown),
                                  .z = z,
                                  .x = x,
                                  .length = 1,
                                  .first_limit = begin});
        }
        for (std::size_t run = row_begin; run < found.runs.size(); ++run) {
            above.set(found.runs[run]);
        }
    }
    found.limit_count = limits.size();
    return found;
}

void encode_runs(Bytes& out, const SignatureRuns& runs, std::size_t width) {
    ByteWriter writer(out);
    writer.varint(runs.table.size());
    for (std::size_t i = 0; i < runs.table.size(); ++i) {
        writer.varint(runs.table[i].size());
        for (const std::uint16_t id : runs.table[i]) {
            writer.varint(id);
        }
    }
    RowAbove above(width);
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
    RowAbove above(bounds.width);
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
