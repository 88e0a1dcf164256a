#include "server/net/request_log.h"

#include "protocol/base/result.h"
#include "protocol/wire/messages.h"
#include "server/log.h"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace terrane {

RequestLog::RequestLog(const Log* log, std::atomic<std::uint64_t>* next_number,
                       std::uint64_t session)
    : log_(next_number != nullptr ? log : nullptr), next_number_(next_number), session_(session) {}

std::uint64_t RequestLog::next_number() {
    return next_number_->fetch_add(1, std::memory_order_relaxed);
}

std::uint64_t RequestLog::begin(std::string_view kind, std::uint32_t client_request,
                                std::size_t answers_due) {
    if (log_ == nullptr) {
        return 0;
    }
    const std::uint64_t number = next_number();
    requests_.emplace(number, Request{.kind = kind,
                                      .client_request = client_request,
                                      .answers_due = answers_due,
                                      .since = std::chrono::steady_clock::now()});
    return number;
}

void RequestLog::answered(std::uint64_t number, std::size_t payload_bytes) {
    count(number, payload_bytes, false);
}

void RequestLog::failed(std::uint64_t number, const Failure& failure) {
    if (log_ == nullptr) {
        return;
    }
    const std::string key =
        failure.key
            ? std::to_string(failure.key->lod) + "/" + std::to_string(failure.key->x) + "/" +
                  std::to_string(failure.key->y) + "/" + std::to_string(failure.key->z)
            : std::string("-");
    log_->debug("failure", {{"request", number != 0 ? number : next_number()},
                            {"session", session_},
                            {"client_request", std::uint64_t{failure.request_id}},
                            {"code", std::string(to_string(failure.error.code))},
                            {"message", failure.error.message},
                            {"key", key}});
    count(number, 0, true);
}

void RequestLog::count(std::uint64_t number, std::size_t payload_bytes, bool is_failure) {
    const auto found = requests_.find(number);
    if (found == requests_.end()) {
        return;
    }
    Request& request = found->second;
    ++request.answers;
    request.failed += is_failure ? 1U : 0U;
    request.bytes += payload_bytes;
    if (request.answers == request.answers_due) {
        write(number, request);
        requests_.erase(found);
    }
}

void RequestLog::end(std::uint64_t number) {
    if (const auto found = requests_.find(number); found != requests_.end()) {
        write(number, found->second);
        requests_.erase(found);
    }
}

void RequestLog::end_all() {
    for (const auto& [number, request] : requests_) {
        write(number, request);
    }
    requests_.clear();
}

void RequestLog::write(std::uint64_t number, const Request& request) const {
    const auto took = std::chrono::duration_cast<std::chrono::microseconds>(
        std::chrono::steady_clock::now() - request.since);
    log_->debug("native", {{"request", number},
                           {"session", session_},
                           {"client_request", std::uint64_t{request.client_request}},
                           {"kind", std::string(request.kind)},
                           {"answers", std::uint64_t{request.answers}},
                           {"failed", std::uint64_t{request.failed}},
                           {"bytes", request.bytes},
                           {"us", std::int64_t{took.count()}}});
}

}  // namespace terrane
