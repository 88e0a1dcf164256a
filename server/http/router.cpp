#include "server/http/router.h"

#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "server/http/http_message.h"
#include "server/http/problem.h"

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace terrane {

namespace {

constexpr std::string_view kVersionedPrefix = "/v1/w/";
constexpr std::string_view kApiPrefix = "/v1/";
constexpr std::string_view kMethods = "GET, HEAD, OPTIONS";
/// Of a value that an error quotes.
constexpr std::size_t kQuotedBytesMax = 64;

std::string in_quotes(std::string_view text) {
    std::string out(1, '"');
    out += text.substr(0, kQuotedBytesMax);
    out += '"';
    return out;
}

int hex_digit(char c) {
    if (c >= '0' && c <= '9') {
        return c - '0';
    }
    const char lower = static_cast<char>(c | 0x20);
    return lower >= 'a' && lower <= 'f' ? lower - 'a' + 10 : -1;
}

/// The first segment of a path "/a/b" and what follows it: "a" and "/b".
std::pair<std::string_view, std::string_view> split_segment(std::string_view path) {
    path.remove_prefix(1);
    const std::size_t end = std::min(path.find('/'), path.size());
    return {path.substr(0, end), path.substr(end)};
}

/// What all answers of a route have in common.
void complete(HttpResponse& response, HttpCaching caching, std::string_view if_none_match) {
    if (response.status != 200 || caching == HttpCaching::none) {
        return;
    }
    response.caching = caching;
    if (!response.etag) {
        response.etag =
            hash128(response.body ? std::span(*response.body) : std::span<const std::byte>());
    }
    if (!if_none_match.empty() && etag_matches(if_none_match, to_hex(*response.etag))) {
        response.status = 304;
        response.body = nullptr;
        response.content_type = {};
    }
}

/// An answer that comes later. Makes sure that it is given once, even if the handler forgets.
struct Reply {
    HttpRespond respond;
    HttpCaching caching = HttpCaching::none;
    std::string if_none_match;
    std::atomic<bool> answered = false;

    Reply(HttpRespond to, HttpCaching route_caching, std::string known)
        : respond(std::move(to)), caching(route_caching), if_none_match(std::move(known)) {}

    Reply(const Reply&) = delete;
    Reply& operator=(const Reply&) = delete;

    ~Reply() {
        if (!answered.load()) {
            respond(http_problem(500, "the answer was lost"));
        }
    }

    void send(HttpResponse response) {
        if (!answered.exchange(true)) {
            complete(response, caching, if_none_match);
            respond(std::move(response));
        }
    }
};

}  // namespace

std::string_view RouteParams::operator[](std::string_view name) const {
    const auto* const end = params_.begin() + count_;
    const auto* const found = std::find_if(
        params_.begin(), end, [name](const Param& param) { return param.name == name; });
    TERRANE_ASSERT(found != end);
    return found->value;
}

Result<std::int64_t> RouteParams::integer(std::string_view name, std::int64_t least,
                                          std::int64_t most) const {
    const std::string_view text = (*this)[name];
    const std::string_view digits = text.substr(text.starts_with('-') ? 1 : 0);
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool is_whole = end == text.data() + text.size() && error != std::errc::invalid_argument;
    const bool is_canonical = !digits.starts_with('0') || text == "0";
    if (!is_whole || !is_canonical) {
        return fail(ErrorCode::invalid_argument,
                    std::string(name) + ": " + in_quotes(text) +
                        " is not an integer in its shortest decimal form");
    }
    if (error != std::errc() || value < least || value > most) {
        return fail(ErrorCode::out_of_range, std::string(name) + ": " + in_quotes(text) +
                                                 " is not within " + std::to_string(least) + ".." +
                                                 std::to_string(most));
    }
    return value;
}

void RouteParams::add(std::string_view name, std::string_view value) {
    TERRANE_ASSERT(count_ < params_.size());
    params_[count_++] = {.name = name, .value = value};
}

std::optional<std::string> percent_decoded(std::string_view text) {
    if (text.find('%') == std::string_view::npos && text.find('\0') == std::string_view::npos) {
        return std::string(text);  // nearly always
    }
    std::string out;
    out.reserve(text.size());
    for (std::size_t i = 0; i < text.size(); ++i) {
        char c = text[i];
        if (c == '%') {
            if (i + 2 >= text.size() || hex_digit(text[i + 1]) < 0 || hex_digit(text[i + 2]) < 0) {
                return std::nullopt;
            }
            c = static_cast<char>(hex_digit(text[i + 1]) * 16 + hex_digit(text[i + 2]));
            i += 2;
        }
        if (c == '\0') {
            return std::nullopt;
        }
        out.push_back(c);
    }
    return out;
}

std::optional<std::string> query_value(std::string_view query, std::string_view name) {
    while (!query.empty()) {
        const std::size_t end = std::min(query.find('&'), query.size());
        const std::string_view pair = query.substr(0, end);
        query.remove_prefix(std::min(end + 1, query.size()));
        const std::size_t equals = std::min(pair.find('='), pair.size());
        if (pair.substr(0, equals) == name) {
            std::string value(pair.substr(std::min(equals + 1, pair.size())));
            std::ranges::replace(value, '+', ' ');
            return percent_decoded(value);
        }
    }
    return std::nullopt;
}

bool etag_matches(std::string_view if_none_match, std::string_view etag) {
    if (if_none_match == "*") {
        return true;
    }
    // Tags hold no quotation marks, so every second piece between them is a tag.
    bool inside = false;
    while (true) {
        const std::size_t quote = if_none_match.find('"');
        if (inside && if_none_match.substr(0, quote) == etag && quote != std::string_view::npos) {
            return true;
        }
        if (quote == std::string_view::npos) {
            return false;
        }
        if_none_match.remove_prefix(quote + 1);
        inside = !inside;
    }
}

HttpHandler fixed_answer(std::string_view content_type, SharedBytes body) {
    return [response = http_ok(content_type, std::move(body))](
               const HttpRequest&, const RouteParams&, const HttpLater&) { return response; };
}

Router::Router(Hash128 content_id, HttpGuard guard)
    : content_id_(to_hex(content_id)),
      versioned_prefix_(std::string(kVersionedPrefix) + content_id_),
      guard_(std::move(guard)) {}

void Router::add(Route route) {
    entries_.push_back(entry_of(std::move(route), false));
}

void Router::add_versioned(Route route) {
    route.caching = HttpCaching::immutable;
    entries_.push_back(entry_of(std::move(route), true));
}

Router::Entry Router::entry_of(Route route, bool versioned) {
    TERRANE_ASSERT(route.path.starts_with('/') && route.handler != nullptr);
    Entry entry{
        .route = std::move(route), .versioned = versioned, .takes_rest = false, .segments = {}};
    std::string_view rest = entry.route.path;
    while (!rest.empty()) {
        auto [text, behind] = split_segment(rest);
        rest = behind;
        Segment segment;
        while (!text.empty()) {
            const bool is_name = text.starts_with('{');
            const std::size_t end = std::min(text.find(is_name ? '}' : '{'), text.size());
            std::string_view piece = text.substr(is_name ? 1 : 0, end - (is_name ? 1 : 0));
            if (piece.ends_with("...")) {
                TERRANE_ASSERT(is_name && rest.empty() && segment.empty());
                piece.remove_suffix(3);
                entry.takes_rest = true;
            }
            TERRANE_ASSERT(!is_name || segment.empty() || !segment.back().is_name);
            segment.push_back({.text = std::string(piece), .is_name = is_name});
            text.remove_prefix(std::min(end + (is_name ? 1 : 0), text.size()));
        }
        entry.segments.push_back(std::move(segment));
    }
    return entry;
}

Router::CutPath Router::cut(std::string_view path) {
    CutPath out{.segments = {}, .count = 0, .goes_on = false, .whole = path};
    while (!path.empty() && out.count < out.segments.size()) {
        const auto [segment, behind] = split_segment(path);
        out.segments[out.count++] = segment;
        path = behind;
    }
    out.goes_on = !path.empty();
    return out;
}

bool Router::matches(const Entry& entry, const CutPath& path, RouteParams& params) {
    const std::size_t count = entry.segments.size();
    if (entry.takes_rest ? count > path.count : count != path.count || path.goes_on) {
        return false;
    }
    params.clear();
    for (std::size_t i = count; i-- > 0;) {  // endings differ most
        const Segment& segment = entry.segments[i];
        std::string_view text = path.segments[i];
        if (entry.takes_rest && i + 1 == count) {
            const auto before = static_cast<std::size_t>(text.data() - path.whole.data());
            if (before >= path.whole.size()) {
                return false;
            }
            params.add(segment.front().text, path.whole.substr(before));
            continue;
        }
        for (std::size_t piece = 0; piece < segment.size(); ++piece) {
            if (!segment[piece].is_name) {
                if (!text.starts_with(segment[piece].text)) {
                    return false;
                }
                text.remove_prefix(segment[piece].text.size());
                continue;
            }
            // Up to the literal that follows: the last one of the segment must end it.
            std::size_t size = text.size();
            if (piece + 2 == segment.size()) {
                const std::string& suffix = segment[piece + 1].text;
                if (!text.ends_with(suffix)) {
                    return false;
                }
                size -= suffix.size();
            } else if (piece + 1 < segment.size()) {
                size = text.find(segment[piece + 1].text);
            }
            if (size == 0 || size == std::string_view::npos) {
                return false;
            }
            params.add(segment[piece].text, text.substr(0, size));
            text.remove_prefix(size);
        }
        if (!text.empty()) {
            return false;
        }
    }
    return true;
}

const Router::Entry* Router::find(std::string_view path, bool versioned,
                                  RouteParams& params) const {
    const CutPath cut_path = cut(path);
    for (const Entry& entry : entries_) {
        if (entry.versioned == versioned && matches(entry, cut_path, params)) {
            return &entry;
        }
    }
    return nullptr;
}

std::optional<HttpResponse> Router::handle(const HttpRequest& request,
                                           const HttpLater& later) const {
    try {
        return handle_path(request, later);
    } catch (const std::exception& error) {
        return http_problem(500, std::string("the request failed: ") + error.what());
    }
}

std::optional<HttpResponse> Router::handle_path(const HttpRequest& request,
                                                const HttpLater& later) const {
    const std::string_view path = request.path;
    RouteParams params;
    const Entry* entry = nullptr;
    if (!path.starts_with('/')) {
        return request.method == "OPTIONS" && path == "*"
                   ? HttpResponse{.status = 204, .headers = {{"Allow", std::string(kMethods)}}}
                   : http_problem(400, "a path begins with '/'");
    }
    bool redirects = false;
    if (path.starts_with(kVersionedPrefix)) {
        const auto [world, behind] = split_segment(path.substr(kVersionedPrefix.size() - 1));
        if (world != content_id_) {
            return http_problem({.code = ErrorCode::wrong_world,
                                 .message = "content id " + in_quotes(world) +
                                            ": this server's world is " + content_id_ +
                                            "; /v1/world tells"});
        }
        entry = behind.empty() ? nullptr : find(behind, true, params);
    } else {
        entry = find(path, false, params);
        if (entry == nullptr && path.starts_with(kApiPrefix)) {
            entry = find(path.substr(kApiPrefix.size() - 1), true, params);
            redirects = entry != nullptr;
        }
    }
    if (entry == nullptr) {
        return http_problem(404, "nothing is at " + in_quotes(path));
    }
    if (request.method == "OPTIONS") {
        return HttpResponse{.status = 204, .headers = {{"Allow", std::string(kMethods)}}};
    }
    if (request.method != "GET" && request.method != "HEAD") {
        HttpResponse refusal = http_problem(
            405, in_quotes(request.method) + " is not one of " + std::string(kMethods));
        refusal.headers.emplace_back("Allow", kMethods);
        return refusal;
    }
    if (redirects) {
        std::string location = versioned_prefix_;
        location += request.target_path.substr(kApiPrefix.size() - 1);
        if (!request.query.empty()) {
            location += '?';
            location += request.query;
        }
        return HttpResponse{.status = 307, .headers = {{"Location", std::move(location)}}};
    }
    if (guard_ && entry->route.needs_token) {
        if (const auto allowed = guard_(request); !allowed) {
            return http_problem(allowed.error());
        }
    }
    return ask(*entry, request, params, later);
}

std::optional<HttpResponse> Router::ask(const Entry& entry, const HttpRequest& request,
                                        const RouteParams& params, const HttpLater& later) {
    struct Asked {
        const Route& route;
        const HttpRequest& request;
        const HttpLater& later;
        bool is_later = false;
    } asked{.route = entry.route, .request = request, .later = later};

    std::optional<HttpResponse> response;
    try {
        response = entry.route.handler(request, params, [&asked]() -> HttpRespond {
            const auto reply = std::make_shared<Reply>(asked.later(), asked.route.caching,
                                                       asked.request.if_none_match);
            asked.is_later = true;
            return [reply](HttpResponse answer) { reply->send(std::move(answer)); };
        });
    } catch (const std::exception&) {
        if (!asked.is_later) {  // else the reply answers
            throw;
        }
    }
    if (asked.is_later) {
        return std::nullopt;
    }
    if (!response) {
        return http_problem(500, "the answer was lost");
    }
    complete(*response, entry.route.caching, request.if_none_match);
    return response;
}

std::vector<std::string> Router::paths() const {
    std::vector<std::string> out;
    out.reserve(entries_.size());
    for (const Entry& entry : entries_) {
        out.push_back((entry.versioned ? "/v1/w/{W}" : "") + entry.route.path);
    }
    return out;
}

}  // namespace terrane
