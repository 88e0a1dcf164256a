// What a listener is told: its ports, its limits, and who hears of what happens.
#pragma once

#include "protocol/base/bytes.h"
#include "server/net/byte_protocol.h"
#include "server/net/endpoint.h"
#include "server/net/tls.h"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace terrane {

inline constexpr std::size_t kSessionsMax = 16384;
inline constexpr std::size_t kSessionsPerAddressMax = 1024;
inline constexpr std::size_t kIoThreadsMax = 64;

struct ListenPort {
    std::string name;  ///< "tcp" or "http", for messages
    Endpoint endpoint;
    ProtocolFactory make;
    Bytes refusal = {};        ///< written to a client for whom there is no room
    TlsServer* tls = nullptr;  ///< outlives the listener
};

/// What the connections of all ports have done; only ever rises.
struct TrafficCounters {
    std::atomic<std::uint64_t> accepted{0};
    std::atomic<std::uint64_t> refused{0};
    std::atomic<std::uint64_t> tls_failed{0};
    std::atomic<std::uint64_t> bytes_in{0};  ///< as on the wire
    std::atomic<std::uint64_t> bytes_out{0};
};

struct ListenOptions {
    Endpoint endpoint;  ///< of the native protocol
    std::size_t io_threads = 1;
    std::size_t sessions_max = kSessionsMax;
    std::size_t sessions_per_address_max = kSessionsPerAddressMax;
    std::chrono::milliseconds tick{1'000};  ///< how often deadlines are looked at
    std::chrono::milliseconds tls_handshake{kTlsHandshakeMaxMs};
    /// Told about each session's beginning and end, in a sentence; any thread; may be empty.
    std::function<void(std::string_view)> on_event;
    /// Told as `on_event` is, instead of it, of sessions that ended because of malformed input.
    std::function<void(std::string_view)> on_fault = {};
};

}  // namespace terrane
