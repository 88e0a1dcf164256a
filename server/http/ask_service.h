// A route's question to the chunk service, and what becomes of it when the client leaves.
#pragma once

#include "server/chunks/chunk_service.h"
#include "server/http/http_message.h"

#include <cstdint>
#include <functional>

namespace terrane {

/// Told the answer once, on the caller's thread if it was in the cache, else on a worker's: hands
/// it on. If the client goes first, the question is taken back and `then` may never be called.
using ThenAnswer = std::function<void(const Result<Answer>&)>;

/// Asks for one piece of work on behalf of `request`; a higher priority is served sooner. `service`
/// outlives all answers.
void ask_service(ChunkService& service, const WorkKey& key, const HttpRequest& request,
                 ThenAnswer then, std::int32_t priority = 0);

}  // namespace terrane
