#include "server/net/channel.h"

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "server/net/byte_protocol.h"
#include "server/net/tls.h"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <span>
#include <utility>

namespace terrane {

namespace {

/// Plaintext that is encrypted at a time: four records.
constexpr std::size_t kEncryptBytesMax = std::size_t{64} << 10U;

void deliver(ByteProtocol& protocol, std::span<const std::byte> bytes) {
    if (!bytes.empty() && !protocol.is_closing() && !protocol.is_dead()) {
        protocol.receive(bytes, ByteProtocol::Clock::now());
    }
}

}  // namespace

Channel::Channel(std::shared_ptr<ByteProtocol> protocol, std::unique_ptr<TlsChannel> tls,
                 Bytes& scratch)
    : protocol_(std::move(protocol)), tls_(std::move(tls)), plain_(scratch) {}

Result<void> Channel::receive(std::span<const std::byte> bytes) {
    if (!tls_) {
        deliver(*protocol_, bytes);
        return {};
    }
    plain_.clear();
    if (auto outcome = tls_->receive(plain_, bytes); !outcome) {
        return tl::unexpected(outcome.error());
    }
    deliver(*protocol_, plain_);
    return {};
}

/// The protocol's parts, or those of the one that takes over.
std::size_t Channel::gather() {
    std::size_t count = protocol_->gather(parts_);
    while (count == 0) {
        auto successor = protocol_->take_successor();
        if (!successor) {
            break;
        }
        protocol_ = std::move(successor);
        count = protocol_->gather(parts_);
    }
    return count;
}

/// Makes ciphertext of what the protocol has to say.
Result<void> Channel::encrypt() {
    const std::size_t count = gather();
    if (count == 0) {
        return {};
    }
    plain_.clear();
    for (std::size_t i = 0; i < count && plain_.size() < kEncryptBytesMax; ++i) {
        const auto part =
            parts_[i].first(std::min(parts_[i].size(), kEncryptBytesMax - plain_.size()));
        plain_.insert(plain_.end(), part.begin(), part.end());
    }
    if (auto sent = tls_->send(plain_); !sent) {
        return tl::unexpected(sent.error());
    }
    plain_encrypted_ = plain_.size();
    return {};
}

Result<Channel::Parts> Channel::output() {
    if (!tls_) {
        return Parts(parts_).first(gather());
    }
    if (tls_->output().empty() && tls_->is_ready()) {
        if (auto encrypted = encrypt(); !encrypted) {
            return tl::unexpected(encrypted.error());
        }
    }
    parts_.front() = tls_->output().subspan(cipher_written_);
    return Parts(parts_).first(parts_.front().empty() ? 0 : 1);
}

void Channel::wrote(std::size_t size_bytes) {
    if (!tls_) {
        protocol_->written(size_bytes, ByteProtocol::Clock::now());
        return;
    }
    cipher_written_ += size_bytes;
    if (cipher_written_ < tls_->output().size()) {
        return;
    }
    tls_->clear_output();
    cipher_written_ = 0;
    if (const std::size_t plain = std::exchange(plain_encrypted_, 0); plain > 0) {
        protocol_->written(plain, ByteProtocol::Clock::now());
    }
}

bool Channel::has_output() {
    return (tls_ && !tls_->output().empty()) || protocol_->gather(parts_) > 0;
}

Bytes Channel::farewell() {
    if (!tls_) {
        return {};
    }
    tls_->say_goodbye();
    const auto last = tls_->output();
    Bytes out(last.begin(), last.end());
    tls_->clear_output();
    return out;
}

std::span<const std::byte> Channel::alert() const {
    return tls_ ? tls_->output().subspan(cipher_written_) : std::span<const std::byte>();
}

}  // namespace terrane
