#include "server/net/http_reader.h"

#include "protocol/base/bytes.h"
#include "server/http/router.h"

#include <boost/asio/buffer.hpp>
#include <boost/beast/http/basic_parser.hpp>
#include <boost/beast/http/error.hpp>
#include <boost/beast/http/rfc7230.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace terrane {

namespace {

namespace http = boost::beast::http;
using boost::beast::string_view;
using boost::system::error_code;

std::string_view view_of(string_view text) {
    return {text.data(), text.size()};
}

/// What a client may send in place of a path: "http://host/path" means "/path".
std::string_view without_origin(std::string_view target) {
    const std::size_t scheme = target.find("://");
    if (target.starts_with('/') || scheme == std::string_view::npos) {
        return target;
    }
    const std::size_t path = target.find('/', scheme + 3);
    return path == std::string_view::npos ? std::string_view("/") : target.substr(path);
}

/// A header that comes twice is one list.
void append_value(std::string& to, string_view value) {
    if (!to.empty()) {
        to += ", ";
    }
    to.append(value.data(), value.size());
}

/// Beast tells it each piece as it is parsed; only what somebody needs is kept.
class RequestParser final : public http::basic_parser<true> {
  public:
    RequestParser() {
        header_limit(static_cast<std::uint32_t>(kHttpHeaderBytesMax));
        body_limit(kHttpBodyBytesMax);
        eager(true);
    }

    ReceivedRequest received;
    bool path_is_good = true;
    bool has_host = false;
    int lengths = 0;  ///< headers that say how long the body is

  private:
    void on_request_impl(http::verb, string_view method, string_view target, int version,
                         error_code& /*error*/) override {
        received.is_http_1_0 = version == 10;
        received.request.method.assign(method.data(), method.size());
        const std::string_view whole = without_origin(view_of(target));
        const std::size_t end = std::min({whole.find('?'), whole.find('#'), whole.size()});
        received.request.target_path = whole.substr(0, end);
        if (end < whole.size() && whole[end] == '?') {
            const std::string_view query = whole.substr(end + 1);
            received.request.query = query.substr(0, query.find('#'));
        }
        auto path = percent_decoded(received.request.target_path);
        path_is_good = path.has_value();
        if (path) {
            received.request.path = *std::move(path);
        }
    }

    void on_response_impl(int, string_view, int, error_code&) override {}

    void on_field_impl(http::field name, string_view, string_view value,
                       error_code& /*error*/) override {
        switch (name) {
            case http::field::host:
                has_host = true;
                break;
            case http::field::if_none_match:
                append_value(received.request.if_none_match, value);
                break;
            case http::field::authorization:
                received.request.authorization.assign(value.data(), value.size());
                break;
            case http::field::upgrade:
                received.wants_websocket =
                    received.wants_websocket || http::token_list(value).exists("websocket");
                break;
            case http::field::sec_websocket_key:
                received.websocket_key.assign(value.data(), value.size());
                break;
            case http::field::sec_websocket_version:
                received.websocket_version.assign(value.data(), value.size());
                break;
            case http::field::content_length:
            case http::field::transfer_encoding:
                ++lengths;
                break;
            default:
                break;
        }
    }

    void on_header_impl(error_code&) override {}

    void on_body_init_impl(const boost::optional<std::uint64_t>&, error_code&) override {}

    std::size_t on_body_impl(string_view body, error_code&) override { return body.size(); }

    void on_chunk_header_impl(std::uint64_t, string_view, error_code&) override {}

    std::size_t on_chunk_body_impl(std::uint64_t, string_view body, error_code&) override {
        return body.size();
    }

    void on_finish_impl(error_code&) override {}
};

HttpFault fault_of(error_code error) {
    if (error == http::error::header_limit) {
        return {.status = 431,
                .detail =
                    "the headers take more than " + std::to_string(kHttpHeaderBytesMax) + " bytes"};
    }
    if (error == http::error::body_limit) {
        return {
            .status = 413,
            .detail = "the body takes more than " + std::to_string(kHttpBodyBytesMax) + " bytes"};
    }
    if (error == http::error::bad_version) {
        return {.status = 505, .detail = "HTTP/1.1 is spoken here"};
    }
    return {.status = 400, .detail = "not HTTP/1.1: " + error.message()};
}

}  // namespace

struct HttpReader::Impl {
    Bytes buffer;
    std::size_t used = 0;  ///< of the buffer
    std::optional<RequestParser> parser;
    bool is_given = false;  ///< the parser's request has been given out whole
    std::optional<HttpFault> fault;

    tl::expected<ReceivedRequest*, HttpFault> refuse(HttpFault why) {
        fault = std::move(why);
        return tl::unexpected(*fault);
    }

    /// The parser has all of a request.
    tl::expected<ReceivedRequest*, HttpFault> finish(RequestParser& done) {
        ReceivedRequest& received = done.received;
        received.keep_alive = done.keep_alive();
        received.wants_websocket = received.wants_websocket && done.upgrade();
        if (!done.path_is_good) {
            return refuse({.status = 400, .detail = "the path holds a broken percent sign"});
        }
        if (!received.is_http_1_0 && !done.has_host) {
            return refuse({.status = 400, .detail = "HTTP/1.1 requests have a Host header"});
        }
        if (done.lengths > 1) {  // two lengths have let requests be smuggled in
            return refuse({.status = 400, .detail = "the body's length is given twice"});
        }
        is_given = true;
        return &received;
    }

    tl::expected<ReceivedRequest*, HttpFault> next() {
        if (fault) {
            return tl::unexpected(*fault);
        }
        if (is_given) {
            parser.reset();
            is_given = false;
        }
        while (true) {
            const auto rest = std::span(buffer).subspan(used);
            if (rest.empty()) {
                buffer.clear();
                used = 0;
                return nullptr;
            }
            if (!parser) {
                // Empty lines before a request are passed over (RFC 9112, 2.2).
                if (rest.front() == std::byte{'\r'} || rest.front() == std::byte{'\n'}) {
                    ++used;
                    continue;
                }
            }
            RequestParser& reading = parser ? *parser : parser.emplace();
            error_code error;
            used += reading.put(boost::asio::const_buffer(rest.data(), rest.size()), error);
            if (error && error != http::error::need_more) {
                return refuse(fault_of(error));
            }
            if (reading.is_done()) {
                return finish(reading);
            }
            if (error == http::error::need_more) {
                if (buffer.size() - used > kHttpHeaderBytesMax) {
                    return refuse(fault_of(http::error::header_limit));
                }
                buffer.erase(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(used));
                used = 0;
                return nullptr;
            }
        }
    }
};

HttpReader::HttpReader() : impl_(std::make_unique<Impl>()) {}

HttpReader::~HttpReader() = default;

void HttpReader::feed(std::span<const std::byte> bytes) {
    impl_->buffer.insert(impl_->buffer.end(), bytes.begin(), bytes.end());
}

tl::expected<ReceivedRequest*, HttpFault> HttpReader::next() {
    return impl_->next();
}

std::size_t HttpReader::buffered_bytes() const {
    return impl_->buffer.size() - impl_->used;
}

bool HttpReader::is_inside_request() const {
    return (impl_->parser && !impl_->is_given) || buffered_bytes() > 0;
}

bool HttpReader::is_inside_body() const {
    const std::optional<RequestParser>& parser = impl_->parser;
    return parser && !impl_->is_given && parser->is_header_done();
}

Bytes HttpReader::take_rest() {
    const auto rest = std::span(impl_->buffer).subspan(impl_->used);
    Bytes out(rest.begin(), rest.end());
    impl_->buffer.clear();
    impl_->used = 0;
    return out;
}

}  // namespace terrane
