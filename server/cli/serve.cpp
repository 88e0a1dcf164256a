// terrane serve: makes chunks of one world on request and sends them to game clients, until told to
// stop.
//
// SIGTERM and SIGINT drain: what is under way is answered, everybody gets a goodbye, the store is
// flushed, exit code 0. A second signal ends the program at once.
#include "generator/world/world_file.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/wire/limits.h"
#include "server/chunks/counters.h"
#include "server/cli/open_world.h"
#include "server/cli/program.h"
#include "server/config.h"
#include "server/http/tiles3d.h"
#include "server/http/viewer_files.h"
#include "server/log.h"
#include "server/net/endpoint.h"
#include "server/net/session_caps.h"
#include "server/net/tls.h"
#include "server/server.h"

#include <CLI/CLI.hpp>
#include <pthread.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace terrane {
namespace {

/// As the command line gives them.
struct ServeFlags {
    std::string config;
    bool print_config = false;
    std::vector<std::string> values;  ///< one a setting
};

/// Takes the signals from every thread that starts after it and gives them to `wait`.
class ServerSignals {
  public:
    ServerSignals() {
        sigemptyset(&signals_);
        for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
            sigaddset(&signals_, signal);
        }
        pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
        std::signal(SIGPIPE, SIG_IGN);  // a client that left is an error code
    }

    /// Waits for the order to stop; from then on the next one ends the program. Meanwhile SIGHUP
    /// calls `reload`.
    template <typename Reload>
    std::string wait(Reload reload) const {
        int signal = 0;
        while (sigwait(&signals_, &signal) != 0 || signal == SIGHUP) {
            reload();
        }
        std::signal(SIGINT, SIG_DFL);
        std::signal(SIGTERM, SIG_DFL);
        std::signal(SIGHUP, SIG_IGN);
        pthread_sigmask(SIG_UNBLOCK, &signals_, nullptr);
        return signal == SIGINT ? "SIGINT" : "SIGTERM";
    }

  private:
    sigset_t signals_{};
};

std::uint64_t mib(std::size_t bytes) {
    return bytes >> 20U;
}

/// What this machine has; 0 if it doesn't say.
std::size_t physical_bytes() {
    const long pages = sysconf(_SC_PHYS_PAGES);
    const long page_bytes = sysconf(_SC_PAGESIZE);
    return pages > 0 && page_bytes > 0
               ? static_cast<std::size_t>(pages) * static_cast<std::size_t>(page_bytes)
               : 0;
}

void log_start(const Log& log, const ServerOptions& options, std::size_t descriptors) {
    const MemoryBound bound = memory_bound_of(options);
    log.info("memory bound", {{"sum_mib", mib(bound.sum())},
                              {"caches_mib", mib(bound.caches)},
                              {"store_mib", mib(bound.store)},
                              {"workers_mib", mib(bound.workers)},
                              {"queue_mib", mib(bound.queue)},
                              {"sessions_mib", mib(bound.sessions)},
                              {"sessions_max", std::uint64_t{options.listen.sessions_max}}});
    if (descriptors < options.listen.sessions_max) {
        log.warning("fewer descriptors than sessions are allowed; raise the hard limit",
                    {{"descriptors", std::uint64_t{descriptors}},
                     {"sessions_max", std::uint64_t{options.listen.sessions_max}}});
    }
    if (const std::size_t physical = physical_bytes(); physical > 0 && bound.sum() > physical) {
        log.warning(
            "the memory bound is above what this machine has; fewer --sessions-max lower it",
            {{"sum_mib", mib(bound.sum())}, {"machine_mib", mib(physical)}});
    }
    const bool has_tokens = !options.token_file.empty() && !options.anonymous.value_or(false);
    for (const auto& endpoint : {std::optional(options.listen.endpoint), options.http}) {
        if (endpoint && !is_loopback(*endpoint) && !(options.tls && has_tokens)) {
            log.warning(
                options.tls  ? "this address can be reached from other machines, by anybody; "
                               "--tokens says who may come in"
                : has_tokens ? "this address can be reached from other machines, unencrypted: "
                               "tokens can be overheard; use --tls-cert and --tls-key"
                             : "this address can be reached from other machines, unencrypted "
                               "and by anybody; use --tls-cert, --tls-key and --tokens",
                {{"address", to_string(*endpoint)}});
        }
    }
}

int wrong_use(const std::string& message) {
    std::fprintf(stderr, "terrane: %s\n", message.c_str());
    return kExitWrongUse;
}

/// Defaults, then the file, then the flags.
Result<ServerConfig> config_of(const ServeFlags& flags, const std::vector<bool>& given) {
    ServerConfig config;
    if (!flags.config.empty()) {
        if (const auto read = set_from_file(config, flags.config); !read) {
            return tl::unexpected(read.error());
        }
    }
    for (std::size_t i = 0; i < given.size(); ++i) {
        if (!given[i]) {
            continue;
        }
        const Setting& setting = settings()[i];
        if (const auto set = set_value(config, setting, flags.values[i]); !set) {
            return fail(set.error().code, flag_of(setting) + ": " + set.error().message);
        }
    }
    return config;
}

Result<Endpoint> endpoint_of(const char* flag, const std::string& text) {
    auto endpoint = parse_endpoint(text);
    if (!endpoint) {
        return fail(endpoint.error().code, std::string(flag) + ": " + endpoint.error().message);
    }
    return endpoint;
}

/// Where the viewer is, if nobody says: installed, or built in the source tree that this program
/// was built in. Empty: nowhere.
std::filesystem::path viewer_folder(const std::string& said) {
    if (!said.empty()) {
        return said;
    }
    std::error_code error;
    const auto program = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
    for (const char* place : {"../share/terrane/viewer", "../../../client-sample/web/dist"}) {
        if (std::filesystem::exists(program / place / "index.html", error)) {
            return program / place;
        }
    }
    return {};
}

SessionCaps caps_of(const ServerConfig& config) {
    SessionCaps caps;
    caps.view_radius_max = static_cast<std::uint32_t>(config.view_radius_max);
    caps.credit_window_bytes = static_cast<std::uint32_t>(config.credit_window_bytes);
    caps.requests_per_second_max = static_cast<std::uint32_t>(config.requests_per_second_max);
    caps.bytes_per_second_max = config.bytes_per_second_max;
    return caps;
}

/// All but the world.
Result<ServerOptions> options_of(const ServerConfig& config) {
    ServerOptions options;
    const auto tcp = endpoint_of("--tcp", config.tcp);
    if (!tcp) {
        return tl::unexpected(tcp.error());
    }
    options.listen.endpoint = *tcp;
    if (config.http != "none") {
        const auto http = endpoint_of("--http", config.http);
        if (!http) {
            return fail(http.error().code, http.error().message + "; or none");
        }
        options.http = *http;
    }
    if (config.tls_cert.empty() != config.tls_key.empty()) {
        return fail(ErrorCode::invalid_argument, "--tls-cert and --tls-key belong together");
    }
    if (!config.tls_cert.empty()) {
        options.tls = TlsServer::Files{.certificate = config.tls_cert, .key = config.tls_key};
    }
    options.token_file = config.tokens;
    if (config.anonymous != "auto") {
        options.anonymous = config.anonymous == "yes";
    }
    if (options.anonymous == false && config.tokens.empty()) {
        return fail(ErrorCode::invalid_argument,
                    "--anonymous no needs --tokens FILE, or nobody could come in");
    }
    if (const auto viewer = viewer_folder(config.viewer); !viewer.empty() && options.http) {
        auto files = read_viewer_files(viewer);
        if (!files) {
            return fail(files.error().code, "--viewer: " + files.error().message);
        }
        options.viewer_files = *std::move(files);
    }
    options.store = config.store == "memory" ? StoreKind::memory : StoreKind::rocksdb;
    if (options.store == StoreKind::rocksdb && config.data.empty()) {
        return fail(ErrorCode::invalid_argument,
                    "--data DIR is needed: where chunks are kept (or use --store memory)");
    }
    options.data_directory = config.data;
    options.log_requests = config.log_level == "debug";
    options.publish_world = config.publish_world;
    if (config.tileset_levels % kSubtreeLevels != 0) {
        return fail(ErrorCode::invalid_argument,
                    "--tileset-levels " + std::to_string(config.tileset_levels) +
                        " is no multiple of " + std::to_string(kSubtreeLevels));
    }
    options.tileset_levels = static_cast<std::int32_t>(config.tileset_levels);
    options.workers = config.workers;
    options.cache_bytes_max = config.cache_mib << 20U;
    options.stack_cache_bytes_max = config.stack_cache_mib << 20U;
    options.listen.io_threads = config.io_threads;
    options.listen.sessions_max = config.sessions_max;
    options.listen.sessions_per_address_max = config.sessions_per_address_max;
    options.caps = caps_of(config);
    const auto seconds = [](std::uint64_t count) {
        return std::chrono::milliseconds(count * 1000);
    };
    options.timeouts.hello = seconds(config.header_timeout_s);
    options.timeouts.stall = seconds(config.stall_timeout_s);
    options.timeouts.idle = seconds(config.idle_timeout_s);
    options.timeouts.ping = options.timeouts.idle / 2;
    options.http_timeouts = {.header = options.timeouts.hello,
                             .stall = options.timeouts.stall,
                             .keep_alive = options.timeouts.idle};
    return options;
}

int serve_until_told(const ServerConfig& config, const ServerOptions& options, LogFormat format,
                     LogLevel level) {
    const ServerSignals signals;  // before any thread starts
    const Log log(format, level);
    log_start(log, options, raise_descriptor_limit());
    auto server = Server::start(options, log);
    if (!server) {
        std::fprintf(stderr, "terrane: %s\n", server.error().message.c_str());
        return kExitFailed;
    }
    if (format == LogFormat::json) {
        log.info("listening", {{"tcp", to_string((*server)->endpoint())},
                               {"world", options.world->definition.name},
                               {"fingerprint", to_hex(options.world->fingerprint)},
                               {"workers", std::uint64_t{options.workers}},
                               {"store", config.store}});
    }
    std::printf("listening on tcp %s: world \"%s\", fingerprint %s, %zu workers, %s store\n",
                to_string((*server)->endpoint()).c_str(), options.world->definition.name.c_str(),
                to_hex(options.world->fingerprint).c_str(), options.workers, config.store.c_str());
    if (const auto http = (*server)->http_endpoint()) {
        std::printf("listening on http %s: http%s://%s/\n", to_string(*http).c_str(),
                    options.tls ? "s" : "", to_string(*http).c_str());
    }
    std::fflush(stdout);
    const std::string signal = signals.wait([&] { (*server)->reload(); });
    log.info("draining; a second signal ends at once",
             {{"signal", signal}, {"sessions", std::uint64_t{(*server)->sessions()}}});
    (*server)->stop(std::chrono::seconds(config.drain_timeout_s));
    log.info("stopped", {{"generations", count_of((*server)->counters().generations)},
                         {"answers", count_of((*server)->counters().answers)},
                         {"cache_hits", count_of((*server)->counters(), &OutcomeCounters::cache)},
                         {"store_failures", count_of((*server)->counters().store_failures)},
                         {"store_corrupt", count_of((*server)->counters().store_corrupt)}});
    return kExitDone;
}

int run_serve(const ServeFlags& flags, const std::vector<bool>& given) {
    const auto config = config_of(flags, given);
    if (!config) {
        return wrong_use(config.error().message);
    }
    if (flags.print_config) {
        std::fputs(config_toml(*config).c_str(), stdout);
        return kExitDone;
    }
    const auto format = parse_log_format(config->log_format);
    const auto level = parse_log_level(config->log_level);
    if (!format || !level) {
        return wrong_use(format ? level.error().message : format.error().message);
    }
    auto options = options_of(*config);
    if (!options) {
        return wrong_use(options.error().message);
    }
    const MemoryBound bound = memory_bound_of(*options);
    if (config->memory_max_mib > 0 && mib(bound.sum()) >= config->memory_max_mib) {
        return wrong_use("the memory bound is " + std::to_string(mib(bound.sum()) + 1) +
                         " MiB, above --memory-max-mib " + std::to_string(config->memory_max_mib) +
                         "; lower --cache-mib, --workers or --sessions-max (" +
                         std::to_string(mib(bound.sessions)) + " MiB of it are sessions)");
    }
    if (config->world.empty()) {
        return wrong_use("--world FILE is needed: what is to be served");
    }
    options->world = open_world(config->world);
    if (!options->world) {
        return kExitWrongUse;
    }
    const std::size_t world_bytes = canonical_world_file(options->world->definition).size();
    if (world_bytes > kWorldTextBytesMax) {
        return wrong_use(config->world + ": " + std::to_string(world_bytes) +
                         " bytes when written out in full; at most " +
                         std::to_string(kWorldTextBytesMax) + " can be sent to clients");
    }
    return serve_until_told(*config, *options, *format, *level);
}

}  // namespace

void add_serve_command(CLI::App& app, int& exit_code) {
    const auto flags = std::make_shared<ServeFlags>();
    CLI::App* serve =
        app.add_subcommand("serve", "Make chunks of a world and send them to clients");
    serve->add_option("--config", flags->config, "TOML file of settings; flags win over it");
    serve->add_flag("--print-config", flags->print_config,
                    "Print all settings as such a file, and do nothing else");
    const ServerConfig defaults;
    flags->values.resize(settings().size());
    std::vector<CLI::Option*> options;
    for (std::size_t i = 0; i < settings().size(); ++i) {
        const Setting& setting = settings()[i];
        options.push_back(
            serve->add_option(flag_of(setting), flags->values[i], std::string(setting.help))
                ->default_str(value_text(defaults, setting)));
    }
    serve->footer(
        "SIGHUP reads certificate, key and tokens again. SIGTERM and SIGINT let clients finish.\n"
        "Examples:\n"
        "  terrane serve --world generator/worlds/basin.toml --data /tmp/basin\n"
        "  terrane serve --print-config > server.toml    then fill in world and data, and\n"
        "  terrane serve --config server.toml\n"
        "Exit code: 0 ended by a signal, 1 cannot serve, 2 wrong use.");
    serve->callback([flags, options, &exit_code] {
        std::vector<bool> given;
        given.reserve(options.size());
        for (const CLI::Option* option : options) {
            given.push_back(option->count() > 0);
        }
        exit_code = run_serve(*flags, given);
    });
}

}  // namespace terrane
