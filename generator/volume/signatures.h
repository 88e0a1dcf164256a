// What columns look like apart from their heights: which palette entries follow one another.
//
// Neighbouring columns mostly show the same sequence of palette entries, their *signature*. A
// rectangle of columns is a table of signatures and, row by row, runs of columns of one signature.
// From the signature and the palette alone follows how each limit's height and flow are coded.
#pragma once

#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "protocol/base/bytes.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace terrane {

struct SignatureTable {
    std::vector<std::uint32_t> offsets = {0};  ///< one more than signatures
    std::vector<std::uint16_t> palette_ids;

    std::size_t size() const { return offsets.size() - 1; }

    std::size_t slots(std::size_t i) const { return offsets[i + 1] - offsets[i]; }

    std::span<const std::uint16_t> operator[](std::size_t i) const {
        return std::span(palette_ids).subspan(offsets[i], offsets[i + 1] - offsets[i]);
    }

    void clear() {
        offsets.assign(1, 0);
        palette_ids.clear();
    }
};

/// Consecutive columns of one row and one signature, as long as possible.
struct SignatureRun {
    std::uint32_t signature = 0;
    std::uint32_t z = 0;  ///< from the rectangle's corner
    std::uint32_t x = 0;
    std::uint32_t length = 0;
    std::uint32_t first_limit = 0;  ///< limit s of column x + i is at first_limit + i * slots + s
};

struct SignatureRuns {
    SignatureTable table;  ///< in order of first use
    std::vector<SignatureRun> runs;
    std::size_t limit_count = 0;
};

/// How a limit's value is found from the others.
enum class HeightRole : std::uint8_t {
    plane,  ///< coded in a plane
    floor,  ///< the height of the limit before: where an interval begins
    blend   ///< between the limit before and the next, by the palette entry's blend
};

struct HeightSlot {
    HeightRole role = HeightRole::plane;
    std::uint32_t plane = 0;  ///< if role is plane
    std::int32_t blend = 0;   ///< 1..256 if role is blend
};

enum class FlowRole : std::uint8_t {
    zero,  ///< the void, caves
    copy,  ///< the flow of an earlier limit of the column
    plane  ///< coded in a plane
};

struct FlowSlot {
    FlowRole role = FlowRole::zero;
    std::uint32_t source = 0;  ///< the earlier limit's slot, or the plane
};

/// One entry per slot of the table's palette_ids.
struct SlotRoles {
    std::vector<HeightSlot> heights;
    std::vector<FlowSlot> flows;
    std::size_t height_plane_count = 0;
    std::size_t flow_plane_count = 0;
};

/// Whether a frontier from `below` to `above` may be blended: neither side is
/// void, cave or alone, and below is a layer (the paper, 4.3).
bool may_blend(const PaletteEntry& below, const PaletteEntry& above);

/// Gives signatures their roles. Reused, it allocates nothing. One thread's.
class RoleFinder {
  public:
    RoleFinder();
    ~RoleFinder();

    /// Overwrites `roles`. `blends` has the blend (0..256) of each palette entry.
    void find(SlotRoles& roles, const SignatureTable& table, const Palette& palette,
              std::span<const std::int32_t> blends);

  private:
    struct Buffers;
    std::unique_ptr<Buffers> buffers_;
};

/// Finds signatures and writes them. Reused, it allocates nothing. One thread's.
class RunFinder {
  public:
    /// Overwrites `found` with the runs of `columns`.
    void find(SignatureRuns& found, const ColumnGrid& columns);

    void encode(Bytes& out, const SignatureRuns& runs, std::size_t width);

  private:
    std::uint32_t number_of(SignatureTable& table, std::span<const Limit> column);
    void insert(std::uint32_t signature);

    std::vector<std::uint32_t> above_;    ///< the signature of each column of the row above
    std::vector<std::uint64_t> hashes_;   ///< of each signature
    std::vector<std::uint32_t> buckets_;  ///< open addressing: signature + 1, or 0
};

/// The largest rectangle and the largest number of limits to accept.
struct RunBounds {
    std::size_t width = 0;
    std::size_t length = 0;
    std::size_t palette_size = 0;
    std::size_t limits_max = 0;
};

/// False when the bytes are not such runs; nothing beyond `bounds` is ever allocated.
bool decode_runs(SignatureRuns& runs, ByteReader& in, const RunBounds& bounds);

}  // namespace terrane
