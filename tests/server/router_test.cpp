// The table of routes, asked directly.
#include "server/http/router.h"

#include "server/http/problem.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

namespace terrane {
namespace {

using testing::HasSubstr;

constexpr Hash128 kContent{.high = 0x0123456789abcdef, .low = 0xfedcba9876543210};

HttpRequest get(std::string path) {
    HttpRequest request;
    request.method = "GET";
    request.path = path;
    request.target_path = std::move(path);
    return request;
}

HttpResponse asked(const Router& router, const HttpRequest& request) {
    std::vector<HttpResponse> answers;
    auto at_once = router.handle(request, [&] {
        return [&](HttpResponse response) { answers.push_back(std::move(response)); };
    });
    if (at_once) {
        answers.push_back(*std::move(at_once));
    }
    EXPECT_EQ(answers.size(), 1U);
    return answers.empty() ? HttpResponse{} : answers.front();
}

std::string text_of_body(const HttpResponse& response) {
    return response.body ? std::string(text_of(*response.body)) : std::string();
}

std::string header(const HttpResponse& response, std::string_view name) {
    for (const auto& [key, value] : response.headers) {
        if (key == name) {
            return value;
        }
    }
    return {};
}

/// Answers with the values of the names, joined.
HttpHandler echo(std::vector<std::string> names) {
    return [names = std::move(names)](const HttpRequest&, const RouteParams& params,
                                      const HttpLater&) {
        std::string text;
        for (const std::string& name : names) {
            text += std::string(params[name]) + ";";
        }
        return http_ok("text/plain", http_body(text));
    };
}

Router sample_router() {
    Router router(kContent);
    router.add({.path = "/", .handler = echo({})});
    router.add({.path = "/v1/world", .handler = echo({})});
    router.add({.path = "/healthz", .caching = HttpCaching::none, .handler = echo({})});
    router.add({.path = "/files/{path...}", .handler = echo({"path"})});
    router.add_versioned(
        {.path = "/chunks/{lod}/{x}/{y}/{z}.drc", .handler = echo({"lod", "x", "y", "z"})});
    router.add_versioned(
        {.path = "/sections/{x0},{z0}/{x1},{z1}.png", .handler = echo({"x0", "z0", "x1", "z1"})});
    return router;
}

TEST(Router, FindsPatternsAndTheirValues) {
    const Router router = sample_router();
    const std::string prefix = router.versioned_prefix();
    EXPECT_EQ(prefix, "/v1/w/0123456789abcdeffedcba9876543210");
    EXPECT_EQ(text_of_body(asked(router, get(prefix + "/chunks/0/-1/2/3.drc"))), "0;-1;2;3;");
    EXPECT_EQ(text_of_body(asked(router, get(prefix + "/sections/-1,2/3,4.png"))), "-1;2;3;4;");
    EXPECT_EQ(text_of_body(asked(router, get("/files/a/b.js"))), "a/b.js;");
    for (const char* path :
         {"/chunks/0/1/2/3.drc/", "/chunks/0/1/2/.drc", "/chunks/0/1/2/3.dr", "/chunks/0/1/2",
          "/chunks//1/2/3.drc", "/sections/1/2,3.png", "/", ""}) {
        EXPECT_EQ(asked(router, get(prefix + path)).status, 404U) << path;
    }
    for (const char* path : {"/v1", "/v1/", "/v1/w", "/v1/w/", "/files", "/files/", "/v2/world"}) {
        EXPECT_EQ(asked(router, get(path)).status, 404U) << path;
    }
    EXPECT_EQ(asked(router, get("v1/world")).status, 400U);
}

TEST(Router, AnotherWorldIsNotFoundAndNoWorldRedirects) {
    const Router router = sample_router();
    const HttpResponse other =
        asked(router, get("/v1/w/00000000000000000000000000000000/chunks/0/0/0/0.drc"));
    EXPECT_EQ(other.status, 404U);
    EXPECT_THAT(text_of_body(other), HasSubstr("wrong_world"));
    EXPECT_EQ(other.content_type, "application/problem+json");
    HttpRequest request = get("/v1/chunks/0/0/0/0.drc");
    request.query = "v=1";
    const HttpResponse redirect = asked(router, request);
    EXPECT_EQ(redirect.status, 307U);
    EXPECT_EQ(header(redirect, "Location"), router.versioned_prefix() + "/chunks/0/0/0/0.drc?v=1");
}

TEST(Router, KnowsTheMethodsOfAPath) {
    const Router router = sample_router();
    HttpRequest request = get("/v1/world");
    request.method = "HEAD";
    EXPECT_EQ(asked(router, request).status, 200U);
    request.method = "OPTIONS";
    EXPECT_EQ(asked(router, request).status, 204U);
    for (const char* method : {"POST", "PUT", "DELETE", "get", "BREW"}) {
        request.method = method;
        const HttpResponse refused = asked(router, request);
        EXPECT_EQ(refused.status, 405U);
        EXPECT_EQ(header(refused, "Allow"), "GET, HEAD, OPTIONS");
    }
    request.path = "/nowhere";
    EXPECT_EQ(asked(router, request).status, 404U);
}

TEST(Router, GivesTagsAndSaysNotModified) {
    const Router router = sample_router();
    HttpRequest request = get("/v1/world");
    const HttpResponse first = asked(router, request);
    EXPECT_EQ(first.caching, HttpCaching::revalidate);
    ASSERT_TRUE(first.etag);
    request.if_none_match = "\"x\", W/\"" + to_hex(*first.etag) + "\"";
    const HttpResponse second = asked(router, request);
    EXPECT_EQ(second.status, 304U);
    EXPECT_FALSE(second.body);
    EXPECT_EQ(second.etag, first.etag);
    EXPECT_EQ(asked(router, get("/healthz")).etag, std::nullopt);
    EXPECT_EQ(asked(router, get(router.versioned_prefix() + "/chunks/0/0/0/0.drc")).caching,
              HttpCaching::immutable);
}

TEST(Router, ReadsIfNoneMatchAsListsOfTags) {
    EXPECT_TRUE(etag_matches("*", "a"));
    EXPECT_TRUE(etag_matches("\"a\"", "a"));
    EXPECT_TRUE(etag_matches("W/\"b\" , \"a\"", "a"));
    for (const char* header : {"a", "\"ab\"", "\"a", "\"\"", "", "\"b\", \"c\"", "\"b\"a\"c\""}) {
        EXPECT_FALSE(etag_matches(header, "a")) << header;
    }
}

TEST(Router, AsksTheGuardWhereATokenIsNeeded) {
    Router router(kContent, [](const HttpRequest& request) -> Result<void> {
        if (request.authorization != "Bearer right") {
            return fail(ErrorCode::unauthorized, "no");
        }
        return {};
    });
    router.add({.path = "/open", .needs_token = false, .handler = echo({})});
    router.add({.path = "/closed", .handler = echo({})});
    EXPECT_EQ(asked(router, get("/open")).status, 200U);
    const HttpResponse refused = asked(router, get("/closed"));
    EXPECT_EQ(refused.status, 401U);
    EXPECT_EQ(header(refused, "WWW-Authenticate"), "Bearer");
    HttpRequest request = get("/closed");
    request.authorization = "Bearer right";
    EXPECT_EQ(asked(router, request).status, 200U);
}

TEST(Router, AnswersOnceWhateverTheHandlerDoes) {
    Router router(kContent);
    using Handled = std::optional<HttpResponse>;
    router.add({.path = "/throws", .handler = [](const auto&, const auto&, const auto&) -> Handled {
                    throw std::runtime_error("broken");
                }});
    router.add({.path = "/throws-late",
                .handler = [](const auto&, const auto&, const HttpLater& later) -> Handled {
                    const HttpRespond respond = later();
                    throw std::runtime_error("broken");
                }});
    router.add({.path = "/forgets",
                .handler = [](const auto&, const auto&, const auto&) -> Handled { return {}; }});
    router.add({.path = "/forgets-late",
                .handler = [](const auto&, const auto&, const HttpLater& later) -> Handled {
                    later();
                    return {};
                }});
    router.add({.path = "/twice",
                .handler = [](const auto&, const auto&, const HttpLater& later) -> Handled {
                    const HttpRespond respond = later();
                    respond({});
                    respond(http_problem(500, "again"));
                    return {};
                }});
    for (const char* path : {"/throws", "/throws-late", "/forgets", "/forgets-late"}) {
        EXPECT_EQ(asked(router, get(path)).status, 500U) << path;
    }
    EXPECT_EQ(asked(router, get("/twice")).status, 200U);
}

TEST(Router, AnswersThatComeLaterHaveTagsToo) {
    Router router(kContent);
    router.add({.path = "/later",
                .handler = [](const auto&, const auto&,
                              const HttpLater& later) -> std::optional<HttpResponse> {
                    later()(http_ok("text/plain", http_body("late")));
                    return {};
                }});
    HttpRequest request = get("/later");
    const HttpResponse first = asked(router, request);
    EXPECT_EQ(first.caching, HttpCaching::revalidate);
    ASSERT_TRUE(first.etag);
    request.if_none_match = '"' + to_hex(*first.etag) + '"';
    EXPECT_EQ(asked(router, request).status, 304U);
}

TEST(RouteParams, ReadsIntegersInOneSpelling) {
    const auto read = [](std::string_view text) {
        RouteParams params;
        params.add("x", text);
        return params.integer("x", -100, 100);
    };
    EXPECT_EQ(read("0"), 0);
    EXPECT_EQ(read("-7"), -7);
    EXPECT_EQ(read("100"), 100);
    for (const char* text : {"", "-", "+1", "01", "-0", "1.0", "0x1", " 1", "1 ", "a"}) {
        const auto value = read(text);
        ASSERT_FALSE(value) << text;
        EXPECT_EQ(value.error().code, ErrorCode::invalid_argument) << text;
    }
    for (const char* text : {"101", "-101", "99999999999999999999"}) {
        const auto value = read(text);
        ASSERT_FALSE(value) << text;
        EXPECT_EQ(value.error().code, ErrorCode::out_of_range) << text;
    }
}

TEST(Query, GivesDecodedValues) {
    EXPECT_EQ(query_value("a=1&token=x%20y+z&b", "token"), "x y z");
    EXPECT_EQ(query_value("a=1&b", "b"), "");
    EXPECT_EQ(query_value("a=1", "b"), std::nullopt);
    EXPECT_EQ(query_value("a=%zz", "a"), std::nullopt);
    EXPECT_EQ(percent_decoded("%41%2f"), "A/");
    for (const char* text : {"%", "%4", "%4g", "%00"}) {
        EXPECT_EQ(percent_decoded(text), std::nullopt) << text;
    }
}

}  // namespace
}  // namespace terrane
