// Results: how everything in Terrane that can fail on bad input says so.
//
// `Result<T>` is a value or an `Error`; a caller handles it or passes it on. Broken invariants of
// our own are `TERRANE_ASSERT` (check.h) and never a Result. The codes are the wire's: one table,
// never renumbered, because clients written against an old server must still understand them.
#pragma once

#include <tl/expected.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace terrane {

enum class ErrorCode : std::uint8_t {
    malformed = 1,          ///< bytes that do not follow the format
    too_large = 2,          ///< a length or count above its named limit
    unsupported = 3,        ///< a version, format or level of detail this build does not speak
    out_of_range = 4,       ///< a coordinate or number outside its documented range
    invalid_argument = 5,   ///< a flag, key or world file that makes no sense
    busy = 6,               ///< a limit is reached now; try again after `retry_after_ms`
    cancelled = 7,          ///< whoever asked does not want it any more
    not_found = 8,          ///< the thing asked for does not exist
    wrong_world = 9,        ///< made for another world fingerprint
    version_mismatch = 10,  ///< made by a newer or incompatible version
    io_error = 11,          ///< disk or socket failed
    corrupt = 12,           ///< stored bytes fail their checksum or format
    draining = 13,          ///< the server is shutting down
    unauthorized = 14,      ///< a token is missing, wrong or expired
    internal = 15,          ///< our own fault, caught at an edge
};

/// The code's name as it stands in logs and JSON, e.g. "out_of_range".
std::string_view to_string(ErrorCode code);

/// `message` is for a person: what, where, with the number in it, and what to do. No final period.
struct Error {
    ErrorCode code;
    std::string message;

    friend bool operator==(const Error&, const Error&) = default;
};

template <typename T>
using Result = tl::expected<T, Error>;

inline tl::unexpected<Error> fail(ErrorCode code, std::string message) {
    return tl::unexpected<Error>(Error{.code = code, .message = std::move(message)});
}

}  // namespace terrane
