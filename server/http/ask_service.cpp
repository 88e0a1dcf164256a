#include "server/http/ask_service.h"

#include "protocol/base/result.h"
#include "server/chunks/answer.h"
#include "server/chunks/chunk_key.h"
#include "server/chunks/chunk_service.h"
#include "server/chunks/in_flight.h"
#include "server/http/http_message.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <utility>

namespace terrane {

namespace {

/// A question without an answer yet. The service's table owns it, by way of the callback.
struct Question {
    ResponseOf response_of;
    HttpRespond respond;
    std::optional<std::stop_callback<std::function<void()>>> on_stop;

    void answer(const Result<Answer>& result) const { respond(response_of(result)); }
};

}  // namespace

std::optional<HttpResponse> ask_service(ChunkService& service, const WorkKey& key,
                                        const HttpRequest& request, const HttpLater& later,
                                        ResponseOf response_of, std::int32_t priority) {
    if (auto answer = service.at_hand(key)) {  // nearly always, and it takes no memory
        return response_of(*std::move(answer));
    }
    const WaiterId id = service.new_waiter_id();
    const auto question = std::make_shared<Question>();
    question->response_of = std::move(response_of);
    question->respond = later();
    const auto outcome = service.request(
        key, priority,
        {.id = id,
         .answer = [question](const Result<Answer>& result) { question->answer(result); },
         .flow = request.flow});
    if (!outcome) {
        question->answer(tl::unexpected(outcome.error()));
    } else if (const std::optional<Answer>& answer = *outcome) {
        question->answer(*answer);
    } else if (request.stop.stop_possible()) {
        const std::weak_ptr<Question> weak = question;
        question->on_stop.emplace(request.stop, [&service, key, id, weak] {
            const auto keep = weak.lock();  // so that it isn't freed within the service's lock
            service.cancel(key, id);
        });
    }
    return std::nullopt;
}

}  // namespace terrane
