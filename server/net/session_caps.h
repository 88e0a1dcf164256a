// What one session may do. The server's configuration and a client's token set it; it is clamped to
// what this build can hold and told to the client in ServerHello.limits.
#pragma once

#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <cstddef>
#include <cstdint>

namespace terrane {

/// Of one session's wishes, handed to the service at one time. The others wait in the session, so
/// that no client fills the work queue.
inline constexpr std::uint32_t kWishesUnderWayMax = 128;
inline constexpr std::uint32_t kViewRadiusMax = 64;
inline constexpr std::uint32_t kViewSquaresMax = 8192;
inline constexpr std::uint32_t kCreditWindowBytesMin = 4096;
inline constexpr std::uint32_t kCreditWindowBytesMax = std::uint32_t{16} << 20U;

struct SessionCaps {
    std::uint32_t keys_in_flight_max = kKeysInFlightPerSessionMax;  ///< 1.. the default
    std::uint32_t wishes_under_way_max = kWishesUnderWayMax;        ///< 1.. the default
    std::uint32_t view_radius_max = kViewRadiusMax;                 ///< 0: no views
    std::uint32_t view_squares_max = kViewSquaresMax;               ///< 9.. the default
    std::uint32_t credit_window_bytes = kCreditWindowBytes;         ///< 4 KiB..16 MiB
    std::uint32_t requests_per_second_max = 0;                      ///< 0: no cap
    std::uint64_t bytes_per_second_max = 0;                         ///< 0: no cap

    friend bool operator==(const SessionCaps&, const SessionCaps&) = default;
};

/// Each value moved into the range that stands beside it.
SessionCaps clamped(SessionCaps caps);
/// What a ServerHello tells of them.
WireLimits limits_of(const SessionCaps& caps);
/// What one session may come to hold besides its outbox: half a frame, wishes, a view.
std::size_t session_bytes_max(const SessionCaps& caps);

}  // namespace terrane
