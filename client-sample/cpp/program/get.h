// terrane-client get: fetches chunks, decodes them, and writes them to files if asked to.
#pragma once

#include "client-sample/cpp/client.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

struct GetOptions {
    std::string host = "127.0.0.1";
    std::uint16_t port = kDefaultPort;
    std::string token;
    TlsUse tls;
    std::vector<ChunkPos> keys;  ///< each once
    ChunkFormat format = ChunkFormat::draco;
    std::filesystem::path output;  ///< empty: write nothing
    bool obj = false;
    bool json = false;
    double timeout_s = 30;
};

struct Address {
    std::string host;
    std::uint16_t port = 0;

    friend bool operator==(const Address&, const Address&) = default;
};

/// "HOST:PORT", "HOST" (port 7777) or "[V6ADDRESS]:PORT". Fails with `invalid_argument`.
Result<Address> parse_address(std::string_view text);

/// "X,Y,Z", each an int32. Fails with `invalid_argument` or `out_of_range`; the message quotes the
/// text.
Result<ChunkPos> parse_chunk(std::string_view text, std::int32_t lod);

/// Fetches and prints; gives the exit code. Messages for people go to stderr, the report to stdout.
int run_get(const GetOptions& options);

}  // namespace terrane
