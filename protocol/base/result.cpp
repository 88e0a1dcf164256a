#include "protocol/base/result.h"

#include <string_view>

namespace terrane {

std::string_view to_string(ErrorCode code) {
    switch (code) {
        case ErrorCode::malformed:
            return "malformed";
        case ErrorCode::too_large:
            return "too_large";
        case ErrorCode::unsupported:
            return "unsupported";
        case ErrorCode::out_of_range:
            return "out_of_range";
        case ErrorCode::invalid_argument:
            return "invalid_argument";
        case ErrorCode::busy:
            return "busy";
        case ErrorCode::cancelled:
            return "cancelled";
        case ErrorCode::not_found:
            return "not_found";
        case ErrorCode::wrong_world:
            return "wrong_world";
        case ErrorCode::version_mismatch:
            return "version_mismatch";
        case ErrorCode::io_error:
            return "io_error";
        case ErrorCode::corrupt:
            return "corrupt";
        case ErrorCode::draining:
            return "draining";
        case ErrorCode::unauthorized:
            return "unauthorized";
        case ErrorCode::internal:
            return "internal";
    }
    return "unknown";
}

}  // namespace terrane
