#include "generator/volume/plane_coder.h"

#include <bit>
#include <optional>

namespace terrane {
namespace {

enum class SpanKind : std::uint8_t { second, first, edge };

struct CellSpan {
    SpanKind kind = SpanKind::edge;
    std::size_t z = 0;
    std::size_t x = 0;  ///< with the margin: a bit of RowMask
    std::size_t length = 0;
};

std::size_t trailing_zeros(RowMask mask) {
    const auto low = static_cast<std::uint64_t>(mask);
    return low != 0 ? static_cast<std::size_t>(std::countr_zero(low))
                    : 64 + static_cast<std::size_t>(
                               std::countr_zero(static_cast<std::uint64_t>(mask >> 64U)));
}

/// Calls `visit` with every present cell in raster order, in spans of one kind of prediction; stops
/// when it says false. `z` + margin is the index of the row.
template <typename Visit>
bool for_each_span(const Plane& plane, PlaneOrder order, Visit visit) {
    for (std::size_t row = Plane::kMargin; row < plane.present.size(); ++row) {
        const RowMask cells = plane.present[row];
        if (cells == 0) {
            continue;
        }
        const RowMask up = plane.present[row - 1];
        const RowMask upper = plane.present[row - 2];
        const RowMask first = cells & cells << 1U & up & up << 1U;
        const RowMask second = order == PlaneOrder::second ? first & cells << 2U & up << 2U &
                                                                 upper & upper << 1U & upper << 2U
                                                           : 0;
        for (RowMask rest = cells; rest != 0;) {
            CellSpan span = {.kind = SpanKind::edge,
                             .z = row - Plane::kMargin,
                             .x = trailing_zeros(rest),
                             .length = 1};
            if ((second >> span.x & 1U) != 0) {
                span.kind = SpanKind::second;
                span.length = trailing_zeros(~(second >> span.x));
            } else if ((first >> span.x & 1U) != 0) {
                span.kind = SpanKind::first;
                span.length = trailing_zeros(~((first & ~second) >> span.x));
            }
            rest &= ~(((RowMask{1} << span.length) - 1) << span.x);
            span.x -= Plane::kMargin;
            if (!visit(span)) {
                return false;
            }
        }
    }
    return true;
}

std::uint32_t predict_first(const std::uint32_t* cell) {
    const std::uint32_t* up = cell - Plane::kStride;
    return cell[-1] + up[0] - up[-1];
}

std::uint32_t predict_second(const std::uint32_t* cell) {
    const std::uint32_t* up = cell - Plane::kStride;
    const std::uint32_t* upper = up - Plane::kStride;
    return 2 * (cell[-1] + up[0] + up[-2] + upper[-1]) - 4 * up[-1] - cell[-2] - upper[0] -
           upper[-2];
}

/// For cells that lack the neighbours of the above. `last` is the cell coded before, 0 at first.
std::uint32_t predict_edge(const Plane& plane, const CellSpan& span, std::uint32_t last) {
    const std::size_t row = span.z + Plane::kMargin;
    const std::size_t bit = span.x + Plane::kMargin;
    const std::uint32_t* cell = plane.row(span.z) + span.x;
    const std::uint32_t* up = cell - Plane::kStride;
    const auto has = [&](std::size_t rows_up, std::size_t at_bit) {
        return (plane.present[row - rows_up] >> at_bit & 1U) != 0;
    };
    if (has(0, bit - 1)) {
        return has(0, bit - 2) ? 2 * cell[-1] - cell[-2] : cell[-1];
    }
    if (has(1, bit)) {
        return has(2, bit) ? 2 * up[0] - up[-static_cast<std::ptrdiff_t>(Plane::kStride)] : up[0];
    }
    if (has(1, bit - 1)) {
        return up[-1];
    }
    return has(1, bit + 1) ? up[1] : last;
}

std::uint32_t magnitude(std::uint32_t residual) {
    return static_cast<std::int32_t>(residual) < 0 ? 0U - residual : residual;
}

/// The order whose residuals are smaller where both apply.
PlaneOrder better_order(const Plane& plane) {
    std::uint64_t first = 0;
    std::uint64_t second = 0;
    for_each_span(plane, PlaneOrder::second, [&](const CellSpan& span) {
        const std::uint32_t* cells = plane.row(span.z) + span.x;
        for (std::size_t i = 0; span.kind == SpanKind::second && i < span.length; ++i) {
            first += magnitude(cells[i] - predict_first(cells + i));
            second += magnitude(cells[i] - predict_second(cells + i));
        }
        return true;
    });
    return second < first ? PlaneOrder::second : PlaneOrder::first;
}

std::size_t cell_count(const Plane& plane) {
    std::size_t count = 0;
    for (const RowMask mask : plane.present) {
        count += static_cast<std::size_t>(std::popcount(static_cast<std::uint64_t>(mask)) +
                                          std::popcount(static_cast<std::uint64_t>(mask >> 64U)));
    }
    return count;
}

/// Calls write(residual) for each present cell.
template <typename Write>
void write_residuals(const Plane& plane, PlaneOrder order, Write write) {
    std::uint32_t last = 0;
    for_each_span(plane, order, [&](const CellSpan& span) {
        const std::uint32_t* cells = plane.row(span.z) + span.x;
        switch (span.kind) {
            case SpanKind::second:
                for (std::size_t i = 0; i < span.length; ++i) {
                    write(cells[i] - predict_second(cells + i));
                }
                break;
            case SpanKind::first:
                for (std::size_t i = 0; i < span.length; ++i) {
                    write(cells[i] - predict_first(cells + i));
                }
                break;
            case SpanKind::edge:
                write(cells[0] - predict_edge(plane, span, last));
                break;
        }
        last = cells[span.length - 1];
        return true;
    });
}

/// read(residual) gives false at the end of the bytes; `narrow` brings a sum back into range.
template <typename Read, typename Narrow>
bool read_residuals(Plane& plane, PlaneOrder order, Read read, Narrow narrow) {
    std::uint32_t last = 0;
    return for_each_span(plane, order, [&](const CellSpan& span) {
        std::uint32_t* cells = plane.row(span.z) + span.x;
        for (std::size_t i = 0; i < span.length; ++i) {
            std::uint32_t residual = 0;
            if (!read(residual)) {
                return false;
            }
            const std::uint32_t predicted =
                span.kind == SpanKind::second  ? predict_second(cells + i)
                : span.kind == SpanKind::first ? predict_first(cells + i)
                                               : predict_edge(plane, span, last);
            cells[i] = narrow(predicted + residual);
        }
        last = cells[span.length - 1];
        return true;
    });
}

std::uint32_t zigzag32(std::uint32_t value) {
    return value << 1U ^ (0U - (value >> 31U));
}

std::uint32_t unzigzag32(std::uint32_t value) {
    return value >> 1U ^ (0U - (value & 1U));
}

/// The value of the low 8 bits, sign included.
std::uint32_t narrow_to_byte(std::uint32_t value) {
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(static_cast<std::int8_t>(value)));
}

}  // namespace

void encode_heights(Bytes& out, const Plane& plane) {
    constexpr std::size_t kVarint32BytesMax = 5;
    const PlaneOrder order = better_order(plane);
    const std::size_t begin = out.size();
    out.resize(begin + 1 + kVarint32BytesMax * cell_count(plane));
    std::byte* end = out.data() + begin;
    *end++ = static_cast<std::byte>(order);
    write_residuals(plane, order, [&](std::uint32_t residual) {
        std::uint32_t code = zigzag32(residual);
        for (; code >= 0x80U; code >>= 7U) {
            *end++ = static_cast<std::byte>(code | 0x80U);
        }
        *end++ = static_cast<std::byte>(code);
    });
    out.resize(static_cast<std::size_t>(end - out.data()));
}

bool decode_heights(Plane& plane, ByteReader& in) {
    const auto order = in.fixed<std::uint8_t>();
    if (!order || *order > static_cast<std::uint8_t>(PlaneOrder::second)) {
        return false;
    }
    return read_residuals(
        plane, static_cast<PlaneOrder>(*order),
        [&](std::uint32_t& residual) {
            const std::optional<std::uint64_t> code = in.varint();
            residual = unzigzag32(static_cast<std::uint32_t>(code.value_or(0)));
            return code && *code <= 0xFFFFFFFFU;
        },
        [](std::uint32_t value) { return value; });
}

void encode_bytes(Bytes& out, const Plane& plane) {
    const std::size_t begin = out.size();
    out.resize(begin + cell_count(plane));
    std::byte* end = out.data() + begin;
    write_residuals(plane, PlaneOrder::first, [&](std::uint32_t residual) {
        *end++ = static_cast<std::byte>(zigzag32(narrow_to_byte(residual)));
    });
}

bool decode_bytes(Plane& plane, ByteReader& in) {
    return read_residuals(
        plane, PlaneOrder::first,
        [&](std::uint32_t& residual) {
            const auto code = in.fixed<std::uint8_t>();
            residual = unzigzag32(code.value_or(0));
            return code.has_value();
        },
        narrow_to_byte);
}

}  // namespace terrane
