// The table of routes, and all that HTTP answers have in common: which method a path has (404, 405,
// HEAD, OPTIONS), CORS, who may ask (401), the content id in versioned paths (404 for another
// world's, 307 for paths without one), caching headers, ETag and 304.
//
//     router.add({.path = "/v1/world", .caching = HttpCaching::revalidate, .handler = ...});
//     router.add_versioned({.path = "/chunks/{lod}/{x}/{y}/{z}.drc", .handler = ...});
//
// An answer that is at hand is returned; only one that isn't takes a callback.
//
// A pattern is literal but for {name}, which stands for one or more characters of one segment; a
// last segment {name...} stands for all the rest, slashes included. Between two names of a segment
// stands a literal. The first route that fits is taken. A handler gets the values percent-decoded.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "server/http/http_message.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

/// Of one pattern.
inline constexpr std::size_t kRouteParamsMax = 8;
inline constexpr std::size_t kPathSegmentsMax = 16;

/// The values of a pattern's names. Views into the request's path.
class RouteParams {
  public:
    /// A name that the pattern doesn't have is our own mistake.
    std::string_view operator[](std::string_view name) const;
    /// The value as a decimal integer, a minus sign allowed, no plus sign nor leading zeros (one
    /// chunk has one URL). Fails with `invalid_argument` or `out_of_range` and a message that
    /// quotes name and text.
    Result<std::int64_t> integer(std::string_view name, std::int64_t least,
                                 std::int64_t most) const;

    void add(std::string_view name, std::string_view value);

    void clear() { count_ = 0; }

  private:
    struct Param {
        std::string_view name;
        std::string_view value;
    };

    std::array<Param, kRouteParamsMax> params_;
    std::size_t count_ = 0;
};

/// Called on an io thread: answers at once what is at hand, and hands on what takes more than about
/// a millisecond. Returns the answer, or nothing if it has called `later` and will call what it got
/// of it once, whatever happens; may throw.
using HttpHandler = std::function<std::optional<HttpResponse>(
    const HttpRequest& request, const RouteParams& params, const HttpLater& later)>;

/// Gives the same answer to everybody.
HttpHandler fixed_answer(std::string_view content_type, SharedBytes body);

struct Route {
    std::string path;                               ///< the pattern
    HttpCaching caching = HttpCaching::revalidate;  ///< always `immutable` for versioned routes
    bool needs_token = true;                        ///< where the server asks for tokens at all
    HttpHandler handler;                            ///< of GET, and so of HEAD
};

/// Says whether the request may be answered; called for routes with `needs_token` only.
using HttpGuard = std::function<Result<void>(const HttpRequest&)>;

/// The value of `name` in a query string "a=1&b=2", percent-decoded, '+' a space; the first one.
std::optional<std::string> query_value(std::string_view query, std::string_view name);

/// %41 -> A. Nothing for a broken escape or a NUL.
std::optional<std::string> percent_decoded(std::string_view text);

/// True if an If-None-Match value ("\"a\", W/\"b\"" or "*") names this ETag (no quotation marks).
bool etag_matches(std::string_view if_none_match, std::string_view etag);

/// Filled by one thread before the server listens; then `handle` may be called from any.
class Router {
  public:
    /// `guard` may be empty: everybody may ask.
    explicit Router(Hash128 content_id, HttpGuard guard = {});

    void add(Route route);
    /// The path is what follows "/v1/w/W". "/v1" + path redirects there.
    void add_versioned(Route route);

    /// The answer to a request, whatever the table says, or nothing: then `later` was called, and
    /// what it gave will be called once, perhaps before this returns. Never throws but bad_alloc.
    std::optional<HttpResponse> handle(const HttpRequest& request, const HttpLater& later) const;

    /// Every pattern as it stands in the table, versioned ones as "/v1/w/{W}/...": OpenAPI is held
    /// against this.
    std::vector<std::string> paths() const;

    const std::string& content_id() const { return content_id_; }

    /// "/v1/w/W"; versioned paths follow it.
    const std::string& versioned_prefix() const { return versioned_prefix_; }

  private:
    struct Piece {
        std::string text;  ///< literal, or the name
        bool is_name = false;
    };

    using Segment = std::vector<Piece>;

    struct Entry {
        Route route;
        bool versioned = false;
        bool takes_rest = false;  ///< the last segment is {name...}
        std::vector<Segment> segments;
    };

    /// A path cut at its slashes, once for all the patterns that it is held against.
    struct CutPath {
        std::array<std::string_view, kPathSegmentsMax> segments;
        std::size_t count = 0;  ///< of the segments that are cut
        bool goes_on = false;   ///< there are more
        std::string_view whole;
    };

    static Entry entry_of(Route route, bool versioned);
    static CutPath cut(std::string_view path);
    static bool matches(const Entry& entry, const CutPath& path, RouteParams& params);
    const Entry* find(std::string_view path, bool versioned, RouteParams& params) const;
    std::optional<HttpResponse> handle_path(const HttpRequest& request,
                                            const HttpLater& later) const;
    static std::optional<HttpResponse> ask(const Entry& entry, const HttpRequest& request,
                                           const RouteParams& params, const HttpLater& later);

    const std::string content_id_;
    const std::string versioned_prefix_;
    const HttpGuard guard_;
    std::vector<Entry> entries_;
};

}  // namespace terrane
