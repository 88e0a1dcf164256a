// terrane serve: makes chunks of one world on request and sends them to game clients, until told to
// stop.
//
// SIGTERM and SIGINT drain: what is under way is answered, everybody gets a goodbye, the store is
// flushed, exit code 0. A second signal ends the program at once.
#include "generator/world/world_file.h"
#include "protocol/base/hash.h"
#include "protocol/wire/limits.h"
#include "server/cli/open_world.h"
#include "server/cli/program.h"
#include "server/server.h"

#include <CLI/CLI.hpp>
#include <pthread.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>

namespace terrane {
namespace {

constexpr std::size_t kCacheMibMax = std::size_t{1} << 20U;

struct ServeArguments {
    std::string world;
    std::string data;
    std::string tcp = "127.0.0.1:7777";
    std::string http = "127.0.0.1:8080";
    std::size_t workers =
        std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, kWorkersMax);
    std::size_t cache_mib = 256;
    std::string store = "rocksdb";
    std::string log_format = "text";
    std::string log_level = "info";
};

/// Takes the two signals from every thread that starts after it and gives them to `wait`.
class StopSignals {
  public:
    StopSignals() {
        sigemptyset(&signals_);
        sigaddset(&signals_, SIGINT);
        sigaddset(&signals_, SIGTERM);
        pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
        std::signal(SIGPIPE, SIG_IGN);  // a client that left is an error code
    }

    /// Waits for one; from then on the next one ends the program.
    std::string wait() const {
        int signal = 0;
        sigwait(&signals_, &signal);
        std::signal(SIGINT, SIG_DFL);
        std::signal(SIGTERM, SIG_DFL);
        pthread_sigmask(SIG_UNBLOCK, &signals_, nullptr);
        return signal == SIGINT ? "SIGINT" : "SIGTERM";
    }

  private:
    sigset_t signals_{};
};

std::uint64_t mib(std::size_t bytes) {
    return bytes >> 20U;
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
    if (!is_loopback(options.listen.endpoint)) {
        log.warning("this address can be reached from other machines, unencrypted and by anybody",
                    {{"tcp", to_string(options.listen.endpoint)}});
    }
}

int wrong_use(const std::string& message) {
    std::fprintf(stderr, "terrane: %s\n", message.c_str());
    return kExitWrongUse;
}

int run_serve(const ServeArguments& arguments) {
    const auto endpoint = parse_endpoint(arguments.tcp);
    if (!endpoint) {
        return wrong_use("--tcp: " + endpoint.error().message);
    }
    const auto format = parse_log_format(arguments.log_format);
    const auto level = parse_log_level(arguments.log_level);
    if (!format || !level) {
        return wrong_use(format ? level.error().message : format.error().message);
    }
    ServerOptions options;
    options.store = arguments.store == "memory" ? StoreKind::memory : StoreKind::rocksdb;
    if (options.store == StoreKind::rocksdb && arguments.data.empty()) {
        return wrong_use("--data DIR is needed: where chunks are kept (or use --store memory)");
    }
    options.world = open_world(arguments.world);
    if (!options.world) {
        return kExitWrongUse;
    }
    const std::size_t world_bytes = canonical_world_file(options.world->definition).size();
    if (world_bytes > kWorldTextBytesMax) {
        return wrong_use(arguments.world + ": " + std::to_string(world_bytes) +
                         " bytes when written out in full; at most " +
                         std::to_string(kWorldTextBytesMax) + " can be sent to clients");
    }
    if (arguments.http != "none") {
        const auto http = parse_endpoint(arguments.http);
        if (!http) {
            return wrong_use("--http: " + http.error().message + "; or none");
        }
        options.http = *http;
    }
    options.data_directory = arguments.data;
    options.listen.endpoint = *endpoint;
    options.workers = arguments.workers;
    options.cache_bytes_max = arguments.cache_mib << 20U;

    const StopSignals signals;  // before any thread starts
    const Log log(*format, *level);
    log_start(log, options, raise_descriptor_limit());
    auto server = Server::start(options, log);
    if (!server) {
        std::fprintf(stderr, "terrane: %s\n", server.error().message.c_str());
        return kExitFailed;
    }
    if (*format == LogFormat::json) {
        log.info("listening", {{"tcp", to_string((*server)->endpoint())},
                               {"world", options.world->definition.name},
                               {"fingerprint", to_hex(options.world->fingerprint)},
                               {"workers", std::uint64_t{options.workers}},
                               {"store", arguments.store}});
    }
    std::printf("listening on tcp %s: world \"%s\", fingerprint %s, %zu workers, %s store\n",
                to_string((*server)->endpoint()).c_str(), options.world->definition.name.c_str(),
                to_hex(options.world->fingerprint).c_str(), options.workers,
                arguments.store.c_str());
    if (const auto http = (*server)->http_endpoint()) {
        std::printf("listening on http %s: http://%s/\n", to_string(*http).c_str(),
                    to_string(*http).c_str());
    }
    std::fflush(stdout);
    const std::string signal = signals.wait();
    log.info("draining; a second signal ends at once",
             {{"signal", signal}, {"sessions", std::uint64_t{(*server)->sessions()}}});
    (*server)->stop();
    log.info("stopped", {{"generations", count_of((*server)->counters().generations)},
                         {"answers", count_of((*server)->counters().answers)},
                         {"cache_hits", count_of((*server)->counters().cache_hits)},
                         {"store_failures", count_of((*server)->counters().store_failures)},
                         {"store_corrupt", count_of((*server)->counters().store_corrupt)}});
    return kExitDone;
}

}  // namespace

void add_serve_command(CLI::App& app, int& exit_code) {
    const auto arguments = std::make_shared<ServeArguments>();
    CLI::App* serve =
        app.add_subcommand("serve", "Make chunks of a world and send them to clients");
    serve->add_option("--world", arguments->world, "World file")->required();
    serve->add_option("--data", arguments->data, "Folder where chunks are kept; made if missing");
    serve->add_option("--tcp", arguments->tcp, "Address and port; port 0 takes a free one")
        ->capture_default_str();
    serve
        ->add_option("--http", arguments->http,
                     "Address and port of HTTP and WebSocket; none turns them off")
        ->capture_default_str();
    serve->add_option("--workers", arguments->workers, "Threads that make chunks")
        ->check(CLI::Range(std::size_t{1}, kWorkersMax))
        ->capture_default_str();
    serve->add_option("--cache-mib", arguments->cache_mib, "Memory for encoded chunks, MiB")
        ->check(CLI::Range(std::size_t{1}, kCacheMibMax))
        ->capture_default_str();
    serve->add_option("--store", arguments->store, "rocksdb, or memory: nothing is kept")
        ->check(CLI::IsMember({"rocksdb", "memory"}))
        ->capture_default_str();
    serve->add_option("--log-format", arguments->log_format, "text, or json: an object a line")
        ->check(CLI::IsMember({"text", "json"}))
        ->capture_default_str();
    serve->add_option("--log-level", arguments->log_level, "debug, info, warning, error or off")
        ->check(CLI::IsMember({"debug", "info", "warning", "error", "off"}))
        ->capture_default_str();
    serve->footer("Example: terrane serve --world generator/worlds/basin.toml --data /tmp/basin");
    serve->callback([arguments, &exit_code] { exit_code = run_serve(*arguments); });
}

}  // namespace terrane
