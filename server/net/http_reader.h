// HTTP/1.1 requests out of bytes, with no socket. Beast's parser does the reading; this keeps its
// limits and makes plain values of what it finds.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "server/http/http_message.h"

#include <cstddef>
#include <memory>
#include <span>
#include <string>

namespace terrane {

/// Of one request: its first line and all its headers; and the body, which is thrown away.
inline constexpr std::size_t kHttpHeaderBytesMax = std::size_t{8} << 10U;
inline constexpr std::size_t kHttpBodyBytesMax = std::size_t{16} << 10U;

/// A request with what concerns the connection rather than the routes.
struct ReceivedRequest {
    HttpRequest request;
    bool keep_alive = true;
    bool is_http_1_0 = false;
    bool wants_websocket = false;  ///< asks to upgrade
    std::string websocket_key;
    std::string websocket_version;
};

/// Why a connection can't go on: what to answer before closing it.
struct HttpFault {
    unsigned status = 400;
    std::string detail;
};

/// One thread.
class HttpReader {
  public:
    HttpReader();
    ~HttpReader();
    HttpReader(const HttpReader&) = delete;
    HttpReader& operator=(const HttpReader&) = delete;

    void feed(std::span<const std::byte> bytes);
    /// The next request, valid until the next call; null if it is not whole yet. After a fault
    /// every call gives it again.
    tl::expected<ReceivedRequest*, HttpFault> next();

    /// Bytes of requests that were not given out yet.
    std::size_t buffered_bytes() const;
    /// The first of a request's bytes are there, but not all.
    bool is_inside_request() const;
    /// Its headers are there, and its body isn't.
    bool is_inside_body() const;
    /// What was fed and not used; for a protocol that takes over.
    Bytes take_rest();

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace terrane
