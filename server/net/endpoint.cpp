#include "server/net/endpoint.h"

#include "protocol/base/result.h"

#include <arpa/inet.h>

#include <array>
#include <charconv>
#include <cstddef>
#include <string>
#include <string_view>
#include <system_error>

namespace terrane {

namespace {

bool is_address(int family, const std::string& text) {
    std::array<unsigned char, sizeof(in6_addr)> address{};
    return inet_pton(family, text.c_str(), address.data()) == 1;
}

}  // namespace

Result<Endpoint> parse_endpoint(std::string_view text) {
    const auto refuse = [text] {
        return fail(ErrorCode::invalid_argument,
                    "\"" + std::string(text) +
                        "\" is no ADDRESS:PORT; write it like 127.0.0.1:7777 or [::1]:7777");
    };
    const std::size_t colon = text.rfind(':');
    if (colon == std::string_view::npos) {
        return refuse();
    }
    std::string_view host = text.substr(0, colon);
    const std::string_view port_text = text.substr(colon + 1);
    Endpoint endpoint;
    const auto parsed =
        std::from_chars(port_text.data(), port_text.data() + port_text.size(), endpoint.port);
    if (parsed.ec != std::errc() || parsed.ptr != port_text.data() + port_text.size()) {
        return refuse();
    }
    const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
    if (bracketed) {
        host = host.substr(1, host.size() - 2);
    }
    endpoint.address = host == "localhost" ? "127.0.0.1" : std::string(host);
    if (!is_address(bracketed ? AF_INET6 : AF_INET, endpoint.address)) {
        return refuse();
    }
    return endpoint;
}

std::string to_string(const Endpoint& endpoint) {
    const bool is_v6 = endpoint.address.find(':') != std::string::npos;
    return (is_v6 ? "[" + endpoint.address + "]" : endpoint.address) + ":" +
           std::to_string(endpoint.port);
}

bool is_loopback(const Endpoint& endpoint) {
    return endpoint.address.starts_with("127.") || endpoint.address == "::1";
}

}  // namespace terrane
