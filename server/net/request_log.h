// The debug log's lines about one session's native requests: one when a request has got all its
// answers, one for each Failure. Their numbers are of the same count as those of HTTP
// (`Terrane-Request`), so a number names one request of the whole server.
//
//     native request=71 session=3 client_request=5 kind=chunks answers=64 failed=1 bytes=81920 us=9
//     failure request=71 session=3 client_request=5 code=busy message=.. key=0/1/2/3
#pragma once

#include "protocol/wire/messages.h"
#include "server/log.h"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <unordered_map>

namespace terrane {

/// One thread.
class RequestLog {
  public:
    /// `log` is null where nobody wants these lines: then nothing is remembered, and every number
    /// is 0. Both outlive it.
    RequestLog(const Log* log, std::atomic<std::uint64_t>* next_number, std::uint64_t session);

    /// A request has come; its line is written when `answers_due` answers have been given. Gives
    /// its number.
    std::uint64_t begin(std::string_view kind, std::uint32_t client_request,
                        std::size_t answers_due);
    void answered(std::uint64_t number, std::size_t payload_bytes);
    /// A Failure is sent instead of an answer. `number` 0: it belongs to no request, and gets a
    /// number of its own.
    void failed(std::uint64_t number, const Failure& failure);
    /// No more answers will come: the view is another, the client has gone.
    void end(std::uint64_t number);
    void end_all();

  private:
    struct Request {
        std::string_view kind;
        std::uint32_t client_request = 0;
        std::size_t answers_due = 0;
        std::size_t answers = 0;
        std::size_t failed = 0;
        std::uint64_t bytes = 0;
        std::chrono::steady_clock::time_point since;
    };

    using Requests = std::unordered_map<std::uint64_t, Request>;

    std::uint64_t next_number();
    void count(std::uint64_t number, std::size_t payload_bytes, bool is_failure);
    void write(std::uint64_t number, const Request& request) const;

    const Log* const log_;
    std::atomic<std::uint64_t>* const next_number_;
    const std::uint64_t session_;
    Requests requests_;  ///< as many as the session has in flight, and its view
};

}  // namespace terrane
