// An address and a port as somebody types them.
#pragma once

#include "protocol/base/result.h"

#include <cstdint>
#include <string>
#include <string_view>

namespace terrane {

/// A numerical IPv4 or IPv6 address, and a port; port 0 lets the system choose.
struct Endpoint {
    std::string address = "127.0.0.1";
    std::uint16_t port = 7777;

    friend bool operator==(const Endpoint&, const Endpoint&) = default;
};

/// "127.0.0.1:7777", "[::1]:7777" or "localhost:7777" (which is 127.0.0.1). Fails with
/// `invalid_argument`; the message quotes the text.
Result<Endpoint> parse_endpoint(std::string_view text);

/// The way it is typed.
std::string to_string(const Endpoint& endpoint);

/// Only this machine can reach it.
bool is_loopback(const Endpoint& endpoint);

}  // namespace terrane
