#include "server/net/session_caps.h"

#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"
#include "server/net/view.h"

#include <algorithm>
#include <cstddef>

namespace terrane {

namespace {

/// A session's own objects, its buffer for reading and its socket's.
constexpr std::size_t kSessionBytes = std::size_t{8} << 10U;
/// A wish in the session's tree or table, with its node: sizeof and the nodes around it.
constexpr std::size_t kWishBytes = 192;
/// A frame that is being read: a vector grows to twice what it holds, and the head is copied.
constexpr std::size_t kReaderBytes = 3 * kInboundFrameBytesMax;

}  // namespace

SessionCaps clamped(SessionCaps caps) {
    const SessionCaps most;
    caps.keys_in_flight_max = std::clamp(caps.keys_in_flight_max, 1U, most.keys_in_flight_max);
    caps.wishes_under_way_max =
        std::clamp(caps.wishes_under_way_max, 1U, most.wishes_under_way_max);
    caps.view_radius_max = std::min(caps.view_radius_max, most.view_radius_max);
    caps.view_squares_max = std::clamp(caps.view_squares_max, 9U, most.view_squares_max);
    caps.credit_window_bytes =
        std::clamp(caps.credit_window_bytes, kCreditWindowBytesMin, kCreditWindowBytesMax);
    return caps;
}

WireLimits limits_of(const SessionCaps& caps) {
    return {.keys_per_request_max = kKeysPerRequestMax,
            .keys_in_flight_max = caps.keys_in_flight_max,
            .inbound_frame_bytes_max = kInboundFrameBytesMax,
            .payload_bytes_max = kPayloadBytesMax,
            .view_radius_max = caps.view_radius_max,
            .credit_window_bytes = caps.credit_window_bytes,
            .requests_per_second_max = caps.requests_per_second_max,
            .bytes_per_second_max = caps.bytes_per_second_max};
}

std::size_t session_bytes_max(const SessionCaps& caps) {
    const std::size_t wishes = std::size_t{caps.keys_in_flight_max} + caps.wishes_under_way_max;
    const std::size_t view =
        caps.view_radius_max == 0 ? 0 : View::bytes_max({.squares_max = caps.view_squares_max});
    return kSessionBytes + kReaderBytes + wishes * kWishBytes + view;
}

}  // namespace terrane
