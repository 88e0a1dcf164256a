// Errors as HTTP says them: a status and an `application/problem+json` body (RFC 9457).
#pragma once

#include "protocol/base/result.h"
#include "server/http/http_message.h"

#include <cstdint>
#include <string>
#include <string_view>

namespace terrane {

/// "Not Found" for 404; empty for a status that this server never sends.
std::string_view reason_phrase(unsigned status);

/// The status of an answer that failed with this code.
unsigned http_status_of(ErrorCode code);

/// {"type": "about:blank", "title", "status", "detail"}.
HttpResponse http_problem(unsigned status, std::string_view detail);

/// With `code` beside it, the name in ErrorCode's table. Busy carries Retry-After, whole seconds,
/// rounded up.
HttpResponse http_problem(const Error& error, std::uint32_t retry_after_ms = 1000);

}  // namespace terrane
