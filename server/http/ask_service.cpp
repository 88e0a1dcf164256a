#include "server/http/ask_service.h"

#include <memory>
#include <optional>
#include <stop_token>
#include <utility>

namespace terrane {

namespace {

/// A question without an answer yet. The service's table owns it, by way of the callback.
struct Question {
    ThenAnswer then;
    std::optional<std::stop_callback<std::function<void()>>> on_stop;
};

}  // namespace

void ask_service(ChunkService& service, const WorkKey& key, const HttpRequest& request,
                 ThenAnswer then, std::int32_t priority) {
    const WaiterId id = service.new_waiter_id();
    const auto question = std::make_shared<Question>();
    question->then = std::move(then);
    const auto outcome = service.request(
        key, priority,
        {.id = id,
         .answer = [question](const Result<Answer>& result) { question->then(result); },
         .flow = request.flow});
    if (!outcome) {
        question->then(tl::unexpected(outcome.error()));
    } else if (*outcome) {
        question->then(**outcome);
    } else if (request.stop.stop_possible()) {
        const std::weak_ptr<Question> weak = question;
        question->on_stop.emplace(request.stop, [&service, key, id, weak] {
            const auto keep = weak.lock();  // so that it isn't freed within the service's lock
            service.cancel(key, id);
        });
    }
}

}  // namespace terrane
