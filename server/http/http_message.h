// An HTTP request and its answer as plain values: what routes are written against. The bytes on the
// wire are http_session.h's business, and what all answers have in common is the router's.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace terrane {

struct HttpRequest {
    std::string method;         ///< as sent: "GET"
    std::string path;           ///< "/v1/world"; percent signs decoded, no query
    std::string target_path;    ///< the same as sent
    std::string query;          ///< what stood behind the '?', as sent
    std::string if_none_match;  ///< header values as sent; empty: not there
    std::string authorization;
    std::uint64_t id = 0;       ///< of this process; stands in logs and in `Terrane-Request`
    std::uint64_t session = 0;  ///< the connection's number in logs
    std::uint64_t flow = 0;     ///< the connection's, for a fair share of the workers
    std::stop_token stop = {};  ///< the client has gone: nobody reads the answer
};

/// How long an answer may be kept by others. The router says it in Cache-Control.
enum class HttpCaching : std::uint8_t {
    immutable,   ///< for ever: the path names the content
    revalidate,  ///< asked for again each time, 304 if it is the same
    none
};

/// What a handler fills in. The router adds caching, CORS and the rest.
struct HttpResponse {
    unsigned status = 200;
    std::string_view content_type = {};  ///< a literal, or owned by what outlives the server
    std::vector<std::pair<std::string, std::string>> headers = {};
    SharedBytes body = {};
    /// Written as 32 hex digits. None: the router hashes the body, if the route may be cached.
    std::optional<Hash128> etag = {};
    HttpCaching caching = HttpCaching::none;  ///< the router's to set, from the route
};

/// Must be called once; from any thread, within the handler or later.
using HttpRespond = std::function<void(HttpResponse)>;

/// Makes the way by which an answer comes later. Called at most once, and only by who has none at
/// hand: the answers that are cost nothing of it. Valid within the handler only.
using HttpLater = std::function<HttpRespond()>;

/// The text as a body.
inline SharedBytes http_body(std::string_view text) {
    const auto bytes = bytes_of(text);
    return std::make_shared<const Bytes>(bytes.begin(), bytes.end());
}

inline HttpResponse http_ok(std::string_view content_type, SharedBytes body) {
    HttpResponse response;
    response.content_type = content_type;
    response.body = std::move(body);
    return response;
}

}  // namespace terrane
