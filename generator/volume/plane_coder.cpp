#include "generator/volume/plane_coder.h"

#include "protocol/base/bytes.h"
#include "protocol/base/clones.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>

namespace terrane {
namespace {

// The head of a plane of heights.
constexpr std::uint8_t kHeadSecondOrder = 1;
constexpr std::uint8_t kHeadTwoBytes = 2;
constexpr std::uint8_t kHeadMost = kHeadSecondOrder | kHeadTwoBytes;

enum class SpanKind : std::uint8_t { second, first, edge };

struct CellSpan {
    SpanKind kind = SpanKind::edge;
    std::size_t z = 0;
    std::size_t x = 0;
    std::size_t length = 0;
};

std::size_t trailing_zeros(RowMask mask) {
    const auto low = static_cast<std::uint64_t>(mask);
    return low != 0 ? static_cast<std::size_t>(std::countr_zero(low))
                    : 64 + static_cast<std::size_t>(
                               std::countr_zero(static_cast<std::uint64_t>(mask >> 64U)));
}

std::size_t cells_of(RowMask mask) {
    return static_cast<std::size_t>(std::popcount(static_cast<std::uint64_t>(mask))) +
           static_cast<std::size_t>(std::popcount(static_cast<std::uint64_t>(mask >> 64U)));
}

/// A row's cells by what they have around them.
struct RowKinds {
    RowMask cells = 0;
    RowMask first = 0;   ///< L, U and UL are there
    RowMask second = 0;  ///< all eight are; 0 if the order is first
};

RowKinds kinds_of(const PlaneView& plane, std::size_t z, PlaneOrder order) {
    const RowMask* const row = plane.present + z;
    const RowMask cells = row[0];
    const RowMask up = row[-1];
    const RowMask first = cells & cells << 1U & up & up << 1U;
    if (order == PlaneOrder::first) {
        return {.cells = cells, .first = first};
    }
    const RowMask upper = row[-2];
    return {.cells = cells,
            .first = first,
            .second = first & cells << 2U & up << 2U & upper & upper << 1U & upper << 2U};
}

/// Calls `visit` with a row's cells in order, in spans of one kind of prediction; stops when it
/// says false.
template <typename Visit>
bool for_each_span_of_row(const PlaneView& plane, std::size_t z, PlaneOrder order, Visit visit) {
    const RowKinds kinds = kinds_of(plane, z, order);
    for (RowMask rest = kinds.cells; rest != 0;) {
        CellSpan span = {.z = z, .x = trailing_zeros(rest), .length = 1};
        if ((kinds.second >> span.x & 1U) != 0) {
            span.kind = SpanKind::second;
            span.length = trailing_zeros(~(kinds.second >> span.x));
        } else if ((kinds.first >> span.x & 1U) != 0) {
            span.kind = SpanKind::first;
            span.length = trailing_zeros(~((kinds.first & ~kinds.second) >> span.x));
        }
        rest &= ~(((RowMask{1} << span.length) - 1) << span.x);
        span.x -= kPlaneMargin;
        if (!visit(span)) {
            return false;
        }
    }
    return true;
}

template <typename Visit>
bool for_each_span(const PlaneView& plane, PlaneOrder order, Visit visit) {
    for (std::size_t z = 0; z < plane.rows; ++z) {
        if (!for_each_span_of_row(plane, z, order, visit)) {
            return false;
        }
    }
    return true;
}

std::uint32_t predict_first(const std::uint32_t* cell, std::size_t stride) {
    const std::uint32_t* up = cell - stride;
    return cell[-1] + up[0] - up[-1];
}

std::uint32_t predict_second(const std::uint32_t* cell, std::size_t stride) {
    const std::uint32_t* up = cell - stride;
    const std::uint32_t* upper = up - stride;
    return 2 * (cell[-1] + up[0] + up[-2] + upper[-1]) - 4 * up[-1] - cell[-2] - upper[0] -
           upper[-2];
}

/// What is known of a cell that lacks neighbours.
struct EdgeCell {
    const std::uint32_t* cell = nullptr;
    const RowMask* present = nullptr;  ///< its row's
    std::size_t bit = 0;

    bool has(std::ptrdiff_t rows_up, std::size_t at_bit) const {
        return (present[-rows_up] >> at_bit & 1U) != 0;
    }
};

EdgeCell edge_of(const PlaneView& plane, const CellSpan& span) {
    return {.cell = plane.row(span.z) + span.x,
            .present = plane.present + span.z,
            .bit = span.x + kPlaneMargin};
}

/// `last` is the cell coded before, 0 at first.
std::uint32_t predict_edge(const EdgeCell& edge, std::size_t stride, std::uint32_t last) {
    const std::uint32_t* cell = edge.cell;
    const std::uint32_t* up = cell - stride;
    if (edge.has(0, edge.bit - 1)) {
        return edge.has(0, edge.bit - 2) ? 2 * cell[-1] - cell[-2] : cell[-1];
    }
    if (edge.has(1, edge.bit)) {
        return edge.has(2, edge.bit) ? 2 * up[0] - *(up - stride) : up[0];
    }
    if (edge.has(1, edge.bit - 1)) {
        return up[-1];
    }
    return edge.has(1, edge.bit + 1) ? up[1] : last;
}

std::uint32_t zigzag32(std::uint32_t value) {
    return value << 1U ^ (0U - (value >> 31U));
}

std::uint32_t unzigzag32(std::uint32_t value) {
    return value >> 1U ^ (0U - (value & 1U));
}

// Codes of a span of cells that have all neighbours: whole blocks, the last running over.

TERRANE_CLONES
void first_codes(std::uint32_t* __restrict codes, const std::uint32_t* __restrict cells,
                 std::size_t stride, std::size_t length) {
    const std::size_t padded = whole_blocks(length);
    for (std::size_t i = 0; i < padded; ++i) {
        codes[i] = zigzag32(cells[i] - predict_first(cells + i, stride));
    }
}

TERRANE_CLONES
void second_codes(std::uint32_t* __restrict codes, const std::uint32_t* __restrict cells,
                  std::size_t stride, std::size_t length) {
    const std::size_t padded = whole_blocks(length);
    for (std::size_t i = 0; i < padded; ++i) {
        codes[i] = zigzag32(cells[i] - predict_second(cells + i, stride));
    }
}

/// Sum of the codes, each taken as at most 2^24.
TERRANE_CLONES
std::uint32_t weight(const std::uint32_t* codes, std::size_t length) {
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < length; ++i) {
        sum += std::min(codes[i], 1U << 24U);
    }
    return sum;
}

/// The order whose residuals are smaller where both apply, in every eighth row.
PlaneOrder better_order(const PlaneView& plane, std::uint32_t* codes) {
    constexpr std::size_t kFirstRow = 2;
    constexpr std::size_t kRowStep = 8;
    std::uint64_t first = 0;
    std::uint64_t second = 0;
    for (std::size_t z = kFirstRow; z < plane.rows; z += kRowStep) {
        for_each_span_of_row(plane, z, PlaneOrder::second, [&](const CellSpan& span) {
            if (span.kind == SpanKind::second) {
                const std::uint32_t* cells = plane.row(span.z) + span.x;
                first_codes(codes, cells, plane.stride, span.length);
                first += weight(codes, span.length);
                second_codes(codes, cells, plane.stride, span.length);
                second += weight(codes, span.length);
            }
            return true;
        });
    }
    return second < first ? PlaneOrder::second : PlaneOrder::first;
}

/// Walks a plane's rows and finds those that have the very cells of the rows above in one stretch:
/// most rows, whose predictions need no bits looked at.
class PlainRows {
  public:
    explicit PlainRows(const RowMask* present) : present_(present) {}

    /// Whether row z has the same cells as the `rows_up` rows above, side by side.
    bool is_plain(std::size_t z, std::size_t rows_up) {
        const RowMask* const row = present_ + z;
        if (row[0] != row[-1] || (rows_up > 1 && row[0] != row[-2]) || row[0] == 0) {
            return false;
        }
        if (row[0] != known_) {
            known_ = row[0];
            bit_ = trailing_zeros(known_);
            const RowMask cells = known_ >> bit_;
            length_ = (cells & (cells + 1)) == 0 ? cells_of(cells) : 0;
        }
        return length_ > 1;
    }

    std::size_t x() const { return bit_ - kPlaneMargin; }

    std::size_t length() const { return length_; }

  private:
    const RowMask* present_;
    RowMask known_ = 0;
    std::size_t bit_ = kPlaneMargin;
    std::size_t length_ = 0;
};

/// Codes of a row's cells, whatever lies around them; `last` is the cell coded before.
std::uint32_t* row_codes(std::uint32_t* end, const PlaneView& plane, std::size_t z,
                         PlaneOrder order, std::uint32_t& last) {
    for_each_span_of_row(plane, z, order, [&](const CellSpan& span) {
        const std::uint32_t* cells = plane.row(span.z) + span.x;
        switch (span.kind) {
            case SpanKind::second:
                second_codes(end, cells, plane.stride, span.length);
                break;
            case SpanKind::first:
                first_codes(end, cells, plane.stride, span.length);
                break;
            case SpanKind::edge:
                *end = zigzag32(*cells - predict_edge(edge_of(plane, span), plane.stride, last));
                break;
        }
        end += span.length;
        last = cells[span.length - 1];
        return true;
    });
    return end;
}

/// Codes of all cells, one after the other; says how many there are.
std::size_t codes_of(std::uint32_t* codes, const PlaneView& plane, PlaneOrder order) {
    const std::size_t stride = plane.stride;
    PlainRows rows(plane.present);
    std::uint32_t last = 0;
    std::uint32_t* end = codes;
    for (std::size_t z = 0; z < plane.rows; ++z) {
        if (!rows.is_plain(z, 2)) {
            end = row_codes(end, plane, z, order, last);
            continue;
        }
        const std::uint32_t* const cells = plane.row(z) + rows.x();
        const std::uint32_t* const up = cells - stride;
        end[0] = zigzag32(cells[0] - (2 * up[0] - *(up - stride)));
        if (order == PlaneOrder::second) {
            end[1] = zigzag32(cells[1] - predict_first(cells + 1, stride));
            second_codes(end + 2, cells + 2, stride, rows.length() - 2);
        } else {
            first_codes(end + 1, cells + 1, stride, rows.length() - 1);
        }
        end += rows.length();
        last = cells[rows.length() - 1];
    }
    return static_cast<std::size_t>(end - codes);
}

/// How many codes do not fit into a byte beside the mark of an escape.
TERRANE_CLONES
std::uint32_t count_escapes(const std::uint32_t* codes, std::size_t count, std::uint32_t mark) {
    std::uint32_t escapes = 0;
    for (std::size_t i = 0; i < count; ++i) {
        escapes += codes[i] >= mark ? 1U : 0U;
    }
    return escapes;
}

/// min(code, mark), the bytes that begin at bit `shift`.
TERRANE_CLONES
void put_bytes(std::uint8_t* __restrict out, const std::uint32_t* __restrict codes,
               std::size_t count, std::uint32_t mark, unsigned shift) {
    for (std::size_t i = 0; i < count; ++i) {
        out[i] = static_cast<std::uint8_t>(std::min(codes[i], mark) >> shift);
    }
}

std::uint8_t* grow(Bytes& out, std::size_t bytes) {
    const std::size_t begin = out.size();
    out.resize(begin + bytes);
    return reinterpret_cast<std::uint8_t*>(out.data() + begin);
}

/// The mark of a code that is beyond what `bytes` bytes can say.
constexpr std::uint32_t mark_of(std::size_t bytes) {
    return (1U << (8U * bytes)) - 1;
}

/// The codes at or above the mark. `low_begin` is where in `out` the `count` low bytes of all
/// begin: an escape's is 255.
void put_escapes(Bytes& out, std::size_t low_begin, const std::uint32_t* codes, std::size_t count,
                 std::uint32_t mark, std::uint32_t escapes) {
    constexpr std::size_t kVarint32BytesMax = 5;
    std::array<std::byte, kPlaneSideMax * kVarint32BytesMax> bytes;
    std::size_t size = 0;
    for (std::size_t i = 0; escapes > 0; ++i) {
        const std::byte* const low = out.data() + low_begin;  // an insertion below may move it
        const void* const found = std::memchr(low + i, 0xFF, count - i);
        i = static_cast<std::size_t>(static_cast<const std::byte*>(found) - low);
        std::uint32_t code = codes[i];
        if (code < mark) {
            continue;
        }
        --escapes;
        for (code -= mark; code >= 0x80U; code >>= 7U) {
            bytes[size++] = static_cast<std::byte>(code | 0x80U);
        }
        bytes[size++] = static_cast<std::byte>(code);
        if (size + kVarint32BytesMax > bytes.size() || escapes == 0) {
            out.insert(out.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
            size = 0;
        }
    }
}

bool take_heights(std::uint32_t* codes, std::size_t count, std::size_t width, ByteReader& in) {
    const auto bytes = in.take(count * width);
    if (!bytes) {
        return false;
    }
    std::uint32_t most = 0;
    for (std::size_t i = 0; i < count; ++i) {
        codes[i] = static_cast<std::uint32_t>((*bytes)[i]);
        if (width == 2) {
            codes[i] |= static_cast<std::uint32_t>((*bytes)[count + i]) << 8U;
        }
        most = std::max(most, codes[i]);
    }
    const std::uint32_t mark = mark_of(width);
    for (std::size_t i = 0; most == mark && i < count; ++i) {
        if (codes[i] == mark) {
            const std::optional<std::uint64_t> beyond = in.varint();
            if (!beyond || *beyond > 0xFFFFFFFFU - mark) {
                return false;
            }
            codes[i] += static_cast<std::uint32_t>(*beyond);
        }
    }
    return true;
}

/// Adds the predictions that need no cell of this span to the residuals, then sums up.
void add_first(std::uint32_t* cells, std::size_t stride, std::uint32_t* residuals,
               std::size_t length) {
    for (std::size_t i = 0; i < length; ++i) {
        residuals[i] += predict_first(cells + i, stride) - (cells + i)[-1];
    }
    std::uint32_t left = cells[-1];
    for (std::size_t i = 0; i < length; ++i) {
        left += residuals[i];
        cells[i] = left;
    }
}

void add_second(std::uint32_t* cells, std::size_t stride, std::uint32_t* residuals,
                std::size_t length) {
    for (std::size_t i = 0; i < length; ++i) {
        residuals[i] += predict_second(cells + i, stride) - 2 * (cells + i)[-1] + (cells + i)[-2];
    }
    std::uint32_t left = cells[-1];
    std::uint32_t slope = left - cells[-2];
    for (std::size_t i = 0; i < length; ++i) {
        slope += residuals[i];
        left += slope;
        cells[i] = left;
    }
}

/// Cells from residuals that lie one after the other; they are used up.
void add_predictions(const PlaneView& plane, PlaneOrder order, std::uint32_t* residuals) {
    std::uint32_t last = 0;
    for_each_span(plane, order, [&](const CellSpan& span) {
        std::uint32_t* cells = plane.row(span.z) + span.x;
        switch (span.kind) {
            case SpanKind::second:
                add_second(cells, plane.stride, residuals, span.length);
                break;
            case SpanKind::first:
                add_first(cells, plane.stride, residuals, span.length);
                break;
            case SpanKind::edge:
                *cells = predict_edge(edge_of(plane, span), plane.stride, last) + *residuals;
                break;
        }
        residuals += span.length;
        last = cells[span.length - 1];
        return true;
    });
}

std::size_t cell_count(const PlaneView& plane) {
    std::size_t count = 0;
    for (std::size_t z = 0; z < plane.rows; ++z) {
        count += cells_of(plane.present[z]);
    }
    return count;
}

// Flows: four bytes a value, of which each is a plane. The highest one is 0 and stays so.

constexpr std::size_t kFlowParts = 3;
constexpr std::uint32_t kHighBits = 0x80808080U;

/// Byte by byte, modulo 256.
constexpr std::uint32_t add_bytes(std::uint32_t a, std::uint32_t b) {
    return ((a & ~kHighBits) + (b & ~kHighBits)) ^ ((a ^ b) & kHighBits);
}

constexpr std::uint32_t subtract_bytes(std::uint32_t a, std::uint32_t b) {
    return ((a | kHighBits) - (b & ~kHighBits)) ^ ((a ^ ~b) & kHighBits);
}

constexpr std::uint32_t zigzag_bytes(std::uint32_t values) {
    const std::uint32_t signs = (values & kHighBits) >> 7U;
    return (values & ~kHighBits) << 1U ^ ((signs << 8U) - signs);
}

constexpr std::uint32_t unzigzag_bytes(std::uint32_t codes) {
    const std::uint32_t signs = codes & 0x01010101U;
    return (codes & 0xFEFEFEFEU) >> 1U ^ ((signs << 8U) - signs);
}

static_assert(zigzag_bytes(0x00FF017FU) == 0x000102FEU &&
              unzigzag_bytes(0x000102FEU) == 0x00FF017FU);

/// As zigzag_bytes and so on have it, but of bytes, which processors can do at once.
TERRANE_CLONES
void flow_codes(std::uint32_t* __restrict codes, const std::uint32_t* __restrict cells,
                std::size_t stride, std::size_t length) {
    constexpr std::size_t kBytes = sizeof *cells;
    auto* const to = reinterpret_cast<unsigned char*>(codes);
    const auto* const cell = reinterpret_cast<const unsigned char*>(cells);
    const auto* const left = reinterpret_cast<const unsigned char*>(cells - 1);
    const auto* const up = reinterpret_cast<const unsigned char*>(cells - stride);
    const auto* const up_left = reinterpret_cast<const unsigned char*>(cells - stride - 1);
    const std::size_t padded = kBytes * whole_blocks(length);
    for (std::size_t i = 0; i < padded; ++i) {
        const auto residual =
            static_cast<unsigned char>((cell[i] - left[i]) - (up[i] - up_left[i]));
        const auto twice = static_cast<unsigned char>(residual + residual);
        to[i] = residual > 0x7F ? static_cast<unsigned char>(~twice) : twice;
    }
}

std::uint32_t predict_flow_edge(const EdgeCell& edge, std::size_t stride, std::uint32_t last) {
    const std::uint32_t* cell = edge.cell;
    const std::uint32_t* up = cell - stride;
    if (edge.has(0, edge.bit - 1)) {
        return edge.has(0, edge.bit - 2) ? add_bytes(cell[-1], subtract_bytes(cell[-1], cell[-2]))
                                         : cell[-1];
    }
    if (edge.has(1, edge.bit)) {
        return edge.has(2, edge.bit) ? add_bytes(up[0], subtract_bytes(up[0], *(up - stride)))
                                     : up[0];
    }
    if (edge.has(1, edge.bit - 1)) {
        return up[-1];
    }
    return edge.has(1, edge.bit + 1) ? up[1] : last;
}

std::size_t flow_codes_of(std::uint32_t* codes, const PlaneView& plane) {
    const std::size_t stride = plane.stride;
    PlainRows rows(plane.present);
    std::uint32_t last = 0;
    std::uint32_t* end = codes;
    for (std::size_t z = 0; z < plane.rows; ++z) {
        if (rows.is_plain(z, 2)) {
            const std::uint32_t* const cells = plane.row(z) + rows.x();
            const std::uint32_t* const up = cells - stride;
            const std::uint32_t predicted = add_bytes(up[0], subtract_bytes(up[0], *(up - stride)));
            end[0] = zigzag_bytes(subtract_bytes(cells[0], predicted));
            flow_codes(end + 1, cells + 1, stride, rows.length() - 1);
            end += rows.length();
            last = cells[rows.length() - 1];
            continue;
        }
        for_each_span_of_row(plane, z, PlaneOrder::first, [&](const CellSpan& span) {
            const std::uint32_t* cells = plane.row(span.z) + span.x;
            if (span.kind == SpanKind::first) {
                flow_codes(end, cells, stride, span.length);
            } else {
                *end = zigzag_bytes(
                    subtract_bytes(*cells, predict_flow_edge(edge_of(plane, span), stride, last)));
            }
            end += span.length;
            last = cells[span.length - 1];
            return true;
        });
    }
    return static_cast<std::size_t>(end - codes);
}

void add_flows(std::uint32_t* cells, std::size_t stride, std::uint32_t* residuals,
               std::size_t length) {
    const std::uint32_t* up = cells - stride;
    for (std::size_t i = 0; i < length; ++i) {
        residuals[i] = add_bytes(residuals[i], subtract_bytes(up[i], (up + i)[-1]));
    }
    std::uint32_t left = cells[-1];
    for (std::size_t i = 0; i < length; ++i) {
        left = add_bytes(left, residuals[i]);
        cells[i] = left;
    }
}

}  // namespace

void encode_heights(Bytes& out, const PlaneView& plane, PlaneCodes& scratch) {
    std::uint32_t* const codes = scratch.of_cells.data();
    const PlaneOrder order = better_order(plane, codes);
    const std::size_t count = codes_of(codes, plane, order);
    std::uint32_t escapes = count_escapes(codes, count, mark_of(1));
    // A second byte for all is cheaper than an escape for one in eight; the first always is one.
    const std::size_t width = escapes > 1 + count / 8 ? 2 : 1;
    if (width == 2) {
        escapes = count_escapes(codes, count, mark_of(2));
    }
    const std::size_t low_begin = out.size() + 1;
    std::uint8_t* to = grow(out, 1 + width * count);
    *to++ = static_cast<std::uint8_t>((order == PlaneOrder::second ? kHeadSecondOrder : 0) |
                                      (width == 2 ? kHeadTwoBytes : 0));
    put_bytes(to, codes, count, mark_of(width), 0);
    if (width == 2) {
        put_bytes(to + count, codes, count, mark_of(width), 8);
    }
    put_escapes(out, low_begin, codes, count, mark_of(width), escapes);
}

bool decode_heights(const PlaneView& plane, ByteReader& in) {
    const auto head = in.fixed<std::uint8_t>();
    if (!head || *head > kHeadMost) {
        return false;
    }
    PlaneCodes codes;
    const std::size_t count = cell_count(plane);
    if (!take_heights(codes.of_cells.data(), count, (*head & kHeadTwoBytes) != 0 ? 2 : 1, in)) {
        return false;
    }
    for (std::size_t i = 0; i < count; ++i) {
        codes.of_cells[i] = unzigzag32(codes.of_cells[i]);
    }
    add_predictions(plane, (*head & kHeadSecondOrder) != 0 ? PlaneOrder::second : PlaneOrder::first,
                    codes.of_cells.data());
    return true;
}

void encode_flows(Bytes& out, const PlaneView& plane, PlaneCodes& scratch) {
    std::uint32_t* const codes = scratch.of_cells.data();
    const std::size_t count = flow_codes_of(codes, plane);
    std::uint8_t* const to = grow(out, kFlowParts * count);
    for (unsigned part = 0; part < kFlowParts; ++part) {
        put_bytes(to + part * count, codes, count, 0xFFFFFFFFU, 8 * part);
    }
}

bool decode_flows(const PlaneView& plane, ByteReader& in) {
    const std::size_t count = cell_count(plane);
    const auto bytes = in.take(kFlowParts * count);
    if (!bytes) {
        return false;
    }
    PlaneCodes codes;
    std::uint32_t* residuals = codes.of_cells.data();
    for (std::size_t i = 0; i < count; ++i) {
        residuals[i] = unzigzag_bytes(static_cast<std::uint32_t>((*bytes)[i]) |
                                      static_cast<std::uint32_t>((*bytes)[count + i]) << 8U |
                                      static_cast<std::uint32_t>((*bytes)[2 * count + i]) << 16U);
    }
    std::uint32_t last = 0;
    for_each_span(plane, PlaneOrder::first, [&](const CellSpan& span) {
        std::uint32_t* cells = plane.row(span.z) + span.x;
        if (span.kind == SpanKind::first) {
            add_flows(cells, plane.stride, residuals, span.length);
        } else {
            *cells =
                add_bytes(predict_flow_edge(edge_of(plane, span), plane.stride, last), *residuals);
        }
        residuals += span.length;
        last = cells[span.length - 1];
        return true;
    });
    return true;
}

}  // namespace terrane
