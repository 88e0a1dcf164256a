#include "generator/volume/chunk_codec.h"

#include "generator/volume/chunk.h"
#include "generator/volume/column_codec.h"
#include "generator/volume/column_encoder.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace terrane {
namespace {

enum class RecordKind : std::uint8_t { uniform_chunk = 0, chunk = 1, stack = 2 };

constexpr std::uint8_t kFlagFlow = 1;
constexpr std::int32_t kApron = 1;

// Single bytes below 128 are written as varints, which are the same bytes.
void put_head(ByteWriter& out, RecordKind kind, bool with_flow) {
    out.varint(kChunkFormatVersion);
    out.varint(static_cast<std::uint64_t>(kind));
    out.varint(with_flow ? kFlagFlow : 0U);
}

void put_entry(ByteWriter& out, const PaletteEntry& entry) {
    out.varint(static_cast<unsigned>(entry.kind) | (entry.alone ? 4U : 0U) |
               static_cast<unsigned>(entry.composition.count) << 3U);
    for (const Share& share : entry.composition.shares()) {
        out.varint(share.material);
        out.f64(share.concentration);
    }
}

void put_palette(ByteWriter& out, const Palette& palette) {
    TERRANE_ASSERT(!palette.empty() && palette.size() <= kPaletteEntriesMax);
    out.varint(palette.size());
    for (const PaletteEntry& entry : palette) {
        put_entry(out, entry);
    }
}

/// How many bytes a record of so many limits has at least.
std::size_t least_bytes(std::size_t limits) {
    return (limits + kLimitsPerByteMax - 1) / kLimitsPerByteMax;
}

void put_columns(ColumnEncoder& encoder, Bytes& out, const ColumnGrid& columns,
                 const Palette& palette, const ColumnsLayout& layout) {
    TERRANE_ASSERT(columns.width == layout.width && columns.length == layout.length);
    TERRANE_ASSERT(columns.limits.size() <= kLimitsMax);
    encoder.encode(out, columns, palette, layout);
    out.resize(std::max(out.size(), least_bytes(columns.limits.size())));
}

ColumnsLayout chunk_layout(std::int32_t side, bool with_flow) {
    return {.width = side, .length = side, .apron = 0, .with_flow = with_flow};
}

ColumnsLayout stack_layout(std::int32_t side) {
    const std::int32_t width = side + 2 * kApron;
    return {.width = width, .length = width, .apron = kApron, .with_flow = true};
}

/// Reads heads; the first fault is kept, and everything after it reads as 0.
class RecordReader {
  public:
    RecordReader(std::span<const std::byte> bytes, std::size_t materials_max)
        : bytes_(bytes), reader_(bytes), materials_max_(materials_max) {
        TERRANE_ASSERT(materials_max >= 1 && materials_max <= kMaterialsMax);
    }

    bool ok() const { return state_.has_value(); }

    tl::unexpected<Error> failure() const { return tl::unexpected<Error>(state_.error()); }

    void refuse(ErrorCode code, const char* message) {
        if (ok()) {
            state_ = fail(code, message);
        }
    }

    std::uint8_t byte() {
        const auto value = reader_.fixed<std::uint8_t>();
        if (!value) {
            refuse(ErrorCode::malformed, "record: cut short");
        }
        return value.value_or(0);
    }

    /// A varint that is at most `most`.
    std::uint64_t count(std::uint64_t most, const char* too_large) {
        const auto value = reader_.varint();
        if (!value) {
            refuse(ErrorCode::malformed, "record: cut short");
            return 0;
        }
        if (*value > most) {
            refuse(ErrorCode::too_large, too_large);
        }
        return ok() ? *value : 0;
    }

    std::int32_t int32() {
        const auto value = reader_.varint();
        if (!value || *value > std::numeric_limits<std::uint32_t>::max()) {
            refuse(ErrorCode::malformed, "record: a number is cut short or beyond 32 bits");
            return 0;
        }
        return ok() ? static_cast<std::int32_t>(unzigzag(*value)) : 0;
    }

    double f64() {
        const auto value = reader_.f64();
        if (!value) {
            refuse(ErrorCode::malformed, "record: cut short");
        }
        return value.value_or(0);
    }

    PaletteEntry entry() {
        PaletteEntry made;
        const unsigned head = byte();
        const unsigned shares = head >> 3U;
        if (shares == 0 || shares > kCompositionMaterialsMax) {
            refuse(ErrorCode::malformed, "palette: a composition has 1 to 6 materials");
            return made;
        }
        made.kind = static_cast<PaletteKind>(head & 3U);
        made.alone = (head & 4U) != 0;
        for (unsigned i = 0; i < shares && ok(); ++i) {
            const std::uint64_t material =
                count(materials_max_ - 1, "palette: a material that the world does not have");
            const double concentration = f64();
            if (!(concentration > 0 && concentration <= 1)) {  // a NaN is neither
                refuse(ErrorCode::malformed, "palette: a concentration is not within 0..1");
            }
            made.composition.add(static_cast<std::uint16_t>(material), concentration);
        }
        return made;
    }

    Palette palette() {
        Palette made;
        const std::uint64_t entries = count(kPaletteEntriesMax, "palette: more than 65536 entries");
        if (entries == 0) {
            refuse(ErrorCode::malformed, "palette: empty");
        }
        for (std::uint64_t i = 0; i < entries && ok(); ++i) {
            made.push_back(entry());
        }
        return made;
    }

    std::vector<std::uint16_t> stack_palette_ids(std::size_t entries) {
        std::vector<std::uint16_t> ids;
        std::uint64_t next = 0;
        for (std::size_t i = 0; i < entries && ok(); ++i) {
            next += count(kPaletteEntriesMax, "palette: a stack id is above 65535");
            if (next >= kPaletteEntriesMax) {
                refuse(ErrorCode::too_large, "palette: a stack id is above 65535");
            }
            ids.push_back(static_cast<std::uint16_t>(next));
            ++next;
        }
        return ids;
    }

    void columns(ColumnGrid& out, const Palette& palette, const ColumnsLayout& layout) {
        if (!ok()) {
            return;
        }
        const std::size_t limits_max = std::min(kLimitsMax, bytes_.size() * kLimitsPerByteMax);
        const auto decoded = decode_columns(out, reader_, palette, layout, limits_max);
        if (!decoded) {
            state_ = tl::unexpected<Error>(decoded.error());
            return;
        }
        out.width = layout.width;
        out.length = layout.length;
        out.x_first = out.z_first = -layout.apron;
        check_heights(out, layout);
        const std::size_t written = bytes_.size() - reader_.remaining();
        const std::size_t least = std::max(written, least_bytes(out.limits.size()));
        const auto padding = reader_.take(reader_.remaining());
        if (!padding || bytes_.size() != least ||
            std::ranges::any_of(*padding, [](std::byte byte) { return byte != std::byte{0}; })) {
            refuse(ErrorCode::malformed, "record: bytes left over");
        }
    }

    void end() {
        if (reader_.remaining() != 0) {
            refuse(ErrorCode::malformed, "record: bytes left over");
        }
    }

  private:
    /// What everything that walks a column relies on.
    void check_heights(const ColumnGrid& columns, const ColumnsLayout& layout) {
        const std::span limits = columns.limits;
        for (std::size_t i = 0; i + 1 < columns.offsets.size(); ++i) {
            const auto column =
                limits.subspan(columns.offsets[i], columns.offsets[i + 1] - columns.offsets[i]);
            if (column.empty() || !std::ranges::is_sorted(column, {}, &Limit::y256)) {
                refuse(ErrorCode::malformed, "columns: one is empty or its heights fall");
            } else if (layout.apron > 0 && column.front().y256 != 0) {
                refuse(ErrorCode::malformed, "columns: a stack's does not begin at 0");
            }
        }
    }

    std::span<const std::byte> bytes_;
    ByteReader reader_;
    std::size_t materials_max_;
    Result<void> state_;
};

struct Head {
    RecordKind kind = RecordKind::chunk;
    bool with_flow = false;
};

Head read_head(RecordReader& in) {
    if (in.byte() != kChunkFormatVersion) {
        in.refuse(ErrorCode::version_mismatch, "record: not of chunk format version 2");
    }
    const std::uint8_t kind = in.byte();
    const std::uint8_t flags = in.byte();
    if (kind > static_cast<std::uint8_t>(RecordKind::stack) || flags > kFlagFlow) {
        in.refuse(ErrorCode::malformed, "record: unknown kind or flag");
    }
    return {.kind = static_cast<RecordKind>(kind), .with_flow = flags == kFlagFlow};
}

std::int32_t read_lod(RecordReader& in) {
    return static_cast<std::int32_t>(
        in.count(static_cast<std::uint64_t>(kLodMax), "record: level of detail above 17"));
}

std::int32_t read_side(RecordReader& in, std::int32_t most) {
    const std::uint64_t side = in.count(static_cast<std::uint64_t>(most), "record: side above 64");
    if (side == 0) {
        in.refuse(ErrorCode::malformed, "record: a side is 0");
    }
    return static_cast<std::int32_t>(side);
}

/// Layers, one void, then elements.
bool is_stack_palette(const Palette& palette) {
    const auto is_layer = [](const PaletteEntry& e) { return e.kind == PaletteKind::layer; };
    const auto is_element = [](const PaletteEntry& e) {
        return e.kind == PaletteKind::vein || e.kind == PaletteKind::cave;
    };
    const auto nothing = std::ranges::find_if_not(palette, is_layer);
    return nothing != palette.begin() && nothing != palette.end() &&
           nothing->kind == PaletteKind::void_ &&
           std::all_of(nothing + 1, palette.end(), is_element);
}

/// Of the inner columns, whose heights ascend.
std::int32_t highest_limit(const Stack& stack) {
    std::int32_t highest = 0;
    for (std::int32_t z = 0; z < stack.side; ++z) {
        for (std::int32_t x = 0; x < stack.side; ++x) {
            highest = std::max(highest, stack.columns.column(x, z).back().y256);
        }
    }
    return highest;
}

}  // namespace

void ChunkEncoder::encode(Bytes& out, const Chunk& chunk, FlowPlane flow) {
    const bool with_flow = flow == FlowPlane::with && !chunk.uniform;
    out.clear();
    ByteWriter writer(out);
    put_head(writer, chunk.uniform ? RecordKind::uniform_chunk : RecordKind::chunk, with_flow);
    writer.varint(static_cast<std::uint64_t>(chunk.position.lod));
    writer.varint(zigzag(chunk.position.x));
    writer.varint(zigzag(chunk.position.y));
    writer.varint(zigzag(chunk.position.z));
    writer.varint(static_cast<std::uint64_t>(chunk.side));
    writer.varint(static_cast<std::uint64_t>(chunk.height));
    if (chunk.uniform) {
        put_entry(writer, chunk.uniform_content);
        return;
    }
    put_palette(writer, chunk.palette);
    TERRANE_ASSERT(chunk.stack_palette_ids.size() == chunk.palette.size());
    std::uint64_t next = 0;
    for (const std::uint16_t id : chunk.stack_palette_ids) {
        TERRANE_ASSERT(id >= next);
        writer.varint(id - next);
        next = std::uint64_t{id} + 1;
    }
    put_columns(columns_, out, chunk.columns, chunk.palette, chunk_layout(chunk.side, with_flow));
}

void encode_chunk(Bytes& out, const Chunk& chunk, FlowPlane flow) {
    ChunkEncoder().encode(out, chunk, flow);
}

void encode_stack(Bytes& out, const Stack& stack) {
    ChunkEncoder().encode(out, stack);
}

Result<Chunk> decode_chunk(std::span<const std::byte> bytes, std::size_t materials_max) {
    RecordReader in(bytes, materials_max);
    const Head head = read_head(in);
    if (head.kind == RecordKind::stack) {
        in.refuse(ErrorCode::malformed, "record: a stack, not a chunk");
    }
    Chunk chunk;
    chunk.position.lod = read_lod(in);
    chunk.position.x = in.int32();
    chunk.position.y = in.int32();
    chunk.position.z = in.int32();
    chunk.side = read_side(in, kChunkSideMax);
    chunk.height = read_side(in, kChunkSideMax);
    chunk.uniform = head.kind == RecordKind::uniform_chunk;
    if (chunk.uniform) {
        chunk.uniform_content = in.entry();
        in.end();
    } else {
        chunk.palette = in.palette();
        chunk.stack_palette_ids = in.stack_palette_ids(chunk.palette.size());
        in.columns(chunk.columns, chunk.palette, chunk_layout(chunk.side, head.with_flow));
    }
    if (!in.ok()) {
        return in.failure();
    }
    return chunk;
}

void ChunkEncoder::encode(Bytes& out, const Stack& stack) {
    out.clear();
    ByteWriter writer(out);
    put_head(writer, RecordKind::stack, true);
    writer.varint(static_cast<std::uint64_t>(stack.position.lod));
    writer.varint(zigzag(stack.position.x));
    writer.varint(zigzag(stack.position.z));
    writer.varint(static_cast<std::uint64_t>(stack.side));
    writer.varint(zigzag(stack.highest_y256));
    put_palette(writer, stack.palette);
    put_columns(columns_, out, stack.columns, stack.palette, stack_layout(stack.side));
}

Result<Stack> decode_stack(std::span<const std::byte> bytes, std::size_t materials_max) {
    RecordReader in(bytes, materials_max);
    const Head head = read_head(in);
    if (head.kind != RecordKind::stack || !head.with_flow) {
        in.refuse(ErrorCode::malformed, "record: a chunk, not a stack");
    }
    Stack stack;
    stack.position.lod = read_lod(in);
    stack.position.x = in.int32();
    stack.position.z = in.int32();
    stack.side = read_side(in, kChunkSideMax);
    stack.highest_y256 = in.int32();
    stack.palette = in.palette();
    if (!is_stack_palette(stack.palette)) {
        in.refuse(ErrorCode::malformed, "palette: a stack's is layers, one void, elements");
    }
    in.columns(stack.columns, stack.palette, stack_layout(stack.side));
    if (in.ok() && highest_limit(stack) != stack.highest_y256) {
        in.refuse(ErrorCode::malformed, "record: its highest limit is another one");
    }
    if (!in.ok()) {
        return in.failure();
    }
    return stack;
}

}  // namespace terrane
