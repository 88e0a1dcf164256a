// What a client demands of the server it speaks TLS with. OpenSSL's own types, so that no header
// needs Asio.
#pragma once

#include "protocol/base/result.h"

#include <string>

// As OpenSSL declares them.
struct ssl_ctx_st;
struct ssl_st;

namespace terrane {

/// TLS 1.2 or newer, with a certificate signed by one of `ca_file` (PEM), or by whom the system
/// trusts if it is empty. Fails with `io_error` and the file's name if that can't be read.
Result<void> demand_trust(ssl_ctx_st* context, const std::string& ca_file);

/// Before the handshake: the certificate must be good for `host`, a name or an address. Fails with
/// `invalid_argument` if it is none.
Result<void> demand_host(ssl_st* connection, const std::string& host);

}  // namespace terrane
