#include "client-sample/cpp/tls_peer.h"

#include "protocol/base/result.h"

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509_vfy.h>

#include <string>

namespace terrane {

Result<void> demand_trust(ssl_ctx_st* context, const std::string& ca_file) {
    ERR_clear_error();
    SSL_CTX_set_verify(context, SSL_VERIFY_PEER, nullptr);
    const bool is_set =
        SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION) == 1 &&
        (ca_file.empty() ? SSL_CTX_set_default_verify_paths(context) == 1
                         : SSL_CTX_load_verify_locations(context, ca_file.c_str(), nullptr) == 1);
    if (!is_set) {
        return fail(ErrorCode::io_error, (ca_file.empty() ? "the system's certificates" : ca_file) +
                                             ": cannot be read as PEM certificates");
    }
    return {};
}

Result<void> demand_host(ssl_st* connection, const std::string& host) {
    ERR_clear_error();
    if (X509_VERIFY_PARAM_set1_ip_asc(SSL_get0_param(connection), host.c_str()) == 1) {
        return {};
    }
    ERR_clear_error();
    // The server may have one certificate of several for this name. What the macro
    // SSL_set_tlsext_host_name does, without its cast.
    std::string name = host;
    const bool is_told = SSL_ctrl(connection, SSL_CTRL_SET_TLSEXT_HOSTNAME,
                                  TLSEXT_NAMETYPE_host_name, name.data()) == 1;
    if (!is_told || SSL_set1_host(connection, host.c_str()) != 1) {
        return fail(ErrorCode::invalid_argument,
                    "\"" + host + "\" is no name that a certificate could be good for");
    }
    return {};
}

}  // namespace terrane
