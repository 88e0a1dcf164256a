// Who may come in: a file of tokens, of which only the SHA-256 is kept.
//
//     [[token]]
//     name = "alice"                     # in logs
//     sha256 = "5e88...d8"               # of the token; 64 hex digits
//     expires = 2027-01-01T00:00:00Z     # optional
//     world = "f130...a0"                # optional: only for the world with this fingerprint
//     view_radius_max = 32               # optional caps, see server/ARCHITECTURE.md, Limits
//     bytes_per_second_max = 1000000
//     requests_per_second_max = 100
//     credit_window_bytes = 65536
//
// A token is 256 random bits (`terrane token new`), so one round of SHA-256 hides it, and nothing
// is gained by guessing at hashes.
#pragma once

#include "protocol/base/hash.h"
#include "protocol/base/mutex.h"
#include "protocol/base/result.h"

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

inline constexpr std::size_t kTokensMax = 4096;
inline constexpr std::size_t kTokenFileBytesMax = std::size_t{4} << 20U;

using Sha256 = std::array<unsigned char, 32>;

Sha256 sha256_of(std::string_view text);
/// 64 lower-case hex digits.
std::string to_hex(const Sha256& hash);

/// What a token changes of the server's caps; absent: nothing.
struct TokenCaps {
    std::optional<std::uint32_t> view_radius_max;
    std::optional<std::uint64_t> bytes_per_second_max;
    std::optional<std::uint32_t> requests_per_second_max;
    std::optional<std::uint32_t> credit_window_bytes;

    friend bool operator==(const TokenCaps&, const TokenCaps&) = default;
};

struct TokenEntry {
    std::string name;
    Sha256 hash{};
    std::optional<std::chrono::sys_seconds> expires;
    std::optional<Hash128> world;
    TokenCaps caps;
};

/// Reads a file's text. Fails with `invalid_argument` and every fault, a line each:
/// "tokens.toml:3:1: token.nmae: is not a known key; the nearest known one is \"name\"".
Result<std::vector<TokenEntry>> parse_tokens(std::string_view text, std::string_view file_name);
/// Fails with `io_error` if the file can't be read.
Result<std::vector<TokenEntry>> read_tokens(const std::filesystem::path& path);

/// "2027-01-01T00:00:00Z".
std::string utc_text(std::chrono::sys_seconds time);

/// 256 bits from the system, as 43 characters of base64url.
Result<std::string> new_token();
/// Adds `entry` to the file, which is made if it isn't there (readable by its owner only). The
/// whole file is written aside and renamed. Fails with `invalid_argument` if the name is taken.
Result<void> add_token(const std::filesystem::path& path, const TokenEntry& entry);

/// Checks tokens against a table that may be replaced while others ask. Any thread.
class TokenGate {
  public:
    struct Options {
        bool anonymous = true;  ///< who shows no token may come in too
        Hash128 world;          ///< fingerprint of what is served
    };

    TokenGate(Options options, std::vector<TokenEntry> entries);

    /// What the bearer may do. Fails with `unauthorized` if the token is missing (and needed), not
    /// known, expired or another world's. Takes the same time whichever entry it is.
    Result<TokenCaps> admit(std::string_view token,
                            std::chrono::system_clock::time_point now) const;
    void replace(std::vector<TokenEntry> entries);

  private:
    using Entries = std::vector<TokenEntry>;

    const Options options_;
    mutable Mutex mutex_;
    std::shared_ptr<const Entries> entries_ TERRANE_GUARDED_BY(mutex_);
};

/// The token of an HTTP request: "Authorization: Bearer TOKEN", else "?token=TOKEN"; empty: none.
std::string token_of(std::string_view authorization, std::string_view query);

}  // namespace terrane
