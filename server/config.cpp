#include "server/config.h"

#include "protocol/base/result.h"
#include "protocol/wire/limits.h"
#include "server/chunks/worker_pool.h"
#include "server/http/tiles3d.h"
#include "server/net/listen_options.h"
#include "server/net/session_caps.h"
#include "server/toml_settings.h"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

namespace terrane {

namespace {

constexpr std::uint64_t kMibMax = std::uint64_t{1} << 20U;  ///< a terabyte
constexpr std::uint64_t kSecondsMax = 86'400;
constexpr std::size_t kConfigBytesMax = std::size_t{1} << 20U;

template <typename... Cases>
struct Overloaded : Cases... {
    using Cases::operator()...;
};

std::string in_quotes(std::string_view text) {
    std::string out(1, '"');
    for (const char c : text) {
        out += c == '"' || c == '\\' ? "\\" : "";
        out += c;
    }
    return out + '"';
}

std::string joined(const std::vector<std::string_view>& words) {
    std::string out;
    for (const std::string_view word : words) {
        out += out.empty() ? "" : ", ";
        out += word;
    }
    return out;
}

std::string range_text(const Setting& setting) {
    return std::to_string(setting.least) + ".." + std::to_string(setting.most);
}

Result<void> check_text(const Setting& setting, std::string_view text) {
    if (!setting.allowed.empty() &&
        std::ranges::find(setting.allowed, text) == setting.allowed.end()) {
        return fail(ErrorCode::invalid_argument,
                    in_quotes(text) + " is not one of " + joined(setting.allowed));
    }
    return {};
}

using Config = ServerConfig;

std::vector<Setting> settings_of_place() {
    return {
        {.key = "world", .help = "World file", .member = &Config::world, .is_path = true},
        {.key = "data",
         .help = "Folder where chunks are kept; made if missing",
         .member = &Config::data,
         .is_path = true},
        {.key = "store",
         .help = "rocksdb, or memory: nothing is kept",
         .member = &Config::store,
         .allowed = {"rocksdb", "memory"}},
        {.key = "tcp",
         .help = "Address and port of the native protocol; port 0 takes a free one",
         .member = &Config::tcp},
        {.key = "http",
         .help = "Address and port of HTTP and WebSocket; none turns them off",
         .member = &Config::http},
        {.key = "tls_cert",
         .help = "PEM certificate chain: both ports speak TLS then; read again at SIGHUP",
         .member = &Config::tls_cert,
         .is_path = true},
        {.key = "tls_key", .help = "Its PEM key", .member = &Config::tls_key, .is_path = true},
        {.key = "tokens",
         .help = "File of tokens that let clients in; read again at SIGHUP",
         .member = &Config::tokens,
         .is_path = true},
        {.key = "anonymous",
         .help = "May who shows no token come in? auto: if there is no file of tokens",
         .member = &Config::anonymous,
         .allowed = {"auto", "yes", "no"}},
        {.key = "viewer",
         .help = "Folder with the viewer, served at /; empty: the one that came with the program, "
                 "else a small page",
         .member = &Config::viewer,
         .is_path = true},
        {.key = "publish_world",
         .help = "May clients have the world file?",
         .member = &Config::publish_world},
    };
}

std::vector<Setting> settings_of_machine() {
    return {
        {.key = "workers",
         .help = "Threads that make chunks",
         .member = &Config::workers,
         .least = 1,
         .most = kWorkersMax},
        {.key = "io_threads",
         .help = "Threads that talk to clients",
         .member = &Config::io_threads,
         .least = 1,
         .most = kIoThreadsMax},
        {.key = "cache_mib",
         .help = "Memory for encoded chunks, MiB",
         .member = &Config::cache_mib,
         .least = 1,
         .most = kMibMax},
        {.key = "stack_cache_mib",
         .help = "Memory for the last generated stacks, MiB",
         .member = &Config::stack_cache_mib,
         .least = 1,
         .most = kMibMax},
        {.key = "memory_max_mib",
         .help = "Do not start if the memory bound is above this, MiB; 0: only warn above what the "
                 "machine has",
         .member = &Config::memory_max_mib,
         .least = 0,
         .most = kMibMax},
    };
}

std::vector<Setting> settings_of_clients() {
    return {
        {.key = "sessions_max",
         .help = "Connections at a time, over all ports",
         .member = &Config::sessions_max,
         .least = 1,
         .most = std::uint64_t{1} << 20U},
        {.key = "sessions_per_address_max",
         .help = "Connections at a time from one address",
         .member = &Config::sessions_per_address_max,
         .least = 1,
         .most = std::uint64_t{1} << 20U},
        {.key = "view_radius_max",
         .help = "Chunk sides around a viewer, at each level; 0: no views",
         .member = &Config::view_radius_max,
         .least = 0,
         .most = kViewRadiusMax},
        {.key = "credit_window_bytes",
         .help = "Bytes of a view that may be sent and not read",
         .member = &Config::credit_window_bytes,
         .least = kCreditWindowBytesMin,
         .most = kCreditWindowBytesMax},
        {.key = "requests_per_second_max",
         .help = "Requests of one session or HTTP connection; 0: as many as it likes",
         .member = &Config::requests_per_second_max,
         .least = 0,
         .most = std::uint64_t{1} << 20U},
        {.key = "bytes_per_second_max",
         .help = "Bytes to one session or HTTP connection; 0: as many as it takes",
         .member = &Config::bytes_per_second_max,
         .least = 0,
         .most = std::uint64_t{1} << 40U},
        {.key = "tileset_levels",
         .help = "Levels of the quadtree of 3D Tiles, a multiple of 3: with 18 it is 2^17 chunks "
                 "wide, each level less halves that, and clients come sooner to the ground; "
                 "another number is another content id",
         .member = &Config::tileset_levels,
         .least = kSubtreeLevels,
         .most = kTilesetLevels},
    };
}

std::vector<Setting> settings_of_time_and_log() {
    return {
        {.key = "header_timeout_s",
         .help = "Seconds for a client's greeting, or a request's headers",
         .member = &Config::header_timeout_s,
         .least = 1,
         .most = kSecondsMax},
        {.key = "stall_timeout_s",
         .help = "Seconds for the rest of a message, or a write that stands",
         .member = &Config::stall_timeout_s,
         .least = 1,
         .most = kSecondsMax},
        {.key = "idle_timeout_s",
         .help = "Seconds of silence until a connection is closed",
         .member = &Config::idle_timeout_s,
         .least = 1,
         .most = kSecondsMax},
        {.key = "drain_timeout_s",
         .help = "Seconds that clients get to finish when the server stops",
         .member = &Config::drain_timeout_s,
         .least = 0,
         .most = kSecondsMax},
        {.key = "log_format",
         .help = "text, or json: an object a line",
         .member = &Config::log_format,
         .allowed = {"text", "json"}},
        {.key = "log_level",
         .help = "debug, info, warning, error or off",
         .member = &Config::log_level,
         .allowed = {"debug", "info", "warning", "error", "off"}},
    };
}

/// In the order in which they are shown.
std::vector<Setting> all_settings() {
    std::vector<Setting> all;
    for (const auto& part : {settings_of_place(), settings_of_machine(), settings_of_clients(),
                             settings_of_time_and_log()}) {
        all.insert(all.end(), part.begin(), part.end());
    }
    return all;
}

}  // namespace

ServerConfig::ServerConfig()
    : workers(std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, kWorkersMax)),
      sessions_max(kSessionsMax),
      sessions_per_address_max(kSessionsPerAddressMax),
      view_radius_max(kViewRadiusMax),
      credit_window_bytes(kCreditWindowBytes),
      tileset_levels(kTilesetLevels) {}

std::span<const Setting> settings() {
    static const std::vector<Setting> kSettings = all_settings();
    return kSettings;
}

std::string flag_of(const Setting& setting) {
    std::string flag = "--" + std::string(setting.key);
    std::ranges::replace(flag, '_', '-');
    return flag;
}

std::string value_text(const ServerConfig& config, const Setting& setting) {
    return std::visit(
        Overloaded{
            [&](Setting::Text member) { return config.*member; },
            [&](Setting::Number member) { return std::to_string(config.*member); },
            [&](Setting::Flag member) { return std::string(config.*member ? "true" : "false"); }},
        setting.member);
}

Result<void> set_value(ServerConfig& config, const Setting& setting, std::string_view text) {
    if (const auto* member = std::get_if<Setting::Text>(&setting.member)) {
        if (const auto checked = check_text(setting, text); !checked) {
            return checked;
        }
        config.*(*member) = text;
        return {};
    }
    if (const auto* member = std::get_if<Setting::Flag>(&setting.member)) {
        if (text != "true" && text != "false") {
            return fail(ErrorCode::invalid_argument, in_quotes(text) + " is not true or false");
        }
        config.*(*member) = text == "true";
        return {};
    }
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || value < setting.least ||
        value > setting.most) {
        return fail(ErrorCode::invalid_argument,
                    in_quotes(text) + " is not an integer within " + range_text(setting));
    }
    config.*std::get<Setting::Number>(setting.member) = value;
    return {};
}

Result<void> set_from_toml(ServerConfig& config, std::string_view text,
                           const std::filesystem::path& file) {
    const auto root = parse_toml(text, file.string());
    if (!root) {
        return tl::unexpected(root.error());
    }
    TomlFaults faults(file.string());
    TomlTable table(*root, "", faults);
    ServerConfig read = config;
    for (const Setting& setting : settings()) {
        if (const auto* member = std::get_if<Setting::Text>(&setting.member)) {
            auto value = table.text(setting.key);
            if (!value) {
                continue;
            }
            if (const auto checked = check_text(setting, *value); !checked) {
                table.fault(setting.key, checked.error().message);
            }
            const bool is_beside = setting.is_path && !value->empty();
            read.*(*member) = is_beside ? (file.parent_path() / *value).string() : *value;
        } else if (const auto* flag = std::get_if<Setting::Flag>(&setting.member)) {
            read.*(*flag) = table.flag(setting.key).value_or(read.*(*flag));
        } else {
            const auto number = std::get<Setting::Number>(setting.member);
            const auto value = table.integer(setting.key, static_cast<std::int64_t>(setting.least),
                                             static_cast<std::int64_t>(setting.most));
            read.*number = value ? static_cast<std::uint64_t>(*value) : read.*number;
        }
    }
    table.finish();
    if (auto outcome = faults.outcome(); !outcome) {
        return outcome;
    }
    config = std::move(read);
    return {};
}

Result<void> set_from_file(ServerConfig& config, const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    std::string text(kConfigBytesMax + 1, '\0');
    in.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
    if (!in.eof() || in.bad()) {
        return text.size() > kConfigBytesMax
                   ? fail(ErrorCode::too_large, file.string() + ": a configuration has at most " +
                                                    std::to_string(kConfigBytesMax) + " bytes")
                   : fail(ErrorCode::io_error, file.string() + ": cannot be read");
    }
    return set_from_toml(config, text, file);
}

std::string config_toml(const ServerConfig& config) {
    std::string out;
    for (const Setting& setting : settings()) {
        out += "# " + std::string(setting.help);
        if (!setting.allowed.empty()) {
            out += " (" + joined(setting.allowed) + ")";
        } else if (std::holds_alternative<Setting::Number>(setting.member)) {
            out += " (" + range_text(setting) + ")";
        }
        const bool is_text = std::holds_alternative<Setting::Text>(setting.member);
        const std::string value = value_text(config, setting);
        out +=
            "\n" + std::string(setting.key) + " = " + (is_text ? in_quotes(value) : value) + "\n";
    }
    return out;
}

}  // namespace terrane
