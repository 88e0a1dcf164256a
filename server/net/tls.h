// TLS 1.2 and 1.3 for a server, between a socket and a ByteProtocol: ciphertext in, plaintext out,
// and the other way round, with no socket of its own.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/mutex.h"
#include "protocol/base/result.h"

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>

namespace terrane {

/// From connect to the end of the handshake.
inline constexpr int kTlsHandshakeMaxMs = 5'000;

/// One connection's TLS. One thread.
class TlsChannel {
  public:
    struct Impl;

    explicit TlsChannel(std::unique_ptr<Impl> impl);
    ~TlsChannel();
    TlsChannel(const TlsChannel&) = delete;
    TlsChannel& operator=(const TlsChannel&) = delete;

    /// Takes ciphertext from the client and appends what it says to `plain`. Fails with `malformed`
    /// if it is no TLS that is spoken here, or broken; `output` then holds the alert.
    Result<void> receive(Bytes& plain, std::span<const std::byte> cipher);
    /// Encrypts; only after the handshake.
    Result<void> send(std::span<const std::byte> plain);
    /// Says that nothing more will be sent.
    void say_goodbye();

    bool is_ready() const;
    /// The client has said goodbye.
    bool input_ended() const;

    /// Ciphertext for the client; valid until the next call.
    std::span<const std::byte> output() const;
    /// All of `output` has been written.
    void clear_output();

  private:
    std::unique_ptr<Impl> impl_;
};

/// The certificate and key of a server. Any thread.
class TlsServer {
  public:
    struct Files {
        std::filesystem::path certificate;  ///< PEM, the chain behind it
        std::filesystem::path key;          ///< PEM
    };

    /// Fails with `invalid_argument` and the file's name if one can't be read, or they don't belong
    /// together.
    static Result<std::unique_ptr<TlsServer>> open(Files files);
    ~TlsServer();
    TlsServer(const TlsServer&) = delete;
    TlsServer& operator=(const TlsServer&) = delete;

    /// Reads the files again, for connections from now on. If it fails nothing changes.
    Result<void> reload();
    /// A new connection's. Fails with `internal` if there is no memory.
    Result<std::unique_ptr<TlsChannel>> accept();

  private:
    struct Context;

    TlsServer(Files files, std::shared_ptr<Context> context);
    static Result<std::shared_ptr<Context>> load(const Files& files);

    const Files files_;
    Mutex mutex_;
    std::shared_ptr<Context> context_ TERRANE_GUARDED_BY(mutex_);
};

}  // namespace terrane
