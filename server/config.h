// What `terrane serve` can be told, by a file and by flags: one table of settings for both.
//
// A setting `cache_mib` is `cache_mib = 256` in the file and `--cache-mib 256` on the command line,
// where it wins. Paths in a file count from the file's folder.
#pragma once

#include "protocol/base/result.h"

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace terrane {

struct ServerConfig {
    std::string world;
    std::string data;
    std::string store = "rocksdb";
    std::string tcp = "127.0.0.1:7777";
    std::string http = "127.0.0.1:8080";
    std::string tls_cert;
    std::string tls_key;
    std::string tokens;
    std::string anonymous = "auto";
    std::string viewer;
    bool publish_world = true;
    std::uint64_t workers;  ///< as many as the machine has cores
    std::uint64_t io_threads = 1;
    std::uint64_t cache_mib = 256;
    std::uint64_t stack_cache_mib = 64;
    std::uint64_t memory_max_mib = 0;
    std::uint64_t sessions_max;
    std::uint64_t sessions_per_address_max;
    std::uint64_t view_radius_max;
    std::uint64_t credit_window_bytes;
    std::uint64_t requests_per_second_max = 0;
    std::uint64_t bytes_per_second_max = 0;
    std::uint64_t tileset_levels;
    std::uint64_t header_timeout_s = 10;
    std::uint64_t stall_timeout_s = 30;
    std::uint64_t idle_timeout_s = 60;
    std::uint64_t drain_timeout_s = 10;
    std::string log_format = "text";
    std::string log_level = "info";

    ServerConfig();

    friend bool operator==(const ServerConfig&, const ServerConfig&) = default;
};

struct Setting {
    using Text = std::string ServerConfig::*;
    using Number = std::uint64_t ServerConfig::*;
    using Flag = bool ServerConfig::*;

    std::string_view key;
    std::string_view help;
    std::variant<Text, Number, Flag> member;
    bool is_path = false;
    std::uint64_t least = 0;  ///< of a number
    std::uint64_t most = 0;
    std::vector<std::string_view> allowed = {};  ///< of a text; empty: anything
};

/// All of them, in the order in which they are shown.
std::span<const Setting> settings();

/// "--cache-mib" for "cache_mib".
std::string flag_of(const Setting& setting);
/// The value as text: what a flag would say.
std::string value_text(const ServerConfig& config, const Setting& setting);
/// Takes a flag's value. Fails with `invalid_argument` and what is allowed.
Result<void> set_value(ServerConfig& config, const Setting& setting, std::string_view text);

/// Takes what the file says, leaves the rest. Fails with `invalid_argument` and every fault, a line
/// each: "server.toml:3:1: cache_mb: is not a known key; the nearest known one is \"cache_mib\"".
Result<void> set_from_toml(ServerConfig& config, std::string_view text,
                           const std::filesystem::path& file);
/// Fails with `io_error` if the file can't be read.
Result<void> set_from_file(ServerConfig& config, const std::filesystem::path& file);

/// The whole configuration as a file that reads back as the same, each setting with its help.
std::string config_toml(const ServerConfig& config);

}  // namespace terrane
