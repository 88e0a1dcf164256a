#include "server/net/tokens.h"

#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"
#include "protocol/base/mutex.h"
#include "protocol/base/result.h"
#include "protocol/base/write_file.h"
#include "server/http/router.h"
#include "server/toml_settings.h"

#include <openssl/crypto.h>
#include <openssl/rand.h>
#include <openssl/sha.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <ios>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace terrane {

namespace {

constexpr std::size_t kTokenBytes = 32;
constexpr std::string_view kBearer = "Bearer ";
constexpr std::int64_t kUint32Max = std::numeric_limits<std::uint32_t>::max();
constexpr std::int64_t kBytesPerSecondMax = std::int64_t{1} << 40;

std::optional<Sha256> sha256_from_hex(std::string_view text) {
    const auto high = hash_from_hex(text.substr(0, std::min<std::size_t>(text.size(), 32)));
    const auto low = hash_from_hex(text.substr(std::min<std::size_t>(text.size(), 32)));
    if (!high || !low) {
        return std::nullopt;
    }
    Sha256 out{};
    std::size_t at = 0;
    for (const std::uint64_t part : {high->high, high->low, low->high, low->low}) {
        for (unsigned shift = 64; shift > 0; shift -= 8) {
            out[at++] = static_cast<unsigned char>(part >> (shift - 8));
        }
    }
    return out;
}

std::chrono::sys_seconds seconds_of(const toml::date_time& at) {
    using namespace std::chrono;
    const sys_days day = year(at.date.year) / month(at.date.month) / std::chrono::day(at.date.day);
    const int offset_minutes = at.offset ? at.offset->minutes : 0;  // a table gives none without
    return day + hours(at.time.hour) + minutes(at.time.minute) + seconds(at.time.second) -
           minutes(offset_minutes);
}

template <typename T>
std::optional<T> cap(TomlTable& table, std::string_view key, std::int64_t most) {
    const auto value = table.integer(key, 0, most);
    return value ? std::optional(static_cast<T>(*value)) : std::nullopt;
}

TokenEntry read_entry(TomlTable& table) {
    TokenEntry entry;
    const auto name = table.text("name");
    const auto hash = table.text("sha256");
    const auto parsed = hash ? sha256_from_hex(*hash) : std::nullopt;
    if (!name || name->empty()) {
        table.fault("name", "a name is needed, for logs");
    }
    if (!parsed) {
        table.fault("sha256", "the token's SHA-256 is needed, 64 hex digits");
    }
    entry.name = name.value_or("");
    entry.hash = parsed.value_or(Sha256{});
    if (const auto expires = table.date_time("expires")) {
        entry.expires = seconds_of(*expires);
    }
    if (const auto world = table.text("world")) {
        entry.world = hash_from_hex(*world);
        if (!entry.world) {
            table.fault("world", "it must be a world's fingerprint, 32 hex digits");
        }
    }
    entry.caps.view_radius_max = cap<std::uint32_t>(table, "view_radius_max", kUint32Max);
    entry.caps.bytes_per_second_max =
        cap<std::uint64_t>(table, "bytes_per_second_max", kBytesPerSecondMax);
    entry.caps.requests_per_second_max =
        cap<std::uint32_t>(table, "requests_per_second_max", kUint32Max);
    entry.caps.credit_window_bytes = cap<std::uint32_t>(table, "credit_window_bytes", kUint32Max);
    table.finish();
    return entry;
}

/// As the file has it. A name's quotation marks and backslashes are escaped.
std::string entry_text(const TokenEntry& entry) {
    std::string name;
    for (const char c : entry.name) {
        name += c == '"' || c == '\\' ? "\\" : "";
        name += c;
    }
    std::string out =
        "[[token]]\nname = \"" + name + "\"\nsha256 = \"" + to_hex(entry.hash) + "\"\n";
    if (entry.expires) {
        out += "expires = " + utc_text(*entry.expires) + "\n";
    }
    if (entry.world) {
        out += "world = \"" + to_hex(*entry.world) + "\"\n";
    }
    const auto add = [&out](std::string_view key, const auto& value) {
        if (value) {
            out += std::string(key) + " = " + std::to_string(*value) + "\n";
        }
    };
    add("view_radius_max", entry.caps.view_radius_max);
    add("bytes_per_second_max", entry.caps.bytes_per_second_max);
    add("requests_per_second_max", entry.caps.requests_per_second_max);
    add("credit_window_bytes", entry.caps.credit_window_bytes);
    return out;
}

Result<std::string> read_text(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    std::error_code error;
    const auto size = std::filesystem::file_size(path, error);
    if (!in || error) {
        return fail(ErrorCode::io_error, path.string() + ": cannot be read");
    }
    if (size > kTokenFileBytesMax) {
        return fail(ErrorCode::too_large, path.string() + ": a token file has at most " +
                                              std::to_string(kTokenFileBytesMax) + " bytes");
    }
    return std::string(std::istreambuf_iterator<char>(in), {});
}

tl::unexpected<Error> refuse(std::string message) {
    return fail(ErrorCode::unauthorized, std::move(message));
}

}  // namespace

Sha256 sha256_of(std::string_view text) {
    Sha256 out{};
    SHA256(reinterpret_cast<const unsigned char*>(text.data()), text.size(), out.data());
    return out;
}

std::string to_hex(const Sha256& hash) {
    static constexpr std::string_view kDigits = "0123456789abcdef";
    std::string out;
    for (const unsigned char byte : hash) {
        out += kDigits[byte >> 4U];
        out += kDigits[byte & 15U];
    }
    return out;
}

std::string utc_text(std::chrono::sys_seconds time) {
    using namespace std::chrono;
    const auto day = floor<days>(time);
    const year_month_day date(day);
    const hh_mm_ss clock(time - day);
    std::array<char, 64> out{};
    std::snprintf(out.data(), out.size(), "%04d-%02u-%02uT%02d:%02d:%02dZ",
                  static_cast<int>(date.year()), static_cast<unsigned>(date.month()),
                  static_cast<unsigned>(date.day()), static_cast<int>(clock.hours().count()),
                  static_cast<int>(clock.minutes().count()),
                  static_cast<int>(clock.seconds().count()));
    return out.data();
}

Result<std::vector<TokenEntry>> parse_tokens(std::string_view text, std::string_view file_name) {
    const auto root = parse_toml(text, file_name);
    if (!root) {
        return tl::unexpected(root.error());
    }
    TomlFaults faults(file_name);
    TomlTable table(*root, "", faults);
    std::vector<TokenEntry> entries;
    if (const toml::array* tokens = table.array_of_tables("token")) {
        if (tokens->size() > kTokensMax) {
            table.fault("token", "there are at most " + std::to_string(kTokensMax));
            return tl::unexpected(faults.outcome().error());
        }
        for (const toml::node& node : *tokens) {
            TomlTable entry(*node.as_table(), "token", faults);
            entries.push_back(read_entry(entry));
            const auto same_name = [&](const TokenEntry& other) {
                return other.name == entries.back().name;
            };
            if (std::any_of(entries.begin(), entries.end() - 1, same_name)) {
                entry.fault("name", "two tokens have this name");
            }
        }
    }
    table.finish();
    if (const auto outcome = faults.outcome(); !outcome) {
        return tl::unexpected(outcome.error());
    }
    return entries;
}

Result<std::vector<TokenEntry>> read_tokens(const std::filesystem::path& path) {
    const auto text = read_text(path);
    if (!text) {
        return tl::unexpected(text.error());
    }
    return parse_tokens(*text, path.string());
}

Result<std::string> new_token() {
    std::array<unsigned char, kTokenBytes> random{};
    if (RAND_bytes(random.data(), static_cast<int>(random.size())) != 1) {
        return fail(ErrorCode::internal, "the system has no random bytes");
    }
    static constexpr std::string_view kDigits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
    std::string out;
    unsigned bits = 0;
    unsigned held = 0;
    for (const unsigned char byte : random) {
        held = (held << 8U) | byte;
        bits += 8;
        while (bits >= 6) {
            bits -= 6;
            out += kDigits[(held >> bits) & 63U];
        }
        held &= (1U << bits) - 1;
    }
    out += kDigits[(held << (6 - bits)) & 63U];
    return out;
}

Result<void> add_token(const std::filesystem::path& path, const TokenEntry& entry) {
    std::string text;
    if (std::filesystem::exists(path)) {
        auto before = read_text(path);
        if (!before) {
            return tl::unexpected(before.error());
        }
        text = *std::move(before);
        text += text.empty() || text.ends_with('\n') ? "\n" : "\n\n";
    }
    text += entry_text(entry);
    if (const auto parsed = parse_tokens(text, path.string()); !parsed) {
        return tl::unexpected(parsed.error());
    }
    if (const auto written = write_file(path, bytes_of(text)); !written) {
        return tl::unexpected(written.error());
    }
    std::error_code ignored;  // some file systems have no permissions
    std::filesystem::permissions(
        path, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write, ignored);
    return {};
}

TokenGate::TokenGate(Options options, std::vector<TokenEntry> entries)
    : options_(options), entries_(std::make_shared<const Entries>(std::move(entries))) {}

Result<TokenCaps> TokenGate::admit(std::string_view token,
                                   std::chrono::system_clock::time_point now) const {
    if (token.empty()) {
        if (options_.anonymous) {
            return TokenCaps{};
        }
        return refuse("a token is needed");
    }
    std::shared_ptr<const Entries> entries;
    {
        const MutexLock lock(mutex_);
        entries = entries_;
    }
    const Sha256 hash = sha256_of(token);
    const TokenEntry* found = nullptr;
    for (const TokenEntry& entry : *entries) {  // all of them, whichever it is
        const bool is_same = CRYPTO_memcmp(entry.hash.data(), hash.data(), hash.size()) == 0;
        found = is_same ? &entry : found;
    }
    if (found == nullptr) {
        return refuse("the token is not known");
    }
    if (found->expires && now >= *found->expires) {
        return refuse("the token \"" + found->name + "\" expired at " + utc_text(*found->expires));
    }
    if (found->world && *found->world != options_.world) {
        return refuse("the token \"" + found->name + "\" is for another world");
    }
    return found->caps;
}

void TokenGate::replace(std::vector<TokenEntry> entries) {
    auto made = std::make_shared<const Entries>(std::move(entries));
    const MutexLock lock(mutex_);
    entries_.swap(made);
}

std::string token_of(std::string_view authorization, std::string_view query) {
    if (authorization.starts_with(kBearer)) {
        return std::string(authorization.substr(kBearer.size()));
    }
    return query_value(query, "token").value_or("");
}

}  // namespace terrane
