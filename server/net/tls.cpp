#include "server/net/tls.h"

#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/mutex.h"
#include "protocol/base/result.h"

#include <openssl/err.h>
#include <openssl/ssl.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <utility>

namespace terrane {

namespace {

/// A record's largest plaintext.
constexpr std::size_t kRecordBytes = std::size_t{16} << 10U;

/// The oldest error that OpenSSL has noted on this thread, in its words; forgets all of them.
std::string openssl_error() {
    const unsigned long code = ERR_get_error();
    ERR_clear_error();
    std::array<char, 256> text{};
    ERR_error_string_n(code, text.data(), text.size());
    return code == 0 ? "unknown error" : text.data();
}

/// OpenSSL asks which of the client's protocols is taken.
int choose_protocol(SSL* /*ssl*/, const unsigned char** out, unsigned char* out_length,
                    const unsigned char* offered, unsigned offered_length, void* /*argument*/) {
    static constexpr std::array<unsigned char, 9> kHttp11 = {8,   'h', 't', 't', 'p',
                                                             '/', '1', '.', '1'};
    unsigned char* chosen = nullptr;
    if (SSL_select_next_proto(&chosen, out_length, kHttp11.data(), kHttp11.size(), offered,
                              offered_length) != OPENSSL_NPN_NEGOTIATED) {
        return SSL_TLSEXT_ERR_NOACK;  // the native protocol has no name there
    }
    *out = chosen;
    return SSL_TLSEXT_ERR_OK;
}

}  // namespace

struct TlsServer::Context {
    explicit Context(SSL_CTX* made) : ctx(made) {}

    ~Context() { SSL_CTX_free(ctx); }

    Context(const Context&) = delete;
    Context& operator=(const Context&) = delete;

    SSL_CTX* const ctx;
};

struct TlsChannel::Impl {
    explicit Impl(SSL* made)
        : ssl(made), from_client(BIO_new(BIO_s_mem())), to_client(BIO_new(BIO_s_mem())) {
        SSL_set_bio(ssl, from_client, to_client);
        SSL_set_accept_state(ssl);
    }

    ~Impl() { SSL_free(ssl); }  // and its BIOs

    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;

    SSL* const ssl;
    BIO* const from_client;
    BIO* const to_client;
};

TlsChannel::TlsChannel(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

TlsChannel::~TlsChannel() = default;

Result<void> TlsChannel::receive(Bytes& plain, std::span<const std::byte> cipher) {
    ERR_clear_error();
    const auto size = static_cast<int>(cipher.size());
    if (BIO_write(impl_->from_client, cipher.data(), size) != size) {
        return fail(ErrorCode::internal, "no memory for TLS");
    }
    while (true) {
        const std::size_t before = plain.size();
        plain.resize(before + kRecordBytes);
        std::size_t read = 0;
        const int outcome = SSL_read_ex(impl_->ssl, plain.data() + before, kRecordBytes, &read);
        plain.resize(before + (outcome == 1 ? read : 0));
        if (outcome == 1) {
            continue;
        }
        const int reason = SSL_get_error(impl_->ssl, outcome);
        if (reason == SSL_ERROR_WANT_READ || reason == SSL_ERROR_ZERO_RETURN) {
            return {};
        }
        return fail(ErrorCode::malformed, "TLS: " + openssl_error());
    }
}

Result<void> TlsChannel::send(std::span<const std::byte> plain) {
    TERRANE_ASSERT(is_ready());
    ERR_clear_error();
    std::size_t written = 0;
    if (!plain.empty() && (SSL_write_ex(impl_->ssl, plain.data(), plain.size(), &written) != 1 ||
                           written != plain.size())) {
        return fail(ErrorCode::io_error, "TLS: " + openssl_error());
    }
    return {};
}

void TlsChannel::say_goodbye() {
    if (is_ready()) {
        SSL_shutdown(impl_->ssl);
    }
    ERR_clear_error();
}

bool TlsChannel::is_ready() const {
    return SSL_is_init_finished(impl_->ssl) == 1;
}

bool TlsChannel::input_ended() const {
    return (SSL_get_shutdown(impl_->ssl) & SSL_RECEIVED_SHUTDOWN) != 0;
}

std::span<const std::byte> TlsChannel::output() const {
    char* data = nullptr;
    const long size = BIO_get_mem_data(impl_->to_client, &data);
    return std::as_bytes(std::span(data, size > 0 ? static_cast<std::size_t>(size) : 0));
}

void TlsChannel::clear_output() {
    BIO_reset(impl_->to_client);
}

Result<std::shared_ptr<TlsServer::Context>> TlsServer::load(const Files& files) {
    ERR_clear_error();
    auto context = std::make_shared<Context>(SSL_CTX_new(TLS_server_method()));
    SSL_CTX* const ctx = context->ctx;
    if (ctx == nullptr || SSL_CTX_set_min_proto_version(ctx, TLS1_2_VERSION) != 1) {
        return fail(ErrorCode::internal, "TLS cannot be set up: " + openssl_error());
    }
    SSL_CTX_set_options(
        ctx, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION | SSL_OP_CIPHER_SERVER_PREFERENCE);
    SSL_CTX_set_mode(ctx, SSL_MODE_RELEASE_BUFFERS);  // idle connections hold little
    SSL_CTX_set_alpn_select_cb(ctx, choose_protocol, nullptr);
    if (SSL_CTX_use_certificate_chain_file(ctx, files.certificate.c_str()) != 1) {
        return fail(ErrorCode::invalid_argument, "the certificate " + files.certificate.string() +
                                                     " cannot be used: " + openssl_error());
    }
    if (SSL_CTX_use_PrivateKey_file(ctx, files.key.c_str(), SSL_FILETYPE_PEM) != 1 ||
        SSL_CTX_check_private_key(ctx) != 1) {
        return fail(ErrorCode::invalid_argument,
                    "the key " + files.key.string() + " cannot be used with " +
                        files.certificate.string() + ": " + openssl_error());
    }
    return context;
}

Result<std::unique_ptr<TlsServer>> TlsServer::open(Files files) {
    auto context = load(files);
    if (!context) {
        return tl::unexpected(context.error());
    }
    return std::unique_ptr<TlsServer>(new TlsServer(std::move(files), *std::move(context)));
}

TlsServer::TlsServer(Files files, std::shared_ptr<Context> context)
    : files_(std::move(files)), context_(std::move(context)) {}

TlsServer::~TlsServer() = default;

Result<void> TlsServer::reload() {
    auto context = load(files_);
    if (!context) {
        return tl::unexpected(context.error());
    }
    const MutexLock lock(mutex_);
    std::swap(context_, *context);
    return {};
}

Result<std::unique_ptr<TlsChannel>> TlsServer::accept() {
    std::shared_ptr<Context> context;
    {
        const MutexLock lock(mutex_);
        context = context_;
    }
    ERR_clear_error();
    SSL* const ssl = SSL_new(context->ctx);  // keeps the context for itself
    if (ssl == nullptr) {
        return fail(ErrorCode::internal, "no memory for TLS: " + openssl_error());
    }
    return std::make_unique<TlsChannel>(std::make_unique<TlsChannel::Impl>(ssl));
}

}  // namespace terrane
