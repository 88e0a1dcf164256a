// A route's question to the chunk service, and what becomes of it when the client leaves.
#pragma once

#include "server/chunks/chunk_service.h"
#include "server/http/http_message.h"

#include <cstdint>
#include <functional>
#include <optional>

namespace terrane {

/// Makes a response of the service's answer, on the caller's thread or on a worker's.
using ResponseOf = std::function<HttpResponse(const Result<Answer>&)>;

/// Asks for one piece of work on behalf of `request`; a higher priority is served sooner. Returns
/// the response if the answer is in the cache or a refusal, else it goes by way of `later`. If the
/// client goes first, the question is taken back and may never be answered. `service` outlives all
/// answers.
std::optional<HttpResponse> ask_service(ChunkService& service, const WorkKey& key,
                                        const HttpRequest& request, const HttpLater& later,
                                        ResponseOf response_of, std::int32_t priority = 0);

}  // namespace terrane
