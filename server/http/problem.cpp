#include "server/http/problem.h"

#include "protocol/base/result.h"
#include "server/http/http_message.h"

#include <nlohmann/json.hpp>

#include <cstdint>
#include <string>
#include <string_view>

namespace terrane {

namespace {

HttpResponse problem_of(unsigned status, std::string_view detail, std::string_view code) {
    nlohmann::ordered_json body = {{"type", "about:blank"},
                                   {"title", reason_phrase(status)},
                                   {"status", status},
                                   {"detail", detail}};
    if (!code.empty()) {
        body["code"] = code;
    }
    HttpResponse response = http_ok(
        "application/problem+json",
        http_body(body.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace)));
    response.status = status;
    return response;
}

}  // namespace

std::string_view reason_phrase(unsigned status) {
    switch (status) {
        case 101:
            return "Switching Protocols";
        case 200:
            return "OK";
        case 204:
            return "No Content";
        case 304:
            return "Not Modified";
        case 307:
            return "Temporary Redirect";
        case 400:
            return "Bad Request";
        case 401:
            return "Unauthorized";
        case 403:
            return "Forbidden";
        case 404:
            return "Not Found";
        case 405:
            return "Method Not Allowed";
        case 408:
            return "Request Timeout";
        case 413:
            return "Content Too Large";
        case 414:
            return "URI Too Long";
        case 426:
            return "Upgrade Required";
        case 429:
            return "Too Many Requests";
        case 431:
            return "Request Header Fields Too Large";
        case 500:
            return "Internal Server Error";
        case 501:
            return "Not Implemented";
        case 503:
            return "Service Unavailable";
        case 505:
            return "HTTP Version Not Supported";
        default:
            return {};
    }
}

unsigned http_status_of(ErrorCode code) {
    switch (code) {
        case ErrorCode::malformed:
        case ErrorCode::unsupported:
        case ErrorCode::out_of_range:
        case ErrorCode::invalid_argument:
        case ErrorCode::version_mismatch:
            return 400;
        case ErrorCode::too_large:
            return 413;
        case ErrorCode::busy:
            return 429;
        case ErrorCode::not_found:
        case ErrorCode::wrong_world:
            return 404;
        case ErrorCode::unauthorized:
            return 401;
        case ErrorCode::cancelled:
        case ErrorCode::draining:
            return 503;
        case ErrorCode::io_error:
        case ErrorCode::corrupt:
        case ErrorCode::internal:
            return 500;
    }
    return 500;
}

HttpResponse http_problem(unsigned status, std::string_view detail) {
    return problem_of(status, detail, {});
}

HttpResponse http_problem(const Error& error, std::uint32_t retry_after_ms) {
    HttpResponse response =
        problem_of(http_status_of(error.code), error.message, to_string(error.code));
    if (error.code == ErrorCode::busy) {
        response.headers.emplace_back("Retry-After", std::to_string((retry_after_ms + 999) / 1000));
    } else if (error.code == ErrorCode::unauthorized) {
        response.headers.emplace_back("WWW-Authenticate", "Bearer");
    }
    return response;
}

}  // namespace terrane
