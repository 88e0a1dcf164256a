#include "generator/volume/plane_coder.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
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

// The loops below work on a span at a time, through buffers that alias nothing, to be vectorised.
using SpanBuffer = std::array<std::uint32_t, kPlaneSideMax>;

void first_residuals(SpanBuffer& out, const std::uint32_t* cells, std::size_t length) {
    for (std::size_t i = 0; i < length; ++i) {
        out[i] = cells[i] - predict_first(cells + i);
    }
}

void second_residuals(SpanBuffer& out, const std::uint32_t* cells, std::size_t length) {
    for (std::size_t i = 0; i < length; ++i) {
        out[i] = cells[i] - predict_second(cells + i);
    }
}

/// Sum of the residuals' sizes, each taken as at most 2^24.
std::uint32_t weight(const SpanBuffer& residuals, std::size_t length) {
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < length; ++i) {
        const std::uint32_t size = std::min(residuals[i], 0U - residuals[i]);
        sum += std::min(size, 1U << 24U);
    }
    return sum;
}

/// The order whose residuals are smaller where both apply.
PlaneOrder better_order(const Plane& plane) {
    std::uint64_t first = 0;
    std::uint64_t second = 0;
    SpanBuffer residuals;
    for_each_span(plane, PlaneOrder::second, [&](const CellSpan& span) {
        if (span.kind == SpanKind::second) {
            const std::uint32_t* cells = plane.row(span.z) + span.x;
            first_residuals(residuals, cells, span.length);
            first += weight(residuals, span.length);
            second_residuals(residuals, cells, span.length);
            second += weight(residuals, span.length);
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

/// Calls write(residuals, length) for each span.
template <typename Write>
void write_residuals(const Plane& plane, PlaneOrder order, Write write) {
    std::uint32_t last = 0;
    SpanBuffer residuals;
    for_each_span(plane, order, [&](const CellSpan& span) {
        const std::uint32_t* cells = plane.row(span.z) + span.x;
        switch (span.kind) {
            case SpanKind::second:
                second_residuals(residuals, cells, span.length);
                break;
            case SpanKind::first:
                first_residuals(residuals, cells, span.length);
                break;
            case SpanKind::edge:
                residuals[0] = cells[0] - predict_edge(plane, span, last);
                break;
        }
        write(residuals, span.length);
        last = cells[span.length - 1];
        return true;
    });
}

/// Adds the predictions that need no cell of this span to the residuals, then sums up.
void add_first(std::uint32_t* cells, SpanBuffer& residuals, std::size_t length) {
    for (std::size_t i = 0; i < length; ++i) {
        residuals[i] += predict_first(cells + i) - (cells + i)[-1];
    }
    std::uint32_t left = cells[-1];
    for (std::size_t i = 0; i < length; ++i) {
        left += residuals[i];
        cells[i] = left;
    }
}

void add_second(std::uint32_t* cells, SpanBuffer& residuals, std::size_t length) {
    for (std::size_t i = 0; i < length; ++i) {
        residuals[i] += predict_second(cells + i) - 2 * (cells + i)[-1] + (cells + i)[-2];
    }
    std::uint32_t left = cells[-1];
    std::uint32_t slope = left - cells[-2];
    for (std::size_t i = 0; i < length; ++i) {
        slope += residuals[i];
        left += slope;
        cells[i] = left;
    }
}

/// read(residuals, length) gives false at the end of the bytes; `finish` is given each span of
/// cells.
template <typename Read, typename Finish>
bool read_residuals(Plane& plane, PlaneOrder order, Read read, Finish finish) {
    std::uint32_t last = 0;
    SpanBuffer residuals;
    return for_each_span(plane, order, [&](const CellSpan& span) {
        std::uint32_t* cells = plane.row(span.z) + span.x;
        if (!read(residuals, span.length)) {
            return false;
        }
        switch (span.kind) {
            case SpanKind::second:
                add_second(cells, residuals, span.length);
                break;
            case SpanKind::first:
                add_first(cells, residuals, span.length);
                break;
            case SpanKind::edge:
                cells[0] = predict_edge(plane, span, last) + residuals[0];
                break;
        }
        finish(cells, span.length);
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

/// Small codes, the rule, are copied at once.
std::byte* put_varints(std::byte* end, SpanBuffer& residuals, std::size_t length) {
    std::uint32_t all = 0;
    for (std::size_t i = 0; i < length; ++i) {
        residuals[i] = zigzag32(residuals[i]);
        all |= residuals[i];
    }
    if (all < 0x80U) {
        std::array<std::byte, kPlaneSideMax> bytes;
        for (std::size_t i = 0; i < length; ++i) {
            bytes[i] = static_cast<std::byte>(residuals[i]);
        }
        std::memcpy(end, bytes.data(), length);
        return end + length;
    }
    for (std::size_t i = 0; i < length; ++i) {
        std::uint32_t code = residuals[i];
        for (; code >= 0x80U; code >>= 7U) {
            *end++ = static_cast<std::byte>(code | 0x80U);
        }
        *end++ = static_cast<std::byte>(code);
    }
    return end;
}

bool take_varints(SpanBuffer& residuals, std::size_t length, ByteReader& in) {
    ByteReader ahead = in;
    if (const auto bytes = ahead.take(length)) {
        std::uint32_t all = 0;
        for (std::size_t i = 0; i < length; ++i) {
            residuals[i] = static_cast<std::uint32_t>((*bytes)[i]);
            all |= residuals[i];
        }
        if (all < 0x80U) {
            for (std::size_t i = 0; i < length; ++i) {
                residuals[i] = unzigzag32(residuals[i]);
            }
            in = ahead;
            return true;
        }
    }
    for (std::size_t i = 0; i < length; ++i) {
        const std::optional<std::uint64_t> code = in.varint();
        if (!code || *code > 0xFFFFFFFFU) {
            return false;
        }
        residuals[i] = unzigzag32(static_cast<std::uint32_t>(*code));
    }
    return true;
}

}  // namespace

void encode_heights(Bytes& out, const Plane& plane) {
    constexpr std::size_t kVarint32BytesMax = 5;
    const PlaneOrder order = better_order(plane);
    const std::size_t begin = out.size();
    out.resize(begin + 1 + kVarint32BytesMax * cell_count(plane));
    std::byte* end = out.data() + begin;
    *end++ = static_cast<std::byte>(order);
    write_residuals(plane, order, [&](SpanBuffer& residuals, std::size_t length) {
        end = put_varints(end, residuals, length);
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
        [&](SpanBuffer& residuals, std::size_t length) {
            return take_varints(residuals, length, in);
        },
        [](std::uint32_t*, std::size_t) {});
}

void encode_bytes(Bytes& out, const Plane& plane) {
    const std::size_t begin = out.size();
    out.resize(begin + cell_count(plane));
    std::byte* end = out.data() + begin;
    write_residuals(plane, PlaneOrder::first, [&](SpanBuffer& residuals, std::size_t length) {
        std::array<std::byte, kPlaneSideMax> bytes;
        for (std::size_t i = 0; i < length; ++i) {
            bytes[i] = static_cast<std::byte>(zigzag32(narrow_to_byte(residuals[i])));
        }
        std::memcpy(end, bytes.data(), length);
        end += length;
    });
}

bool decode_bytes(Plane& plane, ByteReader& in) {
    return read_residuals(
        plane, PlaneOrder::first,
        [&](SpanBuffer& residuals, std::size_t length) {
            const auto bytes = in.take(length);
            for (std::size_t i = 0; bytes && i < length; ++i) {
                residuals[i] = unzigzag32(static_cast<std::uint32_t>((*bytes)[i]));
            }
            return bytes.has_value();
        },
        [](std::uint32_t* cells, std::size_t length) {
            for (std::size_t i = 0; i < length; ++i) {
                cells[i] = narrow_to_byte(cells[i]);
            }
        });
}

}  // namespace terrane
